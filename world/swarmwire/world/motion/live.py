"""Live sources: the newest pose of each robot as it arrives, and a backend that adds new poses to a tick's actions.

Robots are at their first poses before tick 0, whose actions have these; later actions have the poses that arrived.
With sub-ticks the radio medium gets them at the start of each sub-tick, the world at the end of the tick.
"""

import math
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, cast

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.clock import Clock, tick_start_ns, to_ns, to_s
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.interfaces import AgentBackend, SubtickMedium, SubtickPackets, TimedBackend
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets, TxStatuses
from swarmwire.comms.robot.tick_io import NOTHING_SET, Actions, Readings, SparseTable
from swarmwire.world.backends.pacing import LatencyHistogram, LatencySummary, Pace
from swarmwire.world.scenario.motion import LiveMotion

POLL_NS = to_ns(0.02)  # interval of polls for the first poses
POSITION_NOISE_M = 0.1  # a difference up to this is no jump
MAX_WAITING = 64  # poses of a robot that the loop has not had, as in a pause
MAX_M = 1e9  # a position beyond it is no position
BURST_S = 0.1  # two poses that were sent up to this time apart may arrive together


@dataclass(frozen=True)
class PosesReport:
    """The poses of one group's live source over a run."""

    source: str  #: its address
    received: int  #: usable poses
    use: LatencySummary | None  #: wall time from the arrival of a pose to its use, by the radio or at a tick's end
    longest_gap_s: dict[str, float]  #: by robot: the greatest age of its newest pose at a tick, wall time
    silent_ticks: dict[str, int]  #: by robot, if any: ticks at which its newest pose was older than `max_age_s`


class _ArrivedPose(NamedTuple):
    at_ns: int  # arrival, wall time
    pose: tuple[float, float, float, float]


class LiveSource(ABC):
    """The poses of one group's robots as they arrive; `put` may be called from any thread.

    A pose is ignored, and counted, if it is malformed, of an unknown robot, outside the arena, late (with `stamps`), or
    a jump: farther from the last one than `max_speed_mps` allows in the time between. After `max_age_s` without a
    usable pose the next one is used wherever it is: the last one, or its stamp, may have been wrong.

    Attributes:
        address: where poses arrive; known from `open` on.
        is_exposed: True if programs on other machines, too, can send poses, without a certificate.
        rows: the robot rows.
    """

    address: str
    is_exposed = False

    def __init__(
        self, motion: LiveMotion, names: Sequence[str], rows: Sequence[int], half_m: tuple[float, float], clock: Clock
    ) -> None:
        """Make a source that has received nothing.

        Args:
            motion: its table.
            names: names of the robots.
            rows: their robot rows.
            half_m: poses lie within this distance of the arena's origin along x and y; inf: an arena without walls.
            clock: dates arrivals.
        """
        self.motion, self.names = motion, tuple(names)
        self.rows = tuple(rows)
        self._rows = np.array(rows, np.int64)
        self._index_of = {name: index for index, name in enumerate(names)}
        self._half_m, self._clock = half_m, clock
        self._pose: FloatArray = np.full((len(names), 4), np.nan)  # x, y, z in m, heading in rad
        self._arrived_ns = [clock.now_ns()] * len(names)  # without a pose: the age counts from now
        self._timed_ns = [0] * len(names)  # stamps of the last poses, or their arrivals
        self._has_pose = [False] * len(names)
        self._new = [deque[_ArrivedPose](maxlen=MAX_WAITING) for _ in names]  # poses that the loop has not had
        self._counted = Counter[str]()
        self._use = LatencyHistogram()
        self._received, self._longest_ns, self._silent = 0, [0] * len(names), [0] * len(names)

    @abstractmethod
    def open(self) -> None:
        """Begin to receive; BadInput if the address is in use or cannot be used."""

    @abstractmethod
    def close(self) -> None:
        """Stop receiving; safe to call more than once."""

    def put(
        self, name: str, x_m: float, y_m: float, z_m: float, heading_rad: float, stamp_ns: int | None = None
    ) -> None:
        """Take a pose that arrived now; z and heading are NaN if the source does not give them: they stay.

        `stamp_ns` is the time in its message, of any clock; None: it has none.
        """
        index, now_ns = self._index_of.get(name), self._clock.now_ns()
        timed_ns, is_finite = stamp_ns if self.motion.stamps else now_ns, math.isfinite(x_m) and math.isfinite(y_m)
        if index is None:
            self._counted["poses_of_unknown"] += 1
        elif timed_ns is None or not is_finite or math.isinf(heading_rad) or max(abs(x_m), abs(y_m), abs(z_m)) > MAX_M:
            self._counted["poses_malformed"] += 1
        elif abs(x_m) > self._half_m[0] or abs(y_m) > self._half_m[1]:
            self._counted["poses_outside"] += 1
        else:
            self._keep(index, (x_m, y_m, z_m, heading_rad), now_ns, timed_ns)

    def _keep(self, index: int, pose: tuple[float, float, float, float], now_ns: int, timed_ns: int) -> None:
        """Use a pose, unless it is late or a jump by `timed_ns`: its stamp, or its arrival `now_ns`."""
        x_m, y_m, z_m, heading_rad = pose
        last_x_m, last_y_m, last_z_m, last_heading_rad = self._pose[index].tolist()
        z_m = last_z_m if math.isnan(z_m) else z_m
        is_silent = now_ns - self._arrived_ns[index] > to_ns(self.motion.max_age_s)
        if self._has_pose[index] and not is_silent:
            climb_m = 0.0 if math.isnan(last_z_m) else z_m - last_z_m
            away_m = math.hypot(x_m - last_x_m, y_m - last_y_m, climb_m)
            if timed_ns < self._timed_ns[index]:
                self._counted["poses_late"] += 1
                return
            time_s = to_s(timed_ns - self._timed_ns[index]) + (0.0 if self.motion.stamps else BURST_S)
            if away_m > self.motion.max_speed_mps * time_s + POSITION_NOISE_M:
                self._counted["poses_jumped"] += 1
                return
        heading_rad = last_heading_rad if math.isnan(heading_rad) else heading_rad
        self._pose[index] = x_m, y_m, z_m, heading_rad
        self._arrived_ns[index], self._timed_ns[index], self._has_pose[index] = now_ns, timed_ns, True
        self._new[index].append(_ArrivedPose(now_ns, (x_m, y_m, z_m, heading_rad)))
        self._received += 1

    def count(self, fault: str) -> None:
        """Count a message that holds no pose."""
        self._counted[fault] += 1

    def missing(self) -> list[str]:
        """Return the robots without a pose so far."""
        return [name for name, has_pose in zip(self.names, self._has_pose, strict=True) if not has_pose]

    def pop_first(self) -> SparseTable:
        """Return the poses before tick 0, as `pop_new`; their wait for the other robots' is no delay."""
        poses, self._use = self.pop_new(self._clock.now_ns()), LatencyHistogram()
        return poses

    def count_ages(self) -> None:
        """Count the ages of the newest poses at a tick."""
        now_ns, max_age_ns = self._clock.now_ns(), to_ns(self.motion.max_age_s)
        for index, arrived_ns in enumerate(self._arrived_ns):
            age_ns = now_ns - arrived_ns
            self._longest_ns[index] = max(self._longest_ns[index], age_ns)
            self._silent[index] += age_ns > max_age_ns

    def pop_new(self, by_ns: int) -> SparseTable:
        """Return the newest pose of each robot that arrived since the last call and by this wall time.

        The slots are x, y, z and heading.
        """
        newest: dict[int, _ArrivedPose] = {}
        for index, arrived in enumerate(self._new):
            while arrived and arrived[0].at_ns <= by_ns:
                newest[index] = arrived.popleft()
        if not newest:
            return NOTHING_SET
        self._use.add(np.array([by_ns - pose.at_ns for pose in newest.values()]))
        return SparseTable.from_dense(self._rows[list(newest)], np.array([pose.pose for pose in newest.values()]))

    def status(self) -> dict[str, Any]:
        """Return the source, the age of the oldest robot's newest pose, and the robots that are silent now."""
        now_ns = self._clock.now_ns()
        ages_s = {name: to_s(now_ns - ns) for name, ns in zip(self.names, self._arrived_ns, strict=True)}
        oldest = max(ages_s, key=ages_s.__getitem__)
        silent = [name for name, age_s in ages_s.items() if age_s > self.motion.max_age_s]
        return {"source": self.address, "oldest": oldest, "oldest_s": ages_s[oldest], "silent": silent}

    def counts(self) -> dict[str, int]:
        """Return the numbers of unusable poses, and of ticks of silent robots, by name; only those above 0."""
        silent = {"ticks_without_pose": sum(self._silent)}
        return {name: count for name, count in {**self._counted, **silent}.items() if count}

    def report(self) -> PosesReport:
        """Return the report so far."""
        gaps_s = dict(zip(self.names, map(to_s, self._longest_ns), strict=True))
        silent = {name: ticks for name, ticks in zip(self.names, self._silent, strict=True) if ticks}
        return PosesReport(self.address, self._received, self._use.summary(), gaps_s, silent)


def wait_for_poses(
    sources: Sequence[LiveSource], clock: Clock, report: Callable[[str], None], is_stopped: Callable[[], bool]
) -> SparseTable:
    """Return the first poses when every robot has one, `wait_s` of the sources has passed, or the run must end.

    BadInput for a source without any pose in time. `report` prints what the run waits for, and robots without a pose.
    """
    began_ns, reported = clock.now_ns(), ""
    while not is_stopped():
        now_ns = clock.now_ns()
        missing = [source for source in sources if source.missing()]
        waiting = [source for source in missing if now_ns - began_ns <= to_ns(source.motion.wait_s)]
        for source in missing:
            if source not in waiting and len(source.missing()) == len(source.names):
                raise _no_pose(source)
        if not waiting:
            for source in missing:
                report(f"{source.address}: {_missing(source)}: they stay at their places")
            break
        text = ", ".join(f"{source.address} ({_missing(source)})" for source in waiting)
        if text != reported:
            report(f"waits for the first poses from {text}")
            reported = text
        clock.sleep_until(now_ns + POLL_NS)
    return SparseTable.joined([source.pop_first() for source in sources])


class FollowingBackend:
    """A backend in real time that adds the new poses of live sources to the actions of each tick."""

    def __init__(
        self,
        backend: AgentBackend | TimedBackend,
        sources: Sequence[LiveSource],
        pace: Pace,
        subtick_ns: int,
        first_poses: Callable[[], SparseTable],
    ) -> None:
        """`first_poses` waits for the first poses, places the robots there, and returns the poses.

        `subtick_ns` is the length of a sub-tick in simulated time.
        """
        self._backend, self._sources, self._pace, self._subtick_ns = backend, sources, pace, subtick_ns
        self._first_poses, self._first = first_poses, NOTHING_SET
        self.close = backend.close

    def start(self) -> None:
        """Start the agents, and place the robots at their first poses; BadInput if a source has none in time."""
        self._backend.start()
        self._first = self._first_poses()

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """Return the actions of all robots in this tick, with new poses."""
        actions = self._backend.act(tick, readings, received, tx_status)
        return self._with_poses(actions, self._pop_new(self._pace.now_ns()) if tick else self._first)

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        """Act as the wrapped backend, and add new poses."""
        timed = cast("TimedBackend", self._backend)
        start_ns, end_ns = (tick_start_ns(number, self._pace.rate_hz) for number in (tick, tick + 1))
        followed = _FollowedMedium(medium, start_ns, self._subtick_ns, self._pop_by)
        actions = timed.act_in_time(tick, readings, received, tx_status, followed)
        followed.set_new(end_ns, self._pop_new(self._pace.now_ns()))  # all: a loop that lags uses them, too
        return self._with_poses(actions, SparseTable.joined([NOTHING_SET if tick else self._first, *followed.poses]))

    def counts(self) -> dict[str, int]:
        """Return the numbers of faults of the backend and of the sources, by name."""
        counted = Counter[str]()
        for source in self._sources:
            counted.update(source.counts())
        return {**self._backend.counts(), **counted}

    def _pop_new(self, by_ns: int) -> SparseTable:
        return SparseTable.joined([source.pop_new(by_ns) for source in self._sources])

    def _pop_by(self, at_ns: int) -> SparseTable:
        return self._pop_new(self._pace.wall_ns(at_ns))

    def _with_poses(self, actions: Actions, poses: SparseTable) -> Actions:
        for source in self._sources:
            source.count_ages()
        return replace(actions, poses=poses)


class _FollowedMedium:
    """A medium that gets new poses at the start of each sub-tick, also if the loop comes to it later.

    Attributes:
        poses: those that it got, in order.
    """

    def __init__(
        self, medium: SubtickMedium, start_ns: int, subtick_ns: int, pop_by: Callable[[int], SparseTable]
    ) -> None:
        """`pop_by` returns the poses that arrived by a simulated time."""
        self._medium, self._next_ns, self._subtick_ns, self._pop_by = medium, start_ns, subtick_ns, pop_by
        self.poses: list[SparseTable] = []
        self.set_poses = medium.set_poses

    def send(self, packets: SubtickPackets) -> None:
        """Send packets, under the poses of their sub-tick."""
        self._set_due(packets.at_ns)
        self._medium.send(packets)

    def advance(self, until_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        """Advance the medium, under the poses of each sub-tick."""
        self._set_due(until_ns)
        return self._medium.advance(until_ns)

    def set_new(self, at_ns: int, poses: SparseTable) -> None:
        """Set new poses, if there are any."""
        if len(poses):
            self._medium.set_poses(at_ns, poses)
            self.poses.append(poses)

    def _set_due(self, until_ns: int) -> None:
        while self._next_ns <= until_ns:
            self.set_new(self._next_ns, self._pop_by(self._next_ns))
            self._next_ns += self._subtick_ns


def _missing(source: LiveSource) -> str:
    names = source.missing()
    shown = ", ".join(names[:3])
    return f"none yet of {shown}{f' and {len(names) - 3} others' if len(names) > 3 else ''}"


def _no_pose(source: LiveSource) -> BadInput:
    expected = f"expected poses within {source.motion.wait_s:g} s: {_missing(source)}"
    faults = ", ".join(f"{count} {name}" for name, count in source.counts().items() if name != "ticks_without_pose")
    return BadInput(source.address, "", f"{expected}{f'; {faults}' if faults else ''}")
