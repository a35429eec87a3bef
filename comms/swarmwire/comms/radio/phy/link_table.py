"""The link table: directed links grouped by sender, under the current poses.

Each sender's strong links (a frame may be received, or its fate is recorded) come before its weak links (interference
only). Links of frames that went on air under earlier poses stay in front until these frames end.
"""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray, SignedByteArray, Table
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.sentinels import NO_ROBOT, UNDER_WAY
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.phy.pairs import MeasuredLinks, Pairs, pairs_of
from swarmwire.comms.radio.phy.propagation import PropagationParams
from swarmwire.comms.radio.phy.spreading import OMITTED, STRONG, WEAK, Spreading
from swarmwire.comms.radio.phy.state import LINK, SILENT, LinkRanges
from swarmwire.comms.radio.propagation.decibels import from_db
from swarmwire.comms.radio.stages.blocking import LineOfSight, end_disrupted
from swarmwire.comms.robot.packets import Fate


class Thresholds(NamedTuple):
    """Power thresholds that decide the kind of a link."""

    sensitivity_dbm: float  # least mean power of a receiver in range
    receivable_mw: float  # power below which frames out of range are never received
    interference_dbm: float  # mean power below which a frame does not interfere either


def links_by_sender(
    pairs: Pairs,
    send_dbm: FloatArray,
    receive_dbi: FloatArray,
    fate: SignedByteArray,
    thresholds: Thresholds,
    on_air: Table,
    spreading: Spreading | None = None,
) -> tuple[Table, LinkRanges]:
    """Return the links of `pairs` in both directions, after links `on_air`, and their ranges by sender.

    `send_dbm` and `receive_dbi` (rows,) include the effect of events. `fate` (2, k) is UNDER_WAY for open links of
    pair i, from a to b and from b to a. `spreading` is that of robots with different spreading factors.
    """
    k, rows = len(pairs.a), len(send_dbm)
    kind, power_mw, counts = np.empty((2, k), np.uint8), np.empty((2, k)), np.zeros((rows, 3), np.int64)
    is_symmetric, antenna_gains = pairs.reverse_db is pairs.loss_db, np.empty((2, rows))
    _find_kinds(kind, power_mw, counts, antenna_gains, pairs, is_symmetric, send_dbm, receive_dbi, fate, thresholds)
    if spreading is not None:
        interferes = thresholds.interference_dbm < np.inf
        spreading.separate(kind, power_mw, counts, pairs.a, pairs.b, fate, interferes)
    per_robot = counts[:, WEAK] + counts[:, STRONG]
    before, stop = len(on_air), np.cumsum(per_robot) + len(on_air)
    first = stop - per_robot
    weak, links = first + counts[:, STRONG], before + int(per_robot.sum())
    link = np.empty(links + 1, LINK)  # the extra row is for links that are omitted
    link[:before] = on_air
    next_row = np.column_stack([np.full(rows, links), weak, first])
    _fill(link, next_row, pairs.a, pairs.b, fate[0], kind[0], power_mw[0])
    _fill(link, next_row, pairs.b, pairs.a, fate[1], kind[1], power_mw[1])
    return link[:links], LinkRanges(first, weak, stop)


@kernel(from_python=True, nogil=True)
def _find_kinds(kind, power_mw, counts, antenna_gains, pairs, is_symmetric, send_dbm, receive_dbi, fate, thresholds):
    """Compute kind (+ 4 if the mean power reaches the sensitivity) and power of each link; count by robot and kind."""
    a, b, forward_db, reverse_db, gain, _ = pairs
    send, receive = antenna_gains  # ratios
    for r in range(len(send)):
        send[r], receive[r] = from_db(send_dbm[r]), from_db(receive_dbi[r])
    for i in range(len(a)):  # a loop of its own is vectorised
        power_mw[0, i] = from_db(-forward_db[i]) * gain[i]
    for i in range(len(a)):
        s, r = np.uint64(a[i]), np.uint64(b[i])
        forward_mw = reverse_mw = power_mw[0, i]
        if not is_symmetric:
            reverse_mw = from_db(-reverse_db[i]) * gain[i]
        forward_mw *= send[s] * receive[r]
        reverse_mw *= send[r] * receive[s]
        forward = _kind(send_dbm[s] + receive_dbi[r] - forward_db[i], forward_mw, fate[0, i] == UNDER_WAY, thresholds)
        reverse = _kind(send_dbm[r] + receive_dbi[s] - reverse_db[i], reverse_mw, fate[1, i] == UNDER_WAY, thresholds)
        kind[0, i], kind[1, i], power_mw[0, i], power_mw[1, i] = forward, reverse, forward_mw, reverse_mw
        counts[s, np.uint64(forward & 3)] += 1
        counts[r, np.uint64(reverse & 3)] += 1


@kernel()
def _kind(mean_dbm, power_mw, is_open, thresholds):
    above_sensitivity = mean_dbm >= thresholds.sensitivity_dbm
    is_strong = above_sensitivity | (is_open & (power_mw >= thresholds.receivable_mw))
    is_weak = is_open & (mean_dbm >= thresholds.interference_dbm) & (not is_strong)
    return STRONG * is_strong + WEAK * is_weak + 4 * above_sensitivity


@kernel(from_python=True, nogil=True)
def _fill(link, next_row, sender, receiver, fate, kind, power_mw):
    """Write the links of one direction; advances `next_row` (rows, 3), the next free row by robot and kind."""
    for i in range(len(kind)):
        s, column = np.uint64(sender[i]), np.uint64(kind[i] & 3)
        k = np.uint64(next_row[s, column])
        next_row[s, column] += column != OMITTED
        row = link[k]
        row.power_mw, row.receiver, row.above_sensitivity, row.fate, row.frame_fate = (
            power_mw[i],
            receiver[i],
            kind[i] >= 4,
            fate[i],
            UNDER_WAY,
        )


class _Pending(NamedTuple):
    """Pairs that another thread computes."""

    pose: FloatArray
    propagation: PropagationParams
    pairs: Callable[[], Pairs]  # waits for the result


class LinkTable:
    """The links by sender; frames on air keep their links while robots move.

    Attributes:
        link: the links, a table of dtype LINK.
        ranges: the links of each robot under the current poses.
        pairs: the pairs of robots of these links.
        propagation: the propagation parameters.
    """

    def __init__(
        self,
        context: ChannelContext,
        propagation: PropagationParams,
        thresholds: Thresholds,
        measured: MeasuredLinks | None,
        spreading: Spreading | None,
    ) -> None:
        """`measured` holds the links of the radio's trace; the caller keeps it up to date."""
        self._context, self._line_of_sight, self._measured = context, LineOfSight.create(context), measured
        self.propagation, self._thresholds, self._spreading = propagation, thresholds, spreading
        rows = len(context.keys) * context.robots
        self.pose = np.zeros((rows, 4))
        # Obstacles may be pushed, and measured strengths change by themselves.
        self._depends_on_poses_only = measured is None and self._line_of_sight is None and not propagation.walls
        self._is_new, self._running = True, context.running.copy()
        self._pending: _Pending | None = None
        self.pairs = self.pairs_at(self.pose)
        self.link, self.ranges = self._links(np.empty(0, LINK))

    def pairs_at(self, pose: FloatArray) -> Pairs:
        """Pairs of robots at `pose` (rows, 4)."""
        return self._pairs_at(pose, self.propagation)

    def _pairs_at(self, pose: FloatArray, propagation: PropagationParams) -> Pairs:
        context = self._context
        arenas = context.size_m, context.keys, context.running, context.obstacles
        return pairs_of(pose, *arenas, propagation, self._line_of_sight, self._measured)

    def expect(self, pose: FloatArray) -> None:
        """Begin to compute the pairs for a `move` to `pose`, where another thread is free for it."""
        threads, propagation, rows = self._context.threads, self.propagation, len(self.pairs.a)
        if threads.are_worth(rows) and self._depends_on_poses_only and not self._stays(pose):
            pairs = threads.start(partial(self._pairs_at, pose, propagation), rows)
            self._pending = _Pending(pose, propagation, pairs)

    def _stays(self, pose: FloatArray) -> bool:
        """Return True if nothing has changed that links of robots at `pose` depend on."""
        return (
            self._depends_on_poses_only
            and not self._is_new
            and not self._context.disruption.is_active
            and np.array_equal(pose, self.pose)
            and np.array_equal(self._context.running, self._running)
        )

    def mean_dbm(self, pairs: Pairs) -> tuple[FloatArray, FloatArray]:
        """Return the mean power in dBm of each pair, from a to b and from b to a, (k,) each."""
        send_dbm, receive_dbi = self.propagation.send_dbm, self.propagation.receive_dbi
        forward, reverse = send_dbm[pairs.a] + receive_dbi[pairs.b], send_dbm[pairs.b] + receive_dbi[pairs.a]
        return forward - pairs.loss_db, reverse - pairs.reverse_db

    def tune(self, propagation: PropagationParams, thresholds: Thresholds, spreading: Spreading | None) -> None:
        """Use these parameters from the next `move` on."""
        self.propagation, self._thresholds, self._spreading, self._is_new = propagation, thresholds, spreading, True

    def move(self, pose: FloatArray, robot: Table, reception: Table) -> None:
        """Rebuild the links for robots at `pose`, and update the link rows in tables of dtype ROBOT and RECEPTION.

        Links stay if nothing has changed.
        """
        pending, self._pending = self._pending, None
        pairs = pending.pairs() if pending else None
        if self._stays(pose):
            return
        on_air = self._links_on_air(robot, reception)
        matches = pending is not None and pending.pose is pose and pending.propagation is self.propagation
        self.pose, self.pairs = pose, pairs if pairs is not None and matches else self.pairs_at(pose)
        self.link, self.ranges = self._links(on_air)
        self._is_new, self._running = self._context.disruption.is_active, self._context.running.copy()

    def reached(self, sender: IntArray) -> tuple[IntArray, IntArray]:
        """Return pairs of an index in `sender` (k,) and an unblocked receiver in range, under the current poses."""
        first = self.ranges.first[sender]
        counts = self.ranges.weak[sender] - first
        index, link = np.repeat(np.arange(len(sender)), counts), _ranges(first, counts)
        is_reached = self.link["above_sensitivity"][link] & (self.link["fate"][link] != Fate.BLOCKED)
        return index[is_reached], self.link["receiver"][link[is_reached]].astype(np.int64)

    def _links(self, on_air: Table) -> tuple[Table, LinkRanges]:
        pairs, disruption = self.pairs, self._context.disruption
        fate = np.full((2, len(pairs.a)), UNDER_WAY, np.int8)
        fate[:, pairs.blocked] = int(Fate.BLOCKED)
        if disruption.is_active:
            end_disrupted(disruption.cuts, fate[0], pairs.a, pairs.b)
            end_disrupted(disruption.cuts, fate[1], pairs.b, pairs.a)
        antennas = self.propagation.send_dbm, self.propagation.receive_dbi
        return links_by_sender(pairs, *antennas, fate, self._thresholds, on_air, self._spreading)

    def _links_on_air(self, robot: Table, reception: Table) -> Table:
        """Return the links of frames on air; updates their rows in `robot` and `reception`."""
        return self.link[_to_front(robot, reception)]


@njit()
def _to_front(robot, reception):
    """Return the link rows of frames on air, sorted by robot, and point `robot` and `reception` to their new rows.

    Few frames are on air between two ticks, so that nearly all robots need one comparison only.
    """
    links = 0
    for r in range(len(robot)):
        links += (robot[r].stop_link - robot[r].first_link) * (robot[r].on_air != SILENT)
    index, shift, count = np.empty(links, np.int64), np.zeros(len(robot), np.int64), 0
    for r in range(len(robot)):
        radio = robot[r]
        if radio.on_air != SILENT:
            shift[r] = count - radio.first_link
            for row in range(radio.first_link, radio.stop_link):
                index[count] = row
                count += 1
            radio.first_link += shift[r]
            radio.weak_link += shift[r]
            radio.stop_link += shift[r]
    for r in range(len(reception)):
        if reception[r].locked_to != NO_ROBOT:
            reception[r].link += shift[reception[r].locked_to]
    return index


def _ranges(first: IntArray, counts: IntArray) -> IntArray:
    """Return the concatenated ranges first[i] .. first[i] + counts[i] - 1."""
    before = np.cumsum(counts) - counts
    return np.repeat(first - before, counts) + np.arange(counts.sum())
