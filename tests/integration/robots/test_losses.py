"""Robots that are stopped, lost, or behind a link that misbehaves, on every rig."""

from collections.abc import Iterator
from threading import Event, Thread

import numpy as np
import pytest

from swarmwire.agent.drivers.driver import Command, DriverLost
from swarmwire.agent.on_robot.safety import Watchdog
from swarmwire.comms.clock import to_s
from tests.support.clocks import until
from tests.support.robots.faulty_link import Before, ByteByByte, CutAfter, FaultyLink, Late, Nothing
from tests.support.robots.rig import OwnWireRig, Rig, opened, readings, sense_until_lost
from tests.support.robots.rigs import RIGS

SLACK_S = 2.0  # of a machine that is busy
OWN = [name for name, kind in RIGS.items() if issubclass(kind, OwnWireRig)]
ON_OWN_WIRE = pytest.mark.parametrize("rig", OWN, indirect=True)


@pytest.fixture(autouse=True)
def soon_lost(rig: Rig) -> None:
    """A robot that is silent for a moment counts as lost, before any driver is made."""
    rig.silent_s = 0.3 if isinstance(rig, OwnWireRig) else 1.0


def test_nobody_at_the_address_is_told_at_once(rig: Rig) -> None:
    rig.gateway.close()
    rig.connect_s = 0.3
    driver = rig.made_driver(rig.address)
    with pytest.raises(DriverLost):
        driver.open()
    with pytest.raises(DriverLost):
        driver.sense(frozenset())
    with pytest.raises(DriverLost):
        driver.act(Command())


def test_a_robot_that_dies_is_lost_in_time_and_found_again_when_it_lives(connected: Rig) -> None:
    connected.publish(readings(0.0))
    connected.driver.sense(frozenset({"odometry"}))
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


def test_a_dead_robot_takes_no_command(connected: Rig) -> None:
    connected.publish(readings(0.0), alive=False)
    connected.told()
    connected.driver.act(Command(0.05, 0.0))
    sense_until_lost(connected)
    assert all(linear_mps == 0.0 for linear_mps, _ in connected.told().speeds)


def test_a_robot_that_is_revived_is_at_rest(connected: Rig) -> None:
    connected.driver.act(Command(0.05, 0.0))
    connected.until_told(0.05, 0.0)
    connected.publish(readings(0.0), alive=False)
    connected.publish(readings(0.0))
    connected.until_told(0.0, 0.0)


def test_odometry_goes_on_after_the_gateway_was_closed_and_opened_again(connected: Rig) -> None:
    connected.come_back(readings(0.0))
    far_m = 0.8 * connected.farthest_m
    connected.come_back(readings(far_m))
    connected.gateway.close()
    sense_until_lost(connected)

    connected.reopen()
    connected.publish(readings(far_m + 0.01))  # it rolled on for a moment
    connected.driver.open()
    connected.come_back(readings(far_m + 0.01))
    connected.come_back(readings(2.0 * far_m))


def test_a_driver_that_reconnects_has_its_robot_at_rest_first(connected: Rig) -> None:
    connected.driver.act(Command(0.05, 0.0))
    connected.until_told(0.05, 0.0)
    connected.driver.open()
    connected.until_told(0.0, 0.0)
    connected.driver.act(Command(0.03, 0.0))
    connected.until_told(0.03, 0.0)


def test_another_thread_stops_the_motors_while_this_one_reads(connected: Rig) -> None:
    driver, done = connected.driver, Event()
    driver.act(Command(0.05, 1.0))
    connected.until_told(0.05, 1.0)

    def read() -> None:
        while not done.is_set():
            driver.sense(driver.measures)

    reader = Thread(target=read)
    reader.start()
    driver.stop()
    connected.until_told(0.0, 0.0)
    done.set()
    reader.join()
    assert all(connected.same_speeds(speeds, (0.0, 0.0)) for speeds in connected.told().speeds)


def test_a_stopped_robot_drives_on_with_the_next_command(connected: Rig) -> None:
    connected.driver.act(Command(0.05, 0.0))
    connected.driver.stop()
    connected.driver.act(Command(0.03, 0.0))
    connected.until_told(0.03, 0.0)


def test_a_watchdog_stops_a_robot_whose_agent_falls_silent(connected: Rig) -> None:
    watchdog = Watchdog(0.1, connected.driver.stop, connected.clock)
    watchdog.start()
    try:
        connected.driver.act(Command(0.05, 1.0))
        watchdog.feed()
        connected.until_told(0.05, 1.0)
        connected.until_told(0.0, 0.0)
        until(lambda: watchdog.stops == 1)
    finally:
        watchdog.end()


def test_to_stop_a_robot_that_is_not_connected_does_nothing(rig: Rig) -> None:
    driver = rig.made_driver(rig.address)
    driver.stop()
    driver.close()
    driver.stop()
    assert rig.told().speeds == []


@pytest.fixture
def link(rig: OwnWireRig) -> Iterator[FaultyLink]:
    """A link that passes everything on, with the rig's driver open at its end."""
    with FaultyLink(rig.address_of_link()) as made:
        rig.connect(made.address)
        rig.told()
        yield made
        rig.driver.close()


@ON_OWN_WIRE
def test_answers_that_come_byte_by_byte_are_read(rig: OwnWireRig, link: FaultyLink) -> None:
    link.answers = ByteByByte()
    for travel_m in (0.1, 0.2, 0.3):
        rig.come_back(readings(travel_m))


@ON_OWN_WIRE
def test_commands_that_come_byte_by_byte_are_read(rig: OwnWireRig, link: FaultyLink) -> None:
    link.commands = ByteByByte()
    for linear_mps in (0.05, -0.02):
        rig.driver.act(Command(linear_mps, 1.0))
        rig.until_told(linear_mps, 1.0)


@ON_OWN_WIRE
def test_garbage_ends_the_connection_and_a_new_one_reads_on(rig: OwnWireRig, link: FaultyLink) -> None:
    link.answers = Before(b"\x77")
    sense_until_lost(rig)
    assert rig.driver.counts()["garbage"] == 1
    until(lambda: opened(rig.driver))
    rig.come_back(readings(0.1))


@ON_OWN_WIRE
@pytest.mark.parametrize("size", [0, 1, 60])
def test_a_robot_that_falls_silent_within_an_answer_is_lost(rig: OwnWireRig, link: FaultyLink, size: int) -> None:
    link.answers = CutAfter(size)
    sense_until_lost(rig)
    assert rig.driver.counts()["silences"] == 1
    link.answers = Nothing()
    until(lambda: opened(rig.driver))
    rig.come_back(readings(0.1))


@ON_OWN_WIRE
@pytest.mark.parametrize("size", [0, 1, 60])
def test_a_robot_that_hangs_up_within_an_answer_is_lost(rig: OwnWireRig, link: FaultyLink, size: int) -> None:
    link.answers = CutAfter(size, hang_up=True)
    sense_until_lost(rig)
    assert rig.driver.counts()["hung_up"] == 1
    link.answers = Nothing()
    until(lambda: opened(rig.driver))
    rig.come_back(readings(0.1))


@ON_OWN_WIRE
def test_an_answer_that_is_late_leaves_the_reading_before_and_is_read_when_it_comes(
    rig: OwnWireRig, link: FaultyLink
) -> None:
    rig.come_back(readings(0.1))
    link.answers = late = Late()
    rig.publish(readings(0.2))
    before = rig.driver.sense(frozenset({"odometry"}))
    assert before["odometry.left_m"] == pytest.approx(0.1, abs=1e-3)
    assert rig.driver.counts()["late_answers"] >= 1
    late.let_go.set()
    rig.come_back(readings(0.2))
    assert "hung_up" not in rig.driver.counts()


@ON_OWN_WIRE
def test_a_robot_that_cannot_be_reached_is_not_waited_for_by_who_stops_it(rig: OwnWireRig, link: FaultyLink) -> None:
    link.answers, link.commands = CutAfter(0), CutAfter(0)
    began_ns = rig.clock.now_ns()
    for _ in range(100):
        rig.driver.stop()
    assert rig.clock.now_ns() - began_ns < 1_000_000_000
    sense_until_lost(rig)


@ON_OWN_WIRE
def test_a_robot_goes_on_as_it_was_told_when_its_link_is_lost(rig: OwnWireRig, link: FaultyLink) -> None:
    rig.driver.act(Command(0.05, 0.0))
    rig.until_told(0.05, 0.0)
    link.answers = CutAfter(0, hang_up=True)
    sense_until_lost(rig)
    told = rig.told().speeds
    assert all(np.isclose(linear_mps, 0.05, atol=1e-3) for linear_mps, _ in told)
