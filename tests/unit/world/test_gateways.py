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
from tests.support.agent.hosts import SILENCE, received_from
from tests.support.clocks import FakeClock
from tests.support.refusals import refused_input
from tests.support.world.gateways import ScriptedGateway, ScriptedOptions
from tests.support.world.mediums import ScriptedMedium

TICK_NS = NS_PER_S // 10
SCRIPTED = "tests.support.world.gateways:ScriptedGateway"


class Inner:
    """A backend that drives its robots 0 and 1 at 0.5 m/s, and collects its calls."""

    def __init__(self) -> None:
        self.calls: list[Any] = []

    def start(self) -> None:
        self.calls.append("started")

    def act(self, tick, sensors, received, tx_status=NO_TX_STATUSES) -> Actions:
        self.calls.append((tick, sensors, received, tx_status))
        rows = np.array([0, 1])
        sent = SentPackets(rows[:1], np.array([BROADCAST]), Payloads.from_rows([b"inner"]))
        return Actions(rows, np.ones(2, np.bool_), np.full(2, 0.5), np.zeros(2), np.zeros(2), sent)

    def receive(self, received, tx_status) -> None:
        self.calls.append(("received", received, tx_status))

    def on_receive(self, tick, at_ns) -> SentPackets:
        return SentPackets(np.array([1]), np.array([BROADCAST]), Payloads.from_rows([b"echo"]))

    def counts(self) -> dict[str, int]:
        return {"inner": 1}

    def close(self) -> None:
        self.calls.append("closed")


class RadioMedium:
    """A medium whose robots send one packet in each tick."""

    def __init__(self) -> None:
        self.published: list[Any] = []

    def publish(self, tick, received, tx_status) -> None:
        self.published.append((tick, received, tx_status))

    def pop_packets(self) -> SentPackets:
        return SentPackets(np.array([3]), np.array([0]), Payloads.from_rows([b"outer"]))

    def pop_notes(self) -> tuple[SparseTable, SparseTable]:
        row, slot = np.array([3]), np.zeros(1, np.int64)
        return SparseTable(row, slot, np.zeros(1), ("search",)), SparseTable(row, slot, np.array([1.25]))

    def counts(self) -> dict[str, int]:
        return {"late": 2, "odd": 0, "packets_to_robots": 9}


class Rig:
    """A backend of two local robots, and three behind a gateway, rows 2 to 4."""

    def __init__(self, *, medium: bool = True, subtick_s: float | None = None) -> None:
        self.clock, self.inner, self.reports = FakeClock(), Inner(), []
        self.medium = RadioMedium() if medium else None
        body = load_body("epuck2")
        self.gateway = ScriptedGateway(("b-0", "b-1", "b-2"), body, "", ScriptedOptions(), self.clock)
        group = GatewayGroup(Group("b", body, 2, 5), "scripted", self.gateway)
        pace = Pace(self.clock, 10, 1.0, self.reports.append)
        self.shown = 0
        subticks = Subticks(self.clock, pace, 10, subtick_s) if subtick_s else None
        unseen = {"unseen": 4}
        self.backend = GatewayBackend(self.inner, [group], self.medium, pace, self.show, lambda: unseen, subticks)

    def show(self) -> None:
        self.shown += 1

    def act(
        self,
        tick: int,
        alive: list[int],
        received: ReceivedPackets = SILENCE,
        tx_status: TxStatuses = NO_TX_STATUSES,
        ages: dict[str, int | None] | None = None,
    ) -> Actions:
        rows = np.array(alive, np.int64)
        fields = {"proximity.value": np.tile(rows + 0.1 * tick, (8, 1)).T, "odometry.left_m": rows + 0.01 * tick}
        sensors = {"a": GroupReadings(np.array([0, 1]), {}), "b": GroupReadings(rows, fields, ages or {})}
        return self.backend.act(tick, sensors, received, tx_status)


def commands(actions: Actions) -> dict[int, tuple[float, float]]:
    columns = (actions.rows, actions.linear_mps, actions.angular_radps)
    return {row: (v, w) for row, v, w in zip(*(c[actions.drive].tolist() for c in columns), strict=True)}


def test_gateway_publishes_readings_and_returns_commands_each_tick() -> None:
    rig = Rig()
    rig.gateway.drive = {1: (0.05, -0.7)}
    rig.gateway.leds = SparseTable(np.array([2]), np.array([4]), np.array([float(0xFF0000)]))
    actions = rig.act(0, [2, 3, 4])
    (published,) = rig.gateway.published
    assert published.time_ns == 0
    assert published.alive.tolist() == [True] * 3
    assert published.fields["proximity.value"].shape == (3, 8)
    assert published.fields["odometry.left_m"].tolist() == [2.0, 3.0, 4.0]
    assert commands(actions) == {0: (0.5, 0.0), 1: (0.5, 0.0), 3: (0.05, -0.7)}
    assert sorted(actions.rows.tolist()) == [0, 1, 2, 3, 4]
    assert (actions.leds.rows.tolist(), actions.leds.slot.tolist()) == ([4], [4])
    assert commands(rig.act(1, [2, 3, 4])) == {0: (0.5, 0.0), 1: (0.5, 0.0)}  # the last command holds
    assert [published.time_ns for published in rig.gateway.published] == [0, TICK_NS]
    assert rig.shown == 2


def test_readings_have_their_ages_and_are_absent_before_the_first() -> None:
    rig = Rig()
    rig.act(3, [2, 3, 4], ages={"proximity": None, "odometry": 2})
    rig.act(4, [2, 3, 4], ages={"proximity": 4})
    first, second = rig.gateway.published
    assert list(first.fields) == ["odometry.left_m"]
    assert (first.ages_ns, second.ages_ns) == ({"odometry": 2 * TICK_NS}, {"proximity": 4 * TICK_NS})


def test_dead_robots_are_published_as_dead_with_their_last_readings() -> None:
    rig = Rig()
    for tick, alive in enumerate(([2, 4], [3, 4], [])):
        rig.act(tick, alive)
    assert [published.alive.tolist() for published in rig.gateway.published] == [
        [True, False, True],
        [False, True, True],
        [False] * 3,
    ]
    readings = [published.fields["odometry.left_m"].tolist() for published in rig.gateway.published]
    assert readings[0] == [2.0, 0.0, 4.0]  # not written to later
    assert readings[1] == readings[2] == pytest.approx([2.0, 3.01, 4.01])


def test_agents_get_their_groups_and_the_medium_gets_the_other_packets() -> None:
    rig = Rig()
    sent = SentPackets(np.array([0]), np.array([BROADCAST]), Payloads.from_rows([b"beacon"]))
    tx_status = TxStatuses(np.array([0, 3]), np.array([7, 8]), np.array([0, 1]))
    actions = rig.act(0, [2, 3, 4], received_from(sent, [1, 2, 4]), tx_status)
    _, sensors, received, _ = rig.inner.calls[-1]
    assert list(sensors) == ["a"]
    assert len(received) == 3  # an agent host selects its packets
    assert rig.medium is not None
    ((tick, outside, statuses),) = rig.medium.published
    assert tick == 0
    assert outside.receiver.tolist() == [2, 4]
    assert statuses.row.tolist() == [3]
    assert [actions.sent.payloads.row(i) for i in range(2)] == [b"inner", b"outer"]
    assert actions.sent.sender.tolist() == [0, 3]


def test_notes_of_remote_agents_are_among_the_actions() -> None:
    actions = Rig().act(0, [2, 3, 4])
    assert (actions.notes.rows.tolist(), actions.notes.names, actions.notes.integers.tolist()) == (
        [3],
        ("search",),
        [0],
    )
    assert (actions.values.rows.tolist(), actions.values.value.tolist()) == ([3], [1.25])


def test_gateway_without_a_radio_returns_only_commands() -> None:
    rig = Rig(medium=False)
    actions = rig.act(0, [2, 3, 4])
    assert [actions.sent.payloads.row(0)] == [b"inner"]
    assert len(actions.notes) == len(actions.values) == 0


def test_group_that_does_not_act_is_commanded_without_readings() -> None:
    rig = Rig()
    rig.gateway.drive = {0: (0.1, 0.0)}
    actions = rig.backend.act(3, {"a": GroupReadings(np.array([0, 1]), {})}, SILENCE)
    assert not rig.gateway.published
    assert commands(actions)[2] == (0.1, 0.0)


def test_gateway_tick_lasts_its_period_and_lag_is_reported() -> None:
    rig = Rig()
    began_ns = rig.clock.now_ns()
    rig.act(0, [2, 3, 4])
    assert rig.clock.now_ns() - began_ns == TICK_NS
    rig.clock.time_ns += 3 * TICK_NS
    rig.act(1, [2, 3, 4])
    report = rig.backend.report()
    assert (report.factor, report.missed_ticks, report.worst_lag_s) == (1.0, 1, pytest.approx(0.2))
    assert len(rig.reports) == 1


def test_gateway_faults_are_counted_by_kind() -> None:
    rig = Rig()
    rig.gateway.faults = {"garbage": 3, "half_packets": 0}
    assert rig.backend.counts() == {"inner": 1, "unseen": 4, "scripted_garbage": 3, "air_late": 2}


def test_gateway_backend_starts_and_closes_the_inner_backend() -> None:
    rig = Rig()
    rig.backend.start()
    rig.backend.close()
    assert rig.inner.calls == ["started", "closed"]


def test_gateway_robots_receive_and_send_within_subticks() -> None:
    rig, medium = Rig(subtick_s=0.010), ScriptedMedium([TICK_NS // 2], b"beacon", 1, (0, 3))
    rows = np.array([2, 3, 4])
    fields = {"proximity.value": np.zeros((3, 8)), "odometry.left_m": np.zeros(3)}
    sensors = {"a": GroupReadings(np.array([0, 1]), {}), "b": GroupReadings(rows, fields)}
    rig.gateway.drive = {1: (0.05, -0.7)}
    actions = rig.backend.act_in_time(0, sensors, SILENCE, NO_TX_STATUSES, medium)
    assert rig.medium is not None
    received = [packets.receiver.tolist() for _, packets, _ in rig.medium.published if len(packets)]
    assert received == [[3]]
    assert [call[1].receiver.tolist() for call in rig.inner.calls if call[0] == "received"] == [[], [0, 3]]
    sent = [(packets.tick, packets.sent.payloads.row(0)) for packets in medium.sent]
    assert sent[:2] == [(0, b"inner"), (None, b"outer")]
    assert set(sent[2:]) == {(None, b"outer"), (None, b"echo")}
    assert not len(actions.sent)
    assert commands(actions)[3] == (0.05, -0.7)
    assert rig.backend.report().subtick_s == 0.010


def installed(monkeypatch: pytest.MonkeyPatch, *points: tuple[str, str]) -> None:
    entries = [EntryPoint(name, value, gateway.GROUP) for name, value in points]
    monkeypatch.setattr(installed_classes, "entry_points_of", lambda group: entries if group == gateway.GROUP else [])


def test_gateway_names_include_the_shipped_ones() -> None:
    assert set(gateway.gateway_names()) >= {"epuck2", "ros2"}


def test_gateway_is_found_by_its_name(monkeypatch) -> None:
    installed(monkeypatch, ("scripted", SCRIPTED))
    assert gateway.gateway_kind("scripted", "--gateway") is ScriptedGateway


@pytest.mark.parametrize(
    ("points", "name", "match"),
    [
        ([("scripted", SCRIPTED)], "epuck3", "scripted"),
        ([("scripted", SCRIPTED), ("scripted", "other.package:Gateway")], "scripted", "other.package:Gateway"),
        ([("far", "a_package_that_is_not_here:Gateway")], "far", "No module named 'a_package_that_is_not_here'"),
        ([("odd", "swarmwire.world.gateways.gateway:Nothing")], "odd", ""),
        ([("odd", "swarmwire.world.gateways.gateway:GROUP")], "odd", ""),
    ],
    ids=["unknown", "two packages", "missing package", "missing class", "no class"],
)
def test_gateway_that_cannot_be_loaded_is_refused(monkeypatch, points, name, match) -> None:
    installed(monkeypatch, *points)
    with refused_input("--gateway", name, match):
        gateway.gateway_kind(name, "--gateway", name)


def differences_of(kind: type[Gateway], body: str) -> str:
    return "; ".join(kind(("a-0",), load_body(body), "", kind.options(), WallClock()).differences())


@pytest.mark.parametrize(
    ("kind", "body"), [(CrazyflieGateway, "crazyflie"), (Epuck2Gateway, "epuck2"), (Ros2Gateway, "turtlebot3-burger")]
)
def test_gateway_reports_no_differences_for_its_robot(kind, body) -> None:
    assert differences_of(kind, body) == ""


def test_gateway_reports_differences_of_an_epuck_as_an_epuck2() -> None:
    text = differences_of(Epuck2Gateway, "epuck")
    for difference in ("17, 50, 90, ... deg, not -10, -40, -90", "0.1287 m/s, not 0.1382", "scan, imu", "camera"):
        assert difference in text


def test_gateway_reports_differences_of_an_epuck2_as_a_ros2_base() -> None:
    assert (
        differences_of(Ros2Gateway, "epuck2") == "no program receives its bumper, ground; no program switches its LEDs"
    )


@pytest.mark.parametrize("body", ["turtlebot3-burger", "footbot", "point"])
def test_body_unlike_an_epuck2_is_refused(body) -> None:
    with pytest.raises(BadInput, match=f"body {body}: .*as an e-puck2 has"):
        differences_of(Epuck2Gateway, body)
