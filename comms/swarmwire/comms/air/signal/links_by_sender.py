"""Links by sender: each pair both ways, those that may be told of before those that only disturb."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.air.decibels import from_db
from swarmwire.comms.air.signal.pairs import Pairs
from swarmwire.comms.air.signal.tables import LINK, LinkPlaces, Table
from swarmwire.comms.arrays import ByteArray, FloatArray
from swarmwire.comms.borrowing import borrowing
from swarmwire.comms.fates import Fate

HEARD = int(Fate.HEARD)
LEFT_OUT, WEAK, STRONG = range(3)


class Levels(NamedTuple):
    """What power makes of a link."""

    listed_dbm: float  # listed from this mean on
    heard_mw: float  # a frame that arrives with less, on a link that is not listed, is never heard
    least_dbm: float  # with a lower mean it does not disturb either


def links_by_sender(
    pairs: Pairs, send_dbm: FloatArray, receive_dbi: FloatArray, fate: ByteArray, levels: Levels, kept: Table
) -> tuple[Table, LinkPlaces]:
    """The links of pairs, both ways, after those kept, and where they are.

    `send_dbm` and `receive_dbi` (rows,) hold under events, too; `fate` (2, k) are HEARD where nothing closes the link
    of pair i from a to b, and back.
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


@borrowing(from_python=True)
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
        there = _kind(send_dbm[s] + receive_dbi[r] - there_db[i], there_mw, fate[0, i] == HEARD, levels)
        back = _kind(send_dbm[r] + receive_dbi[s] - back_db[i], back_mw, fate[1, i] == HEARD, levels)
        kind[0, i], kind[1, i], power_mw[0, i], power_mw[1, i] = there, back, there_mw, back_mw
        counts[s, np.uint64(there & 3)] += 1
        counts[r, np.uint64(back & 3)] += 1


@borrowing()
def _kind(mean_dbm, power_mw, is_open, levels):
    is_listed = mean_dbm >= levels.listed_dbm
    is_strong = is_listed | (is_open & (power_mw >= levels.heard_mw))
    is_weak = is_open & (mean_dbm >= levels.least_dbm) & (not is_strong)
    return STRONG * is_strong + WEAK * is_weak + 4 * is_listed


@borrowing(from_python=True)
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
            HEARD,
        )
