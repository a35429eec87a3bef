"""The delivery ratio over distance: receivers that packets were meant for, and those that heard them, by distance."""

import math

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.fates import Fate
from swarmwire.comms.packets import BROADCAST
from swarmwire.comms.truth import Departed, Finished, Static, Truth
from swarmwire.metrics.geometry_tick import geometry_tick

BINS_WITHIN_RANGE = 20  # at least
ROUND_WIDTHS = (1.0, 2.0, 5.0)
PAIRS_PER_TICK = 5_000  # in an arena where each robot broadcasts once in a tick
POSES_KEPT_S = 5.0  # simulated: of a packet that was on its way for longer the distance is unknown


class DistanceCounts:
    """PDR(d) = receivers that heard / receivers intended, over packets that went on air, by the distance between both.

    Intended are all robots alive in the arena when a broadcast goes on air, however far, and the one receiver of an
    addressed packet; who was out of range, in the way of a wall, dead before it heard or not reached when the run ended
    has not heard. The distance is that at the tick in which the packet went on air, centre to centre.

    Counted is every `every`-th packet of each robot, which bounds the pairs to look at: all up to 70 robots.

    Attributes:
        width_m: of a bin; bin b holds b x width to (b + 1) x width.
        every: one of so many packets of each robot is counted; an odd number, since packets may differ in turns.
        intended: (arenas, bins) receivers.
        heard: (arenas, bins) of these, receivers that heard.
        unknown: receivers that heard but are missing in `heard`, since their packet was on its way for too long: where
            there are any, the ratio is not known.
    """

    def __init__(self, static: Static) -> None:
        self._static = static
        across_m = math.hypot(*static.arena_size_m)
        self.width_m = bin_width_m(min(static.range_m or across_m, across_m))
        bins = int(across_m / self.width_m) + 2
        self.every = -(-static.robots * static.robots // PAIRS_PER_TICK) | 1
        self.intended: IntArray = np.zeros((static.arenas, bins), np.int64)
        self.heard: IntArray = np.zeros((static.arenas, bins), np.int64)
        self.unknown = 0
        self._poses: dict[int, tuple[FloatArray, BoolArray]] = {}  # by tick: x and y (rows, 2), alive (rows,)

    def see(self, truth: Truth) -> None:
        """Add what a tick brought."""
        self._poses[truth.tick] = (truth.pose[:, :2], truth.alive)
        self._poses.pop(truth.tick - int(POSES_KEPT_S * self._static.rate_hz) - 1, None)
        if truth.departed is not None and truth.finished is not None:
            self._add_intended(truth.departed)
            self._add_heard(truth.finished)

    def _add_intended(self, departed: Departed) -> None:
        rows = np.flatnonzero(self._taken(departed.sender, departed.sequence) & (departed.fate == Fate.HEARD))
        arena, sender, to = departed.arena[rows], departed.sender[rows], departed.to[rows]
        ticks = geometry_tick(departed.on_air_at_ns[rows], self._static.rate_hz)
        everyone = np.arange(self._static.robots)
        for tick in np.unique(ticks).tolist():
            if tick not in self._poses:
                continue
            place, alive = self._poses[tick]
            of = ticks == tick
            first = arena[of] * self._static.robots
            receiver = first[:, None] + everyone
            meant = np.where(to[of, None] == BROADCAST, alive[receiver], everyone == to[of, None])
            meant &= everyone != sender[of, None]
            packet, robot = np.nonzero(meant)
            self._count(self.intended, arena[of][packet], place, (first + sender[of])[packet], first[packet] + robot)

    def _add_heard(self, finished: Finished) -> None:
        rows = np.flatnonzero(self._taken(finished.sender, finished.sequence) & (finished.fate == Fate.HEARD))
        arena, sender, receiver = finished.arena[rows], finished.sender[rows], finished.receiver[rows]
        ticks = geometry_tick(finished.on_air_at_ns[rows], self._static.rate_hz)
        first = arena * self._static.robots
        for tick in np.unique(ticks).tolist():
            of = ticks == tick
            if tick not in self._poses:
                self.unknown += int(np.count_nonzero(of))
                continue
            place, _ = self._poses[tick]
            self._count(self.heard, arena[of], place, (first + sender)[of], (first + receiver)[of])

    def _taken(self, sender: IntArray, sequence: IntArray) -> BoolArray:
        """Which packets are counted, (k,): robots take turns, so that each tick has some."""
        return (sender + sequence) % self.every == 0

    def _count(self, to: IntArray, arena: IntArray, place: FloatArray, a: IntArray, b: IntArray) -> None:
        apart_m = np.hypot(*(place[a] - place[b]).T)
        bins = np.minimum((apart_m / self.width_m).astype(np.int64), to.shape[1] - 1)
        np.add.at(to.reshape(-1), arena * to.shape[1] + bins, 1)


def bin_width_m(range_m: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten with at least 20 bins within this range."""
    most = range_m / BINS_WITHIN_RANGE * (1.0 + 1e-9)
    decade = 10.0 ** math.floor(math.log10(most))
    return max(width * decade for width in ROUND_WIDTHS if width * decade <= most)
