"""The links under the poses held, by sender, after those of frames that went on air under earlier poses."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.air.disruption import Disruption
from swarmwire.comms.air.signal.link_table import Pairs, Surroundings, both_ways, pairs_of
from swarmwire.comms.air.signal.tables import LINK, NOBODY, SILENT, Table
from swarmwire.comms.air.stage import Medium
from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.fates import Fate


class LinksHeld:
    """A table of links that frames on air keep theirs in while robots move.

    Attributes:
        link: (links,) of dtype LINK.
        first, stop: (rows,) the links of each robot under the poses held.
        pairs: the pairs of robots that these links join.
    """

    def __init__(self, medium: Medium, size_m: tuple[float, float], around: Surroundings, listed_dbm: float) -> None:
        self._medium, self._size_m, self._around, self._listed_dbm = medium, size_m, around, listed_dbm
        self._rows = len(medium.keys) * medium.robots
        self.link: Table = np.zeros(0, LINK)
        self.first, self.stop = np.zeros(self._rows, np.int64), np.zeros(self._rows, np.int64)
        self.pose = np.zeros((self._rows, 3))
        self.pairs = self.pairs_at(self.pose)

    def pairs_at(self, pose: FloatArray) -> Pairs:
        """The pairs of robots that stand at `pose` (rows, 3)."""
        return pairs_of(pose, self._size_m, self._medium.keys, self._medium.obstacles, self._around)

    def move(self, pose: FloatArray, robot: Table) -> None:
        """Robots stand at `pose` from now on; `robot` (rows,) of dtype ROBOT is told where its links are."""
        kept = self._keep_on_air(robot)
        self.pose, self.pairs = pose, self.pairs_at(pose)
        pairs = self.pairs
        order, start = both_ways(self._rows, pairs.a, pairs.b)
        pair = order % max(len(pairs.a), 1)
        sender = np.concatenate([pairs.a, pairs.b])[order]
        link: Table = np.zeros(len(order), LINK)
        link["receiver"] = np.concatenate([pairs.b, pairs.a])[order]
        link["power_mw"] = pairs.power_mw[pair]
        link["is_listed"] = pairs.mean_dbm[pair] >= self._listed_dbm
        link["fate"] = _fates(self._medium.disruption, sender, link["receiver"], pairs.blocked[pair])
        self.link = np.concatenate([kept, link])
        self.first, self.stop = start[:-1] + len(kept), start[1:] + len(kept)

    def reached(self, sender: IntArray) -> tuple[IntArray, IntArray]:
        """The place of each sender and the receivers in range of it, which nothing blocks, under the poses held."""
        counts = self.stop[sender] - self.first[sender]
        at = np.repeat(np.arange(len(sender)), counts)
        link = self.link[_ranges(self.first[sender], counts)]
        counts_as = (link["is_listed"] > 0) & (link["fate"] != Fate.BLOCKED)
        return at[counts_as], link["receiver"][counts_as]

    def _keep_on_air(self, robot: Table) -> Table:
        """The links of frames on air, and where they are from now on."""
        on_air = np.flatnonzero(robot["on_air"] != SILENT)
        first = robot["first_link"][on_air]
        counts = robot["stop_link"][on_air] - first
        kept = self.link[_ranges(first, counts)]
        moved = np.zeros(self._rows, np.int64)
        moved[on_air] = np.cumsum(counts) - counts - first
        robot["first_link"] += moved
        robot["stop_link"] += moved
        locked = np.flatnonzero(robot["locked_to"] != NOBODY)
        robot["link"][locked] += moved[robot["locked_to"][locked]]
        return kept


def _ranges(first: IntArray, counts: IntArray) -> IntArray:
    """first[0] .. first[0] + counts[0] - 1, then those of the next, and so on."""
    before = np.cumsum(counts) - counts
    return np.repeat(first - before, counts) + np.arange(counts.sum())


def _fates(now: Disruption, sender: IntArray, receiver: IntArray, blocked: IntArray) -> IntArray:
    """HEARD for links that are open, else what ends each packet on them, (k,)."""
    fate = np.full(len(sender), int(Fate.HEARD))
    if now.anything:
        fate[now.apart(sender, receiver)] = Fate.PARTITIONED
        fate[~now.radio_on[receiver]] = Fate.BLACKOUT
        fate[~now.alive[receiver]] = Fate.RECEIVER_DEAD
    fate[blocked > 0] = Fate.BLOCKED
    return fate


def open_ways(now: Disruption, a: IntArray, b: IntArray) -> BoolArray:
    """Which pairs of robot rows no disruption keeps apart, (k,)."""
    if not now.anything:
        return np.ones(len(a), np.bool_)
    return now.radio_on[a] & now.radio_on[b] & ~now.apart(a, b)
