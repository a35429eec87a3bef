"""Gateways."""

from importlib.metadata import EntryPoint
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.base import plugins as installed_classes
from swarmwire.comms.base.clock import NS_PER_S, WallClock
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.observe.truth import Group
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.comms.robot.packets import NO_TX_STATUSES, Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, GroupReadings, SparseTable
from swarmwire.world.backends.pacing import Pace
from swarmwire.world.gateways import gateway
from swarmwire.world.gateways.backend import GatewayBackend, GatewayGroup
from swarmwire.world.gateways.crazyflie import CrazyflieGateway
from swarmwire.world.gateways.epuck2 import Epuck2Gateway
from swarmwire.world.gateways.gateway import Gateway
from swarmwire.world.gateways.ros2 import Ros2Gateway
from swarmwire.world.subtick import Subticks
from tests.support.agent.hosts import MEASURES, received_from
from tests.support.clocks import FakeClock
from tests.support.world.gateways import ScriptedGateway, ScriptedOptions

TICK_NS = NS_PER_S // 10
HERE = "tests.support.world.gateways:ScriptedGateway"


class Inner:
    """A backend that drives its robots 0 and 1 at 0.5 m/s, and keeps what it was given."""

    def __init__(self) -> None:
        self.given: list[Any] = []

    def start(self) -> None:
        self.given.append("started")

    def act(self, tick, sensors, received, tx_status=NO_TX_STATUSES) -> Actions:
        self.given.append((tick, sensors, received, tx_status))
        rows = np.array([0, 1])
        sent = SentPackets(rows[:1], np.array([BROADCAST]), Payloads.from_rows([b"inner"]))
        return Actions(rows, np.ones(2, np.bool_), np.full(2, 0.5), np.zeros(2), np.zeros(2), sent)

    def receive(self, received, tx_status) -> None:
        self.given.append(("received", received, tx_status))

    def on_receive(self, tick, at_ns) -> SentPackets:
        return SentPackets(np.array([1]), np.array([BROADCAST]), Payloads.from_rows([b"echo"]))

    def counts(self) -> dict[str, int]:
        return {"inner": 1}

    def close(self) -> None:
        self.given.append("closed")


class RadioMedium:
    """a medium whose robots send one packet in each tick."""

    def __init__(self) -> None:
        self.published: list[Any] = []

    def publish(self, tick, received, tx_status) -> None:
        self.published.append((tick, received, tx_status))

    def pop_packets(self) -> SentPackets:
        return SentPackets(np.array([3]), np.array([0]), Payloads.from_rows([b"outer"]))

    def pop_notes(self) -> tuple[SparseTable, SparseTable]:
        row, place = np.array([3]), np.zeros(1, np.int64)
        return SparseTable(row, place, np.zeros(1), ("search",)), SparseTable(row, place, np.array([1.25]))

    def counts(self) -> dict[str, int]:
        return {"late": 2, "odd": 0, "packets_to_robots": 9}


class Around:
    """A backend of two robots of its own and three behind a gateway, rows 2 to 4."""

    def __init__(self, *, medium: bool = True, subtick_s: float | None = None) -> None:
        self.clock, self.inner, self.said = FakeClock(), Inner(), []
        self.medium = RadioMedium() if medium else None
        body = load_body("epuck2")
        self.gateway = ScriptedGateway(("b-0", "b-1", "b-2"), body, "", ScriptedOptions(), self.clock)
        group = GatewayGroup(Group("b", body, 2, 5), "scripted", self.gateway)
        pace = Pace(self.clock, 10, 1.0, self.said.append)
        self.shown = 0
        subticks = Subticks(self.clock, pace, 10, subtick_s) if subtick_s else None
        self.backend = GatewayBackend(
            self.inner, [group], self.medium, pace, self.show, lambda: {"unseen": 4}, subticks
        )

    def show(self) -> None:
        self.shown += 1

    def act(
        self,
        tick: int,
        alive: list[int],
        received: ReceivedPackets | None = None,
        tx_status: TxStatuses = NO_TX_STATUSES,
        ages: dict[str, int | None] | None = None,
    ) -> Actions:
        rows = np.array(alive, np.int64)
        fields = {"proximity.value": np.tile(rows + 0.1 * tick, (8, 1)).T, "odometry.left_m": rows + 0.01 * tick}
        sensors = {"a": GroupReadings(np.array([0, 1]), {}), "b": GroupReadings(rows, fields, ages or {})}
        return self.backend.act(
            tick, sensors, ReceivedPackets.none(MEASURES) if received is None else received, tx_status
        )


def commands(actions: Actions) -> dict[int, tuple[float, float]]:
    columns = (actions.rows, actions.linear_mps, actions.angular_radps)
    return {
        row: (v, w)
        for row, v, w, new in zip(*(c.tolist() for c in columns), actions.drive.tolist(), strict=True)
        if new
    }


def test_each_tick_tells_all_that_is_sensed_and_takes_what_programs_command() -> None:
    around = Around()
    around.gateway.drive = {1: (0.05, -0.7)}
    around.gateway.leds = SparseTable(np.array([2]), np.array([4]), np.array([float(0xFF0000)]))
    actions = around.act(0, [2, 3, 4])
    (told,) = around.gateway.published
    assert told.time_ns == 0
    assert told.alive.tolist() == [True] * 3
    assert told.fields["proximity.value"].shape == (3, 8)
    assert told.fields["odometry.left_m"].tolist() == [2.0, 3.0, 4.0]
    assert commands(actions) == {0: (0.5, 0.0), 1: (0.5, 0.0), 3: (0.05, -0.7)}
    assert sorted(actions.rows.tolist()) == [0, 1, 2, 3, 4]
    assert (actions.leds.rows.tolist(), actions.leds.slot.tolist()) == ([4], [4])
    assert commands(around.act(1, [2, 3, 4])) == {0: (0.5, 0.0), 1: (0.5, 0.0)}  # the last command holds
    assert [told.time_ns for told in around.gateway.published] == [0, TICK_NS]
    assert around.shown == 2


def test_readings_have_their_ages_and_are_left_out_before_the_first() -> None:
    around = Around()
    around.act(3, [2, 3, 4], ages={"proximity": None, "odometry": 2})
    around.act(4, [2, 3, 4], ages={"proximity": 4})
    first, second = around.gateway.published
    assert list(first.fields) == ["odometry.left_m"]
    assert (first.ages_ns, second.ages_ns) == ({"odometry": 2 * TICK_NS}, {"proximity": 4 * TICK_NS})


def test_the_dead_are_told_as_dead_and_their_readings_stay_what_they_were() -> None:
    around = Around()
    around.act(0, [2, 3, 4])
    around.act(1, [2, 4])
    around.act(2, [])
    _, one_dead, all_dead = around.gateway.published
    assert one_dead.alive.tolist() == [True, False, True]
    assert one_dead.fields["odometry.left_m"].tolist() == pytest.approx([2.01, 3.0, 4.01])
    assert not all_dead.alive.any()
    assert all_dead.fields["odometry.left_m"].tolist() == one_dead.fields["odometry.left_m"].tolist()


def test_readings_that_were_handed_over_are_never_written_to_again() -> None:
    around = Around()
    for tick, alive in enumerate(([2, 4], [3, 4])):
        around.act(tick, alive)
    first, second = around.gateway.published
    assert first.fields["odometry.left_m"].tolist() == [2.0, 0.0, 4.0]
    assert second.fields["odometry.left_m"].tolist() == pytest.approx([2.0, 3.01, 4.01])


def test_agents_here_get_their_own_groups_alone_and_the_air_gets_the_others_packets() -> None:
    around = Around()
    sent = SentPackets(np.array([0]), np.array([BROADCAST]), Payloads.from_rows([b"beacon"]))
    tx_status = TxStatuses(np.array([0, 3]), np.array([7, 8]), np.array([0, 1]))
    actions = around.act(0, [2, 3, 4], received_from(sent, [1, 2, 4]), tx_status)
    _, sensors, received, _ = around.inner.given[-1]
    assert list(sensors) == ["a"]
    assert len(received) == 3  # a host takes what is for its robots
    assert around.medium is not None
    ((tick, outside, told),) = around.medium.published
    assert tick == 0
    assert outside.receiver.tolist() == [2, 4]
    assert told.row.tolist() == [3]
    assert [actions.sent.payloads.row(i) for i in range(2)] == [b"inner", b"outer"]
    assert actions.sent.sender.tolist() == [0, 3]


def test_what_agents_of_robots_outside_noted_is_among_the_actions() -> None:
    actions = Around().act(0, [2, 3, 4])
    assert (actions.notes.rows.tolist(), actions.notes.names, actions.notes.integers.tolist()) == (
        [3],
        ("search",),
        [0],
    )
    assert (actions.values.rows.tolist(), actions.values.value.tolist()) == ([3], [1.25])


def test_without_a_radio_nothing_but_commands_is_taken() -> None:
    around = Around(medium=False)
    actions = around.act(0, [2, 3, 4])
    assert [actions.sent.payloads.row(0)] == [b"inner"]
    assert len(actions.notes) == len(actions.values) == 0


def test_a_group_that_does_not_act_in_a_tick_is_told_nothing_and_commanded_all_the_same() -> None:
    around = Around()
    around.gateway.drive = {0: (0.1, 0.0)}
    actions = around.backend.act(3, {"a": GroupReadings(np.array([0, 1]), {})}, ReceivedPackets.none(MEASURES))
    assert not around.gateway.published
    assert commands(actions)[2] == (0.1, 0.0)


def test_a_tick_lasts_as_long_as_it_says_and_lag_is_reported() -> None:
    around = Around()
    began_ns = around.clock.now_ns()
    around.act(0, [2, 3, 4])
    assert around.clock.now_ns() - began_ns == TICK_NS
    around.clock.time_ns += 3 * TICK_NS
    around.act(1, [2, 3, 4])
    report = around.backend.report()
    assert (report.factor, report.missed_ticks, report.worst_lag_s) == (1.0, 1, pytest.approx(0.2))
    assert len(around.said) == 1


def test_a_loop_that_lags_by_more_than_a_tick_does_not_make_up_for_it() -> None:
    around = Around()
    around.act(0, [2, 3, 4])
    around.clock.time_ns += 30 * TICK_NS
    around.act(1, [2, 3, 4])
    began_ns = around.clock.now_ns()
    around.act(2, [2, 3, 4])
    assert around.clock.now_ns() - began_ns == TICK_NS
    around.clock.time_ns += TICK_NS + TICK_NS // 2
    around.act(3, [2, 3, 4])  # half a tick late: the next one is shorter
    around.act(4, [2, 3, 4])
    assert around.clock.now_ns() - began_ns == 3 * TICK_NS
    assert around.backend.report().missed_ticks == 2


def test_faults_are_counted_by_kind_of_gateway_and_only_where_there_are_any() -> None:
    around = Around()
    around.gateway.faults = {"garbage": 3, "half_packets": 0}
    assert around.backend.counts() == {"inner": 1, "unseen": 4, "scripted_garbage": 3, "air_late": 2}


def test_the_agents_of_others_start_and_end_with_it() -> None:
    around = Around()
    around.backend.start()
    around.backend.close()
    assert around.inner.given == ["started", "closed"]


class QuietAir:
    """The loop's air, in which robots 0 and 3 hear one packet in the middle of the tick."""

    def __init__(self) -> None:
        self.sent: list[tuple[int | None, bytes]] = []
        self.told = False

    def send(self, put) -> None:
        if len(put.sent):
            self.sent.append((put.tick, put.sent.payloads.row(0)))

    def advance(self, until_ns) -> tuple[ReceivedPackets, TxStatuses]:
        due, self.told = not self.told and until_ns >= TICK_NS // 2, self.told or until_ns >= TICK_NS // 2
        sent = SentPackets(np.array([1]), np.array([BROADCAST]), Payloads.from_rows([b"beacon"]))
        return received_from(sent, [0, 3] if due else []), NO_TX_STATUSES


def test_in_subticks_robots_behind_gateways_are_told_when_it_is_due_and_what_they_send_goes_out_at_once() -> None:
    around, medium = Around(subtick_s=0.010), QuietAir()
    rows = np.array([2, 3, 4])
    fields = {"proximity.value": np.zeros((3, 8)), "odometry.left_m": np.zeros(3)}
    sensors = {"a": GroupReadings(np.array([0, 1]), {}), "b": GroupReadings(rows, fields)}
    around.gateway.drive = {1: (0.05, -0.7)}
    actions = around.backend.act_in_time(0, sensors, ReceivedPackets.none(MEASURES), NO_TX_STATUSES, medium)
    assert around.medium is not None
    received = [told.receiver.tolist() for _, told, _ in around.medium.published if len(told)]
    assert received == [[3]]
    assert [given[1].receiver.tolist() for given in around.inner.given if given[0] == "received"] == [[], [0, 3]]
    assert medium.sent[:2] == [(0, b"inner"), (None, b"outer")]
    assert (None, b"echo") in medium.sent
    assert set(medium.sent[2:]) == {(None, b"outer"), (None, b"echo")}
    assert not len(actions.sent)
    assert commands(actions)[3] == (0.05, -0.7)
    assert around.backend.report().subtick_s == 0.010


def installed(monkeypatch: pytest.MonkeyPatch, *points: tuple[str, str]) -> None:
    found = [EntryPoint(name, value, gateway.GROUP) for name, value in points]
    monkeypatch.setattr(installed_classes, "entry_points_of", lambda group: found if group == gateway.GROUP else [])


def refused(name: str) -> str:
    with pytest.raises(BadInput) as caught:
        gateway.gateway_kind(name, "--gateway", name)
    text = str(caught.value)
    assert text.startswith(f"--gateway: {name}: ")
    assert "\n" not in text
    return text


def test_those_that_come_with_swarmwire_are_known_without_being_imported() -> None:
    assert set(gateway.gateway_names()) >= {"epuck2", "ros2"}


def test_a_gateway_is_found_by_its_name(monkeypatch) -> None:
    installed(monkeypatch, ("scripted", HERE))
    assert gateway.gateway_kind("scripted", "--gateway") is ScriptedGateway


def test_an_unknown_name_is_refused_with_those_there_are(monkeypatch) -> None:
    installed(monkeypatch, ("scripted", HERE))
    assert "scripted" in refused("epuck3")


def test_a_name_that_two_packages_bring_is_refused(monkeypatch) -> None:
    installed(monkeypatch, ("scripted", HERE), ("scripted", "other.package:Gateway"))
    assert "other.package:Gateway" in refused("scripted")


def test_a_package_that_is_missing_is_named(monkeypatch) -> None:
    installed(monkeypatch, ("far", "a_package_that_is_not_here:Gateway"))
    assert "does not import: No module named 'a_package_that_is_not_here'" in refused("far")


@pytest.mark.parametrize(
    "value", ["swarmwire.world.gateways.gateway:Nothing", "swarmwire.world.gateways.gateway:GROUP"]
)
def test_what_is_no_gateway_is_refused(monkeypatch, value) -> None:
    installed(monkeypatch, ("odd", value))
    refused("odd")


def said(kind: type[Gateway], body: str) -> str:
    return "; ".join(kind(("a-0",), load_body(body), "", kind.options(), WallClock()).differences())


@pytest.mark.parametrize(
    ("kind", "body"), [(CrazyflieGateway, "crazyflie"), (Epuck2Gateway, "epuck2"), (Ros2Gateway, "turtlebot3-burger")]
)
def test_of_the_robot_itself_nothing_is_said(kind, body) -> None:
    assert said(kind, body) == ""


def test_an_epuck_as_an_epuck2_has_other_eyes_and_less_senses() -> None:
    text = said(Epuck2Gateway, "epuck")
    assert "its proximity looks to 17, 50, 90, ... deg, not -10, -40, -90, ... deg" in text
    assert "it goes up to 0.1287 m/s, not 0.1382" in text
    assert "it has no scan, imu" in text
    assert "no program receives its camera" in text


def test_an_epuck2_as_a_base_of_ros_2_keeps_its_ground_sensors_to_itself() -> None:
    assert said(Ros2Gateway, "epuck2") == "no program receives its bumper, ground; no program switches its LEDs"


@pytest.mark.parametrize("body", ["turtlebot3-burger", "footbot", "point"])
def test_what_cannot_be_an_epuck2_is_refused(body) -> None:
    with pytest.raises(BadInput, match=f"body {body}: .*as an e-puck2 has"):
        said(Epuck2Gateway, body)
