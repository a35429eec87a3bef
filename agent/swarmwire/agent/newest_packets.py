"""The newest packet of each sender, for each robot, in slots of a fixed number: the nearest or the newest first."""

from math import inf
from typing import Any

import numpy as np

from swarmwire.agent.packet import Packets
from swarmwire.comms.arrays import FloatArray, IntArray

NO_PACKET = -1  # in an empty slot
MAX_PAIRS = 2**22  # of receiver and sender in a table


def newest_packets(received: Packets[Any], n: int, most: int, *, by_range: bool) -> IntArray:
    """The packets, by their place in `received`, of each of n robots: the newest of each sender, (n x most,).

    Those of a robot stand in order, the newest first, or with `by_range` the nearest; the rest is NO_PACKET.
    """
    index = _newest_of_each(received.row, received.sender, n)
    row = received.row[index]
    count = np.bincount(row, minlength=n)
    first = np.cumsum(count) - count
    slots = np.arange(most)
    if by_range:
        width = max(int(count.max()), most)
        ranges: FloatArray = np.full(n * width, inf)
        ranges[np.arange(len(row)) + (np.arange(n) * width - first)[row]] = received.range_m[index]
        place: IntArray = np.argsort(ranges.reshape(n, width), axis=1, kind="stable")[:, :most]
    else:
        place = count[:, None] - 1 - slots
    there = slots < count[:, None]
    return np.where(there, index[np.where(there, first[:, None] + place, 0)], NO_PACKET).reshape(-1)


def _newest_of_each(row: IntArray, sender: IntArray, n: int) -> IntArray:
    """The last packet of each robot and sender, rising; packets are in order of robots, then of time."""
    senders = int(sender.max()) + 1
    pair = row * senders + sender
    if n * senders > MAX_PAIRS:
        pair = np.unique(pair, return_inverse=True)[1].reshape(-1)
    last = np.zeros(min(n * senders, int(pair.max()) + 1), np.int64)
    at = np.arange(len(pair))
    last[pair] = at  # of several, numpy keeps the last
    return np.flatnonzero(last[pair] == at)
