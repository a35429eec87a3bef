"""Every driver, on a rig of each kind: driving, and links that fail."""

from collections.abc import Iterator
from math import pi
from threading import Event, Thread

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.agent.drivers.driver import Command, DriverLost
from swarmwire.agent.on_robot.safety import Watchdog
from swarmwire.comms.base.clock import to_s
from tests.support.clocks import until
from tests.support.robots.faulty_link import Before, ByteByByte, CutAfter, FaultyLink, Late, Nothing
from tests.support.robots.rig import Fields, OwnWireRig, Rig, made_up_readings, opened, readings, sense_until_lost
from tests.support.robots.rigs import ON_ONE_RIG, RIGS

SLACK_S = 2.0  # of a machine that is busy
OWN = [name for name, kind in RIGS.items() if issubclass(kind, OwnWireRig)]
ON_OWN_WIRE = pytest.mark.parametrize("rig", OWN, indirect=True)

THAT_ROLL = pytest.mark.parametrize(
    "rig",
    [name for name, kind in RIGS.items() if "odometry" in kind.measures() and not kind.counts_steps],
    indirect=True,
)


def with_sensor(name: str) -> pytest.MarkDecorator:
    """Only rigs that have it."""
    return pytest.mark.parametrize("rig", [rig for rig, kind in RIGS.items() if name in kind.measures()], indirect=True)


def test_driver_has_the_sensors_of_robot_and_gateway(connected: Rig) -> None:
    assert connected.driver.measures == connected.measures()
    assert connected.driver.measures <= connected.body.sensors.keys()
    assert connected.driver.measures <= connected.gateway.sensors


@ON_ONE_RIG
@given(data=st.data())
def test_reading_returns_with_the_resolution_of_the_wire(connected: Rig, data: st.DataObject) -> None:
    connected.come_back(data.draw(made_up_readings(connected.body, connected.driver.measures)))


def test_driver_reads_only_requested_sensors(connected: Rig) -> None:
    for name in connected.driver.measures:
        assert {field.partition(".")[0] for field in connected.driver.sense(frozenset({name}))} == {name}
    assert connected.driver.sense(frozenset()) == {}


@with_sensor("proximity")
def test_wall_on_the_left_is_read_on_the_left(connected: Rig) -> None:
    proximity = connected.body.proximity
    assert proximity is not None
    on_the_left = proximity.angle_rad > 0.0
    sensed = connected.come_back({"proximity.value": 0.5 * on_the_left[None, :]})
    assert (sensed["proximity.value"][0, on_the_left] > 0.4).all()
    assert (sensed["proximity.value"][0, ~on_the_left] < 0.1).all()


@with_sensor("compass")
@pytest.mark.parametrize("heading_rad", [0.0, 0.5 * pi, -0.5 * pi, 3.0])
def test_heading_is_counter_clockwise_from_the_arenas_x(connected: Rig, heading_rad: float) -> None:
    sensed = connected.come_back({"compass.heading_rad": np.array([heading_rad])})
    assert sensed["compass.heading_rad"][0] == pytest.approx(heading_rad, abs=1e-5)


@THAT_ROLL
@ON_ONE_RIG
@given(distances=st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), min_size=1, max_size=20))
def test_odometry_adds_up_over_any_distance(connected: Rig, distances: list[tuple[float, float]]) -> None:
    left_m, right_m = (
        float(connected.driver.sense(frozenset({"odometry"}))[f"odometry.{side}_m"][0]) for side in ("left", "right")
    )
    for left, right in distances:
        left_m, right_m = left_m + left * connected.farthest_m, right_m + right * connected.farthest_m
        connected.come_back({"odometry.left_m": np.array([left_m]), "odometry.right_m": np.array([right_m])})


@ON_ONE_RIG
@given(share=st.floats(-0.5, 0.5), turn=st.floats(-0.5, 0.5))
def test_speeds_within_the_limits_arrive_unchanged(connected: Rig, share: float, turn: float) -> None:
    linear_mps, angular_radps = share * connected.body.max_linear_mps, turn * connected.body.max_angular_radps
    drive(connected, linear_mps, angular_radps)


@pytest.mark.parametrize("sign", [1, -1])
def test_speeds_beyond_the_limits_are_clipped(connected: Rig, sign: int) -> None:
    body = connected.body
    connected.driver.act(Command(sign * 10.0 * body.max_linear_mps, 0.0))
    connected.until_told(sign * body.max_linear_mps, 0.0)
    connected.driver.act(Command(0.0, sign * 10.0 * body.max_angular_radps))
    connected.until_told(0.0, sign * body.max_angular_radps)


def test_led_command_changes_that_led_alone(connected: Rig) -> None:
    dark = 0
    shown = dict.fromkeys(range(connected.body.led_count), dark)
    colours = dict.fromkeys(shown, 0xFF0000) | {9: 0x00FF00}  # the e-puck2's body LED is green
    for which in shown:
        for colour in (colours[which], dark, colours[which]):
            connected.driver.act(Command(0.01 * (which + 1), leds={which: colour}))
            connected.driver.sense(frozenset())

            def shows(which: int = which, colour: int = colour) -> bool:
                shown.update(connected.pop_commands().leds)
                return shown[which] == colour

            until(shows)
    assert shown == {which: colours[which] for which in shown}


def test_driver_stops_its_robot_when_opened(rig: Rig) -> None:
    rig.connect()
    if rig.stands_until_commanded:
        assert all(rig.same_speeds(speeds, (0.0, 0.0)) for speeds in rig.pop_commands().speeds)
    else:
        rig.until_told(0.0, 0.0)


def drive(rig: Rig, linear_mps: float = 0.05, angular_radps: float = 0.0) -> None:
    rig.driver.act(Command(linear_mps, angular_radps))
    rig.until_told(linear_mps, angular_radps)


def test_driver_stops_its_robot_when_closed_and_when_opened_again(connected: Rig) -> None:
    drive(connected)
    connected.driver.open()
    connected.until_told(0.0, 0.0)
    drive(connected, 0.03)
    connected.driver.close()
    connected.until_told(0.0, 0.0)
    connected.driver.close()


@pytest.fixture(autouse=True)
def soon_lost(rig: Rig) -> None:
    """A robot that is silent for a moment counts as lost, before any driver is made."""
    rig.silent_s = 0.3 if isinstance(rig, OwnWireRig) else 1.0


def test_address_without_a_robot_is_reported_at_once(rig: Rig) -> None:
    rig.gateway.close()
    rig.connect_s = 0.3
    driver = rig.made_driver(rig.address)
    with pytest.raises(DriverLost):
        driver.open()
    with pytest.raises(DriverLost):
        driver.sense(frozenset())
    with pytest.raises(DriverLost):
        driver.act(Command())


def test_dead_robot_is_lost_in_time_and_reconnected_when_it_lives(connected: Rig) -> None:
    connected.publish(readings(0.0))
    connected.driver.sense(frozenset({"imu"}))
    connected.publish(readings(0.0), alive=False)
    began_ns = connected.clock.now_ns()
    sense_until_lost(connected)
    took_s = to_s(connected.clock.now_ns() - began_ns)
    assert took_s < connected.silent_s + SLACK_S

    connected.connect_s = 0.3
    assert not opened(connected.made_driver(connected.address))
    connected.publish(readings(0.0))
    until(lambda: opened(connected.driver))
    connected.come_back(readings(0.01))


def test_dead_robot_applies_no_command(connected: Rig) -> None:
    connected.publish(readings(0.0), alive=False)
    connected.pop_commands()
    connected.driver.act(Command(0.05, 0.0))
    sense_until_lost(connected)
    assert all(linear_mps == 0.0 for linear_mps, _ in connected.pop_commands().speeds)


def test_revived_robot_is_at_rest(connected: Rig) -> None:
    drive(connected)
    connected.publish(readings(0.0), alive=False)
    connected.publish(readings(0.0))
    connected.until_told(0.0, 0.0)


@THAT_ROLL
def test_odometry_continues_after_a_restart_of_the_gateway(connected: Rig) -> None:
    connected.come_back(rolled(0.0))
    far_m = 0.8 * connected.farthest_m
    connected.come_back(rolled(far_m))
    connected.gateway.close()
    sense_until_lost(connected)

    connected.reopen()
    connected.publish(rolled(far_m + 0.01))  # it rolled on for a moment
    connected.driver.open()
    connected.come_back(rolled(far_m + 0.01))
    connected.come_back(rolled(2.0 * far_m))


def rolled(travel_m: float) -> Fields:
    return {"odometry.left_m": np.array([travel_m]), "odometry.right_m": np.array([travel_m])}


def test_motors_can_be_stopped_by_another_thread_during_a_read(connected: Rig) -> None:
    driver, done = connected.driver, Event()
    drive(connected, 0.05, 1.0)

    def read() -> None:
        while not done.is_set():
            driver.sense(driver.measures)

    reader = Thread(target=read)
    reader.start()
    driver.stop()
    connected.until_told(0.0, 0.0)
    done.set()
    reader.join()
    assert all(connected.same_speeds(speeds, (0.0, 0.0)) for speeds in connected.pop_commands().speeds)


def test_stopped_robot_drives_with_the_next_command(connected: Rig) -> None:
    connected.driver.act(Command(0.05, 0.0))
    connected.driver.stop()
    drive(connected, 0.03)


def test_watchdog_stops_a_robot_whose_agent_is_silent(connected: Rig) -> None:
    watchdog = Watchdog(0.1, connected.driver.stop, connected.clock)
    watchdog.start()
    try:
        drive(connected, 0.05, 1.0)
        watchdog.feed()
        connected.until_told(0.0, 0.0)
        until(lambda: watchdog.stops == 1)
    finally:
        watchdog.end()


def test_stop_of_an_unconnected_robot_does_nothing(rig: Rig) -> None:
    driver = rig.made_driver(rig.address)
    driver.stop()
    driver.close()
    driver.stop()
    assert rig.pop_commands().speeds == []


@pytest.fixture
def link(rig: OwnWireRig) -> Iterator[FaultyLink]:
    """A link that passes everything on, with the rig's driver open at its end."""
    with FaultyLink(rig.address_of_link()) as link:
        rig.connect(link.address)
        rig.pop_commands()
        yield link
        rig.driver.close()


@ON_OWN_WIRE
def test_answers_are_read_byte_by_byte(rig: OwnWireRig, link: FaultyLink) -> None:
    link.answers = ByteByByte()
    for turn_radps in (0.1, 0.2, 0.3):
        rig.come_back(readings(turn_radps))


@ON_OWN_WIRE
def test_commands_are_read_byte_by_byte(rig: OwnWireRig, link: FaultyLink) -> None:
    link.commands = ByteByByte()
    for linear_mps in (0.05, -0.02):
        drive(rig, linear_mps, 1.0)


@ON_OWN_WIRE
def test_garbage_ends_the_connection_and_a_new_one_works(rig: OwnWireRig, link: FaultyLink) -> None:
    link.answers = Before(b"\x77")
    sense_until_lost(rig)
    assert rig.driver.counts()["garbage"] == 1
    until(lambda: opened(rig.driver))
    rig.come_back(readings(0.1))


@ON_OWN_WIRE
@pytest.mark.parametrize(("hang_up", "count"), [(False, "silences"), (True, "hung_up")])
@pytest.mark.parametrize("size", [0, 1, 60])
def test_robot_that_is_silent_or_disconnects_within_an_answer_is_lost(
    rig: OwnWireRig, link: FaultyLink, size: int, hang_up: bool, count: str
) -> None:
    link.answers = CutAfter(size, hang_up=hang_up)
    sense_until_lost(rig)
    assert rig.driver.counts()[count] == 1
    link.answers = Nothing()
    until(lambda: opened(rig.driver))
    rig.come_back(readings(0.1))


@ON_OWN_WIRE
def test_late_answer_leaves_the_previous_reading_until_it_arrives(rig: OwnWireRig, link: FaultyLink) -> None:
    rig.come_back(readings(0.1))
    link.answers = late = Late()
    rig.publish(readings(0.2))
    before = rig.driver.sense(frozenset({"imu"}))
    assert before["imu.turn_radps"] == pytest.approx(0.1, abs=1e-3)
    assert rig.driver.counts()["late_answers"] >= 1
    late.let_go.set()
    rig.come_back(readings(0.2))
    assert "hung_up" not in rig.driver.counts()


@ON_OWN_WIRE
def test_stop_does_not_wait_for_a_robot_out_of_reach(rig: OwnWireRig, link: FaultyLink) -> None:
    link.answers, link.commands = CutAfter(0), CutAfter(0)
    began_ns = rig.clock.now_ns()
    for _ in range(100):
        rig.driver.stop()
    assert rig.clock.now_ns() - began_ns < 1_000_000_000
    sense_until_lost(rig)


@ON_OWN_WIRE
def test_robot_continues_its_last_command_after_a_lost_link(rig: OwnWireRig, link: FaultyLink) -> None:
    drive(rig)
    link.answers = CutAfter(0, hang_up=True)
    sense_until_lost(rig)
    speeds = rig.pop_commands().speeds
    assert all(np.isclose(linear_mps, 0.05, atol=1e-3) for linear_mps, _ in speeds)
