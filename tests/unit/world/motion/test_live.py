"""Poses as they arrive: which are used, which are counted, and how old they are."""

import socket
from contextlib import closing
from functools import partial
from typing import Any

import pytest

from swarmwire.comms.base.clock import NEVER_NS as FOREVER_NS
from swarmwire.comms.base.clock import NS_PER_S, WallClock
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets
from swarmwire.comms.robot.tick_io import NOTHING_SET, Actions, Readings
from swarmwire.world.backends.pacing import Pace
from swarmwire.world.motion.live import FollowingBackend, LiveSource, wait_for_poses
from swarmwire.world.motion.udp import UdpSource
from swarmwire.world.scenario.motion import UdpMotion
from tests.support.clocks import MS, FakeClock, StillClock, until
from tests.support.world.mediums import ScriptedMedium
from tests.support.world.poses import GivenPoses

NAN = float("nan")


def live_poses(clock: FakeClock, **settings: float) -> GivenPoses:
    motion = UdpMotion(source="udp").model_copy(update=settings)
    return GivenPoses(motion, ["a-0", "a-1"], [4, 5], (10.0, 5.0), clock)


def poses(source: LiveSource) -> dict[int, dict[int, float]]:
    """New poses by row and slot."""
    table = source.pop_new(FOREVER_NS)
    rows: dict[int, dict[int, float]] = {}
    for row, slot, value in zip(table.rows.tolist(), table.slot.tolist(), table.value.tolist(), strict=True):
        rows.setdefault(row, {})[slot] = value
    return rows


def test_pose_is_given_once_to_the_row_of_its_robot() -> None:
    source = live_poses(FakeClock())
    source.put("a-1", 1.0, 2.0, 3.0, 0.5)
    assert poses(source) == {5: {0: 1.0, 1: 2.0, 2: 3.0, 3: 0.5}}
    assert poses(source) == {}
    assert source.missing() == ["a-0"]


def test_pose_without_height_and_heading_keeps_those_before() -> None:
    source = live_poses(FakeClock())
    source.put("a-0", 1.0, 2.0, NAN, NAN)
    assert poses(source) == {4: {0: 1.0, 1: 2.0}}
    source.put("a-0", 1.0, 2.0, 3.0, 0.5)
    source.put("a-0", 1.05, 2.0, NAN, NAN)
    assert poses(source) == {4: {0: 1.05, 1: 2.0, 2: 3.0, 3: 0.5}}


@pytest.mark.parametrize(
    ("pose", "count"),
    [
        (("b-0", 0.0, 0.0, 0.0, 0.0), "poses_of_unknown"),
        (("a-0", NAN, 0.0, 0.0, 0.0), "poses_malformed"),
        (("a-0", 0.0, float("inf"), 0.0, 0.0), "poses_malformed"),
        (("a-0", 0.0, 0.0, float("-inf"), 0.0), "poses_malformed"),
        (("a-0", 10.5, 0.0, 0.0, 0.0), "poses_outside"),
        (("a-0", 0.0, -5.5, 0.0, 0.0), "poses_outside"),
    ],
)
def test_pose_that_cannot_be_used_is_counted_and_changes_nothing(
    pose: tuple[str, float, float, float, float], count: str
) -> None:
    source = live_poses(FakeClock())
    source.put(*pose)
    assert (poses(source), source.counts()) == ({}, {count: 1})


S = NS_PER_S
STAMPED = {"stamps": True, "max_age_s": 100.0}


@pytest.mark.parametrize(
    ("settings", "puts", "counts"),
    [  # puts: ns since the last one, x and z in m, stamp, and the x and z that are used then
        ({"max_age_s": 100.0}, [(0, (0, 0), None, (0, 0)), (S, (6, 0), None, (0, 0)), (2 * S, (6, 0), None, (6, 0))],
         {"poses_jumped": 1}),
        ({"max_age_s": 100.0}, [(0, (0, 1), None, (0, 1)), (S, (0, 9), None, (0, 1))], {"poses_jumped": 1}),
        # Poses that arrive together may have been sent a tenth of a second apart.
        ({"max_speed_mps": 20.0}, [(0, (0, 0), None, (0, 0)), (0, (2, 0), None, (2, 0)), (0, (4.2, 0), None, (2, 0))],
         {"poses_jumped": 1}),
        # Stamps order poses and time jumps, in place of their arrival.
        (STAMPED, [(0, (0, 0), 5 * S, (0, 0)), (0, (3, 0), 7 * S, (3, 0)), (0, (1, 0), 6 * S, (3, 0)),
                   (60 * S, (6, 0), 8 * S, (3, 0)), (0, (3, 0), None, (3, 0))],
         {"poses_late": 1, "poses_jumped": 1, "poses_malformed": 1}),
        # A wrong pose, of the future and far away, is replaced once the robot was silent.
        ({"stamps": True, "max_age_s": 1.0},
         [(0, (9, 0), 900 * S, (9, 0)), (S, (0, 0), S, (9, 0)), (1, (0.5, 0), S + 1, (0.5, 0))], {"poses_late": 1}),
    ],
    ids=["jump", "jump in height", "together", "stamps", "wrong"],
)  # fmt: skip
def test_pose_that_jumps_or_is_late_is_not_used(settings, puts, counts: dict[str, int]) -> None:
    clock, used = FakeClock(), {0: 0.0, 2: 0.0}
    source = live_poses(clock, **{"max_speed_mps": 2.0, **settings})
    for passed_ns, (x_m, z_m), stamp_ns, expected in puts:
        clock.time_ns += passed_ns
        source.put("a-0", x_m, 0.0, z_m, 0.0, *([] if stamp_ns is None else [stamp_ns]))
        used |= poses(source).get(4, {})
        assert (used[0], used[2]) == expected
    assert source.counts() == counts


def test_pose_that_arrived_by_the_time_is_given_though_a_newer_one_waits() -> None:
    clock = FakeClock()
    source = live_poses(clock)
    arrivals_ns = [clock.time_ns + k * 1_000_000 for k in range(4)]
    for k, at_ns in enumerate(arrivals_ns):
        clock.time_ns = at_ns
        source.put("a-0", 0.01 * k, 0.0, 0.0, 0.0)
    assert [source.pop_new(at_ns).value[0] for at_ns in arrivals_ns[1:3]] == [0.01, 0.02]
    assert poses(source)[4][0] == 0.03


@pytest.mark.parametrize("datagram", [b'{"robot": "a-0", "x_m": 0, "y_m": 0, "t_s": 1e300}', b'{"robot":', b"\xff"])
@pytest.mark.parametrize("stamps", [True, False])
def test_datagram_that_is_odd_does_not_end_the_source(datagram: bytes, stamps: bool) -> None:
    source = UdpSource(
        UdpMotion(source="udp", listen="127.0.0.1:0", stamps=stamps), ["a-0"], [0], (10.0, 5.0), FakeClock()
    )
    source.open()
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            host, _, port = source.address.removeprefix("udp ").rpartition(":")
            sender.sendto(datagram, (host, int(port)))
            sender.sendto(b'{"robot": "a-0", "x_m": 1, "y_m": 2, "t_s": 3}', (host, int(port)))
            until(lambda: not source.missing())
    finally:
        source.close()


def test_stamp_of_a_datagram_is_its_t_s() -> None:
    motion = UdpMotion(source="udp", listen="127.0.0.1:0", stamps=True)
    source = UdpSource(motion, ["a-0"], [0], (10.0, 5.0), WallClock())
    source.open()
    with closing(source), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for stamp in ('"t_s": 2', '"t_s": 1.5', '"t_s": 2.5', '"heading_rad": 0'):
            message = f'{{"robot": "a-0", "x_m": 1, "y_m": 0, {stamp}}}'
            sender.sendto(message.encode(), ("127.0.0.1", int(source.address.rpartition(":")[2])))
        until(lambda: source.counts().get("poses_malformed"))
    assert source.counts() == {"poses_late": 1, "poses_malformed": 1}
    assert source.report().received == 2


def test_age_beyond_the_limit_counts_ticks_and_shows_in_the_report() -> None:
    clock = FakeClock()
    source = live_poses(clock, max_age_s=1.0)
    source.put("a-0", 0.0, 0.0, 0.0, 0.0)
    source.put("a-1", 0.0, 0.0, 0.0, 0.0)
    for _ in range(4):
        clock.time_ns += NS_PER_S // 2
        source.put("a-1", 0.0, 0.0, 0.0, 0.0)
        source.count_ages()
    assert source.status() == {"source": "given", "oldest": "a-0", "oldest_s": 2.0, "silent": ["a-0"]}
    report = source.report()
    assert report.longest_gap_s == {"a-0": 2.0, "a-1": 0.0}
    assert (report.silent_ticks, report.received) == ({"a-0": 2}, 6)
    assert source.counts() == {"ticks_without_pose": 2}


class StandingAgents:
    """A backend without any actions."""

    def start(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""

    def counts(self) -> dict[str, int]:
        return {"late": 3}

    def act(self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: object) -> Actions:
        return Actions.joined([])


def test_first_poses_are_waited_for_and_those_of_tick_0() -> None:
    clock = FakeClock()
    source, lines = live_poses(clock), list[str]()
    source.put("a-0", 1.0, 0.0, 0.0, 0.0)

    class PuttingClock(FakeClock):
        def sleep_until(self, at_ns: int) -> None:
            super().sleep_until(at_ns)
            source.put("a-1", 2.0, 0.0, 0.0, 0.0)

    wait = partial(wait_for_poses, [source], PuttingClock(), lines.append, lambda: False)
    backend = FollowingBackend(StandingAgents(), [source], Pace(clock, 10, 1.0, lines.append), 0, wait)
    backend.start()
    assert len(lines) == 1
    assert "a-1" in lines[0]
    source.put("a-0", 1.05, 0.0, 0.0, 0.0)
    first, second = (backend.act(tick, {}, ReceivedPackets.none(), NO_TX_STATUSES).poses for tick in (0, 1))
    assert first.value.tolist() == [1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0]
    assert (second.rows.tolist(), second.value.tolist()) == ([4] * 4, [1.05, 0.0, 0.0, 0.0])
    assert backend.counts() == {"late": 3}


def test_newest_poses_are_used_at_the_end_of_a_tick_by_a_loop_that_lags() -> None:
    clock = FakeClock()
    source, pace = live_poses(clock), Pace(clock, 10, 1.0, lambda _: None)

    class Lagging(StandingAgents):
        def act_in_time(self, tick: int, *inputs: Any) -> Actions:
            pace.begin()
            for _ in range(5):  # poses come more often than the loop looks, which is 10 s behind
                clock.time_ns += 2 * NS_PER_S
                source.put("a-0", 1.0, 0.0, 0.0, 0.0)
                inputs[-1].advance(50 * MS)
            return Actions.joined([])

    backend = FollowingBackend(Lagging(), [source], pace, MS, lambda: NOTHING_SET)
    medium = ScriptedMedium()
    actions = backend.act_in_time(0, {}, ReceivedPackets.none(), NO_TX_STATUSES, medium)
    assert actions.poses.rows.tolist() == [4] * 4


def test_source_without_any_pose_in_time_is_refused() -> None:
    clock = FakeClock()
    with pytest.raises(BadInput, match="a-1"):
        wait_for_poses([live_poses(clock, wait_s=2.0)], clock, lambda _: None, lambda: False)
    assert clock.time_ns == pytest.approx(2.0 * NS_PER_S, rel=0.05)


def test_robot_without_a_pose_in_time_is_named_and_counts_as_silent() -> None:
    clock, lines = FakeClock(), list[str]()
    source = live_poses(clock, wait_s=2.0, max_age_s=3.0)
    source.put("a-0", 1.0, 0.0, 0.0, 0.0)
    wait_for_poses([source], clock, lines.append, lambda: False)
    assert "a-1" in lines[-1]
    clock.time_ns += 2 * NS_PER_S
    source.put("a-0", 1.0, 0.0, 0.0, 0.0)
    source.count_ages()
    assert source.report().silent_ticks == {"a-1": 1}


def test_first_poses_are_not_waited_for_as_the_run_ends() -> None:
    clock, lines = StillClock(), list[str]()  # a clock that refuses to sleep
    wait_for_poses([live_poses(clock)], clock, lines.append, lambda: True)
    assert lines == []


@pytest.mark.parametrize(("host", "is_exposed"), [("127.0.0.1", False), ("0.0.0.0", True)])
def test_source_beyond_loopback_is_exposed(host: str, is_exposed: bool) -> None:
    source = UdpSource(UdpMotion(source="udp", listen=f"{host}:0"), ["a-0"], [0], (10.0, 5.0), WallClock())
    source.open()
    with closing(source):
        assert source.is_exposed == is_exposed
