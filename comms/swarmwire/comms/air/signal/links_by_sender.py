"""Links by sender: each pair both ways, those that may be told of before those that only disturb."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms.air.decibels import NEPERS, from_db
from swarmwire.comms.air.signal.pairs import Pairs
from swarmwire.comms.air.signal.tables import LinkPlaces, LinkTable
from swarmwire.comms.arrays import ByteArray, FloatArray
from swarmwire.comms.fates import Fate

HEARD = int(Fate.HEARD)
LEFT_OUT, WEAK, STRONG = range(3)


class Levels(NamedTuple):
    """What power makes of a link."""

    listed_dbm: float  # listed from this mean on
    heard_mw: float  # a frame that arrives with less, on a link that is not listed, is never heard
    least_dbm: float  # with a lower mean it does not disturb either


def links_by_sender(
    pairs: Pairs, send_dbm: FloatArray, receive_dbi: FloatArray, fate: ByteArray, levels: Levels
) -> tuple[LinkTable, LinkPlaces]:
    """The links of pairs, both ways.

    `send_dbm` and `receive_dbi` (rows,) hold under events, too; `fate` (2, k) are HEARD where nothing closes the link
    of pair i from a to b, and back.
    """
    both_alike = pairs.back_db is pairs.loss_db
    kind, power_mw, counts = _kinds(pairs, both_alike, send_dbm, receive_dbi, fate, levels)
    stop = np.cumsum(counts.sum(axis=1))
    first = stop - counts.sum(axis=1)
    places = LinkPlaces(first, first + counts[:, STRONG], stop)
    return _filled(pairs.a, pairs.b, fate, kind, power_mw, places, int(stop[-1]) if len(stop) else 0), places


@njit(cache=True)
def _kinds(pairs, both_alike, send_dbm, receive_dbi, fate, levels):
    """What each link is, whether it is listed (4), its power, and how many of each kind each robot has."""
    k = len(pairs.a)
    kind, power_mw, counts = np.empty((2, k), np.uint8), np.empty((2, k)), np.zeros((len(send_dbm), 3), np.int64)
    send_mw, receive = np.exp(send_dbm * NEPERS), np.exp(receive_dbi * NEPERS)
    for i in range(k):
        power_mw[:, i] = from_db(-pairs.loss_db[i]) * pairs.gain[i]
        if not both_alike:
            power_mw[1, i] = from_db(-pairs.back_db[i]) * pairs.gain[i]
    for way in range(2):
        sender, receiver = (pairs.a, pairs.b) if way == 0 else (pairs.b, pairs.a)
        loss_db = pairs.loss_db if way == 0 else pairs.back_db
        for i in range(k):
            s, r = sender[i], receiver[i]
            mean_dbm = send_dbm[s] + receive_dbi[r] - loss_db[i]
            power_mw[way, i] *= send_mw[s] * receive[r]
            is_listed, is_open = mean_dbm >= levels.listed_dbm, fate[way, i] == HEARD
            is_strong = is_listed | (is_open & (power_mw[way, i] >= levels.heard_mw))
            is_weak = is_open & (mean_dbm >= levels.least_dbm) & (not is_strong)
            of_kind = STRONG * is_strong + WEAK * is_weak
            counts[s, of_kind] += 1
            kind[way, i] = of_kind + 4 * is_listed
    counts[:, LEFT_OUT] = 0
    return kind, power_mw, counts


@njit(cache=True)
def _filled(a, b, fate, kind, power_mw, places, links):
    table = LinkTable(
        np.empty(links, np.int64),
        np.empty(links),
        np.zeros(links, np.bool_),
        np.zeros(links, np.uint8),
        np.zeros(links, np.uint8),
    )
    strong, weak = places.first.copy(), places.weak.copy()
    for way in range(2):
        sender, receiver = (a, b) if way == 0 else (b, a)
        for i in range(len(a)):
            of_kind = kind[way, i] & 3
            if of_kind == STRONG:
                at = strong[sender[i]]
                strong[sender[i]] += 1
                table.is_listed[at], table.fate[at] = kind[way, i] >= 4, fate[way, i]
            elif of_kind == WEAK:
                at = weak[sender[i]]
                weak[sender[i]] += 1
            else:
                continue
            table.receiver[at], table.power_mw[at] = receiver[i], power_mw[way, i]
    return table
