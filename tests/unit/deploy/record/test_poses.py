"""Poses of live sources within ticks: recorded, and repeated without the source."""

from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.observe.interfaces import Observer, SubtickMedium, SubtickPackets
from swarmwire.comms.observe.truth import Truth
from swarmwire.comms.robot.packets import Fate, Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings, SparseTable
from swarmwire.deploy.runs.record.inputs import RecordedBackend, ReplayedBackend, recorded_inputs
from swarmwire.deploy.runs.scenario_parts import new_medium
from swarmwire.world.backends.pacing import Pace
from swarmwire.world.loop import Loop
from swarmwire.world.motion.live import FollowingBackend, wait_for_poses
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.world import World
from tests.support.clocks import MS, FakeClock
from tests.support.world.poses import GivenPoses

RATE_HZ, NEAR_M, FAR_M = 10, 3.0, 8.0
SCENARIO: dict[str, Any] = {
    "format": 1,
    "name": "pair",
    "duration_s": 1.0,
    "arena": {"size_m": [40.0, 10.0]},
    "robots": {
        "pair": {
            "body": "epuck2",
            "count": 2,
            "agent": "swarmwire.agent.behaviours:Consensus",
            "motion": {"source": "udp", "max_speed_mps": 1e4},
        }
    },
    "radio": {"range_m": 5.0},
}
PACKET = SentPackets(np.array([0]), np.array([BROADCAST]), Payloads.from_rows([b"\0\0"]))


class Approaching:
    """A backend whose robot 0 sends three packets a tick; robot 1 is near for the second alone."""

    def __init__(self, source: GivenPoses, clock: FakeClock, pace: Pace) -> None:
        self._source, self._clock, self._pace = source, clock, pace

    def start(self) -> None:
        """Ready."""

    def act(self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses) -> Actions:
        raise AssertionError("act_in_time is called instead")

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        """Poses arrive at 9, 19 and 29 ms, and packets at 10, 20 and 30."""
        self._pace.begin()
        start_ns = tick_start_ns(tick, RATE_HZ)
        for at_ms, x_m in ((9, FAR_M), (19, NEAR_M), (29, FAR_M)):
            self._clock.time_ns = self._pace.wall_ns(start_ns + at_ms * MS)
            self._source.put("pair-1", x_m, 0.0, 0.0, 0.0)
            medium.send(SubtickPackets(start_ns + (at_ms + 1) * MS, None, PACKET))
        medium.advance(start_ns + 40 * MS)
        return Actions.joined([])

    def counts(self) -> dict[str, int]:
        return {}

    def close(self) -> None:
        """Nothing."""


class Fates(Observer):
    """The fates of all packets, and the positions of robot 1."""

    def __init__(self) -> None:
        self.fates, self.x_m = np.zeros(len(Fate), np.int64), list[float]()

    def see(self, truth: Truth) -> None:
        assert truth.tally
        self.fates += truth.tally.fates[0]
        self.x_m.append(float(truth.pose[1, 0]))


def test_poses_within_a_tick_decide_fates_also_in_a_repetition(tmp_path: Path) -> None:
    scenario, clock = scenario_from(SCENARIO, "pair"), FakeClock()
    pace = Pace(clock, RATE_HZ, 1.0, lambda _: None)
    source = GivenPoses(scenario.live_motions()["pair"], ["pair-0", "pair-1"], [0, 1], (20.0, 5.0), clock)
    source.put("pair-0", 0.0, 0.0, 0.0, 0.0)
    source.put("pair-1", FAR_M, 0.0, 0.0, 0.0)

    def follow(world: World) -> RecordedBackend:
        def first_poses() -> SparseTable:
            world.set_first_poses(poses := wait_for_poses([source], clock, print, lambda: False))
            return poses

        live = FollowingBackend(Approaching(source, clock, pace), [source], pace, MS, first_poses)
        return RecordedBackend(live, tmp_path, lambda _: True)

    def replay(world: World) -> ReplayedBackend:
        inputs = recorded_inputs(tmp_path)
        assert inputs is not None
        return ReplayedBackend(Approaching(source, clock, pace), inputs, 2, RATE_HZ, world.set_first_poses)

    loops, results = list[Loop](), list[Fates]()
    for make in (follow, replay):
        world, fates = World(scenario, [1], {}), Fates()
        backend = make(world)
        loop = Loop(world, new_medium(scenario, world, None), backend, [fates], timed=backend)
        backend.start()
        loop.run(4)
        loops.append(loop)
        results.append(fates)
    assert results[0].x_m == [FAR_M] * 4  # before each tick
    of_three_ticks = results[0].fates[[Fate.RECEIVED, Fate.OUT_OF_RANGE]].tolist()  # the fourth ends later
    assert of_three_ticks == [3, 6]
    assert results[1].fates.tolist() == results[0].fates.tolist()
    assert loops[1].hexdigests() == loops[0].hexdigests()
