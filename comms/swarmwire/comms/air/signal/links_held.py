"""The links under the poses held, by sender, after those of frames that went on air under earlier poses."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.air.disruption import Disruption
from swarmwire.comms.air.signal.links_by_sender import Levels, links_by_sender
from swarmwire.comms.air.signal.measured_links import MeasuredLinks
from swarmwire.comms.air.signal.pairs import Pairs, pairs_of
from swarmwire.comms.air.signal.surroundings import Surroundings
from swarmwire.comms.air.signal.tables import LINK, SILENT, LinkPlaces, Table
from swarmwire.comms.air.stages.stage import Medium
from swarmwire.comms.arrays import ByteArray, FloatArray, IntArray
from swarmwire.comms.fates import Fate
from swarmwire.comms.truth import NOBODY


class LinksHeld:
    """A table of links that frames on air keep theirs in while robots move.

    Attributes:
        link: the links, a table of dtype LINK.
        places: those of each robot under the poses held.
        pairs: the pairs of robots that these links join.
        around: what links go by.
    """

    def __init__(self, medium: Medium, around: Surroundings, levels: Levels, measured: MeasuredLinks | None) -> None:
        """`measured` are the links of the radio's trace, kept up to date by others."""
        self._medium, self._measured = medium, measured
        self.around, self._levels = around, levels
        rows = len(medium.keys) * medium.robots
        self.pose = np.zeros((rows, 3))
        self.pairs = self.pairs_at(self.pose)
        self.link, self.places = self._links(np.empty(0, LINK))

    def pairs_at(self, pose: FloatArray) -> Pairs:
        """The pairs of robots that stand at `pose` (rows, 3)."""
        medium = self._medium
        arenas = medium.keys, medium.running
        return pairs_of(pose, medium.size_m, *arenas, medium.obstacles, self.around, self._measured)

    def mean_dbm(self, pairs: Pairs) -> tuple[FloatArray, FloatArray]:
        """The mean power of each pair from a to b, and back, (k,) each."""
        send_dbm, receive_dbi = self.around.send_dbm, self.around.receive_dbi
        there, back = send_dbm[pairs.a] + receive_dbi[pairs.b], send_dbm[pairs.b] + receive_dbi[pairs.a]
        return there - pairs.loss_db, back - pairs.back_db

    def tune(self, around: Surroundings, levels: Levels) -> None:
        """The radio or its antennas are others from the next `move` on."""
        self.around, self._levels = around, levels

    def move(self, pose: FloatArray, robot: Table, reception: Table) -> None:
        """Robots stand at `pose` from now on; tables of dtype ROBOT and RECEPTION are told where their links are."""
        kept = self._keep_on_air(robot, reception)
        self.pose, self.pairs = pose, self.pairs_at(pose)
        self.link, self.places = self._links(kept)

    def reached(self, sender: IntArray) -> tuple[IntArray, IntArray]:
        """The place of each sender and the receivers in range of it, which nothing blocks, under the poses held."""
        first = self.places.first[sender]
        counts = self.places.weak[sender] - first
        at, link = np.repeat(np.arange(len(sender)), counts), _ranges(first, counts)
        counts_as = self.link["is_listed"][link] & (self.link["fate"][link] != Fate.BLOCKED)
        return at[counts_as], self.link["receiver"][link[counts_as]].astype(np.int64)

    def _links(self, kept: Table) -> tuple[Table, LinkPlaces]:
        pairs, now = self.pairs, self._medium.disruption
        fate = np.stack([_fates(now, *ends, pairs.blocked) for ends in ((pairs.a, pairs.b), (pairs.b, pairs.a))])
        return links_by_sender(pairs, self.around.send_dbm, self.around.receive_dbi, fate, self._levels, kept)

    def _keep_on_air(self, robot: Table, reception: Table) -> Table:
        """The links of frames on air, and where they are from now on."""
        on_air = np.flatnonzero(robot["on_air"] != SILENT)
        first = robot["first_link"][on_air]
        counts = robot["stop_link"][on_air] - first
        index = _ranges(first, counts)
        moved = np.zeros(len(robot), np.int64)
        moved[on_air] = np.cumsum(counts) - counts - first
        for place in ("first_link", "weak_link", "stop_link"):
            robot[place] += moved
        locked = np.flatnonzero(reception["locked_to"] != NOBODY)
        reception["link"][locked] += moved[reception["locked_to"][locked]].astype(np.int32)
        return self.link[index]


def _ranges(first: IntArray, counts: IntArray) -> IntArray:
    """first[0] .. first[0] + counts[0] - 1, then those of the next, and so on."""
    before = np.cumsum(counts) - counts
    return np.repeat(first - before, counts) + np.arange(counts.sum())


def _fates(now: Disruption, sender: IntArray, receiver: IntArray, blocked: IntArray) -> ByteArray:
    """HEARD for links that are open, else what ends each packet on them, (k,)."""
    fate = np.full(len(sender), int(Fate.HEARD), np.uint8)
    if now.anything:
        fate[now.apart(sender, receiver)] = Fate.PARTITIONED
        fate[~now.radio_on[receiver]] = Fate.BLACKOUT
        fate[~now.alive[receiver]] = Fate.RECEIVER_DEAD
    fate[blocked > 0] = Fate.BLOCKED
    return fate
