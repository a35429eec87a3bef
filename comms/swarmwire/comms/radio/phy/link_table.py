"""Links by sender: each pair both ways, those that may be told of before those that only disturb."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import ByteArray, FloatArray, IntArray
from swarmwire.comms.kernels import kernel
from swarmwire.comms.packets import Fate
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.comms.radio.phy.losses import MeasuredLinks
from swarmwire.comms.radio.phy.pairs import Pairs, pairs_of
from swarmwire.comms.radio.phy.propagation import PropagationParams
from swarmwire.comms.radio.phy.state import LINK, SILENT, LinkPlaces, Table
from swarmwire.comms.radio.propagation.decibels import from_db
from swarmwire.comms.radio.stages.stage import ChannelContext
from swarmwire.comms.truth import NO_ROBOT

RECEIVED = int(Fate.RECEIVED)
LEFT_OUT, WEAK, STRONG = range(3)


class Thresholds(NamedTuple):
    """What power makes of a link."""

    listed_dbm: float  # listed from this mean on
    received_mw: float  # a frame that arrives with less, on a link that is not listed, is never received
    least_dbm: float  # with a lower mean it does not disturb either


def links_by_sender(
    pairs: Pairs, send_dbm: FloatArray, receive_dbi: FloatArray, fate: ByteArray, levels: Thresholds, kept: Table
) -> tuple[Table, LinkPlaces]:
    """The links of pairs, both ways, after those kept, and where they are.

    `send_dbm` and `receive_dbi` (rows,) hold under events, too; `fate` (2, k) are RECEIVED where nothing closes the
    link of pair i from a to b, and back.
    """
    k, rows = len(pairs.a), len(send_dbm)
    kind, power_mw, counts = np.empty((2, k), np.uint8), np.empty((2, k)), np.zeros((rows, 3), np.int64)
    both_alike, own = pairs.back_db is pairs.loss_db, np.empty((2, rows))
    _find_kinds(kind, power_mw, counts, own, pairs, both_alike, send_dbm, receive_dbi, fate, levels)
    per_robot = counts[:, WEAK] + counts[:, STRONG]
    before, stop = len(kept), np.cumsum(per_robot) + len(kept)
    first = stop - per_robot
    weak, links = first + counts[:, STRONG], before + int(per_robot.sum())
    link = np.empty(links + 1, LINK)  # one place more, for whom is left out
    link[:before] = kept
    next_place = np.column_stack([np.full(rows, links), weak, first])
    _fill(link, next_place, pairs.a, pairs.b, fate[0], kind[0], power_mw[0])
    _fill(link, next_place, pairs.b, pairs.a, fate[1], kind[1], power_mw[1])
    return link[:links], LinkPlaces(first, weak, stop)


@kernel(from_python=True)
def _find_kinds(kind, power_mw, counts, own, pairs, both_alike, send_dbm, receive_dbi, fate, levels):
    """What each link is, 4 more if it is listed, its power, and how many of each kind each robot has."""
    a, b, there_db, back_db, gain, _ = pairs
    send, receive = own  # as ratios
    for r in range(len(send)):
        send[r], receive[r] = from_db(send_dbm[r]), from_db(receive_dbi[r])
    for i in range(len(a)):
        s, r = np.uint64(a[i]), np.uint64(b[i])
        there_mw = back_mw = from_db(-there_db[i]) * gain[i]
        if not both_alike:
            back_mw = from_db(-back_db[i]) * gain[i]
        there_mw *= send[s] * receive[r]
        back_mw *= send[r] * receive[s]
        there = _kind(send_dbm[s] + receive_dbi[r] - there_db[i], there_mw, fate[0, i] == RECEIVED, levels)
        back = _kind(send_dbm[r] + receive_dbi[s] - back_db[i], back_mw, fate[1, i] == RECEIVED, levels)
        kind[0, i], kind[1, i], power_mw[0, i], power_mw[1, i] = there, back, there_mw, back_mw
        counts[s, np.uint64(there & 3)] += 1
        counts[r, np.uint64(back & 3)] += 1


@kernel()
def _kind(mean_dbm, power_mw, is_open, levels):
    is_listed = mean_dbm >= levels.listed_dbm
    is_strong = is_listed | (is_open & (power_mw >= levels.received_mw))
    is_weak = is_open & (mean_dbm >= levels.least_dbm) & (not is_strong)
    return STRONG * is_strong + WEAK * is_weak + 4 * is_listed


@kernel(from_python=True)
def _fill(link, next_place, sender, receiver, fate, kind, power_mw):
    """Put in the links of one way; `next_place` (rows, 3), where each robot's next of a kind goes, moves on."""
    for i in range(len(kind)):
        s, of_kind = np.uint64(sender[i]), np.uint64(kind[i] & 3)
        at = np.uint64(next_place[s, of_kind])
        next_place[s, of_kind] += of_kind != LEFT_OUT
        one = link[at]
        one.power_mw, one.receiver, one.is_listed, one.fate, one.now = (
            power_mw[i],
            receiver[i],
            kind[i] >= 4,
            fate[i],
            RECEIVED,
        )


# --- The links under the poses held, by sender, after those of frames that went on air under earlier poses.


class LinkTable:
    """A table of links that frames on air keep theirs in while robots move.

    Attributes:
        link: the links, a table of dtype LINK.
        places: those of each robot under the poses held.
        pairs: the pairs of robots that these links join.
        around: what links go by.
    """

    def __init__(
        self, context: ChannelContext, around: PropagationParams, levels: Thresholds, measured: MeasuredLinks | None
    ) -> None:
        """`measured` are the links of the radio's trace, kept up to date by others."""
        self._context, self._measured = context, measured
        self.around, self._levels = around, levels
        rows = len(context.keys) * context.robots
        self.pose = np.zeros((rows, 3))
        self.pairs = self.pairs_at(self.pose)
        self.link, self.places = self._links(np.empty(0, LINK))

    def pairs_at(self, pose: FloatArray) -> Pairs:
        """The pairs of robots that stand at `pose` (rows, 3)."""
        context = self._context
        arenas = context.keys, context.running
        return pairs_of(pose, context.size_m, *arenas, context.obstacles, self.around, self._measured)

    def mean_dbm(self, pairs: Pairs) -> tuple[FloatArray, FloatArray]:
        """The mean power of each pair from a to b, and back, (k,) each."""
        send_dbm, receive_dbi = self.around.send_dbm, self.around.receive_dbi
        there, back = send_dbm[pairs.a] + receive_dbi[pairs.b], send_dbm[pairs.b] + receive_dbi[pairs.a]
        return there - pairs.loss_db, back - pairs.back_db

    def tune(self, around: PropagationParams, levels: Thresholds) -> None:
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
        pairs, now = self.pairs, self._context.disruption
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
        locked = np.flatnonzero(reception["locked_to"] != NO_ROBOT)
        reception["link"][locked] += moved[reception["locked_to"][locked]].astype(np.int32)
        return self.link[index]


def _ranges(first: IntArray, counts: IntArray) -> IntArray:
    """first[0] .. first[0] + counts[0] - 1, then those of the next, and so on."""
    before = np.cumsum(counts) - counts
    return np.repeat(first - before, counts) + np.arange(counts.sum())


def _fates(now: Disruption, sender: IntArray, receiver: IntArray, blocked: IntArray) -> ByteArray:
    """RECEIVED for links that are open, else what ends each packet on them, (k,)."""
    fate = np.full(len(sender), int(Fate.RECEIVED), np.uint8)
    if now.anything:
        fate[now.apart(sender, receiver)] = Fate.PARTITIONED
        fate[~now.radio_on[receiver]] = Fate.BLACKOUT
        fate[~now.alive[receiver]] = Fate.RECEIVER_DEAD
    fate[blocked > 0] = Fate.BLOCKED
    return fate
