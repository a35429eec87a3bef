"""Burst loss: a link changes between a good and a bad state and loses a share of its packets in either.

The chain of E. N. Gilbert (Bell Syst. Tech. J. 39, 1960) and E. O. Elliott (42, 1963) in continuous time, so that a
burst's duration does not depend on the packet rate: good turns bad at rate a, bad turns good at rate b, and

    P(bad at t + dt) = pi + (bad at t - pi) exp(-(a + b) dt),     pi = a / (a + b).
"""

# pyright: basic, reportUnknownMemberType=false

import math
from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import BoolArray, IntArray, KeyArray
from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import uniform
from swarmwire.comms.kernels import kernel, njit
from swarmwire.comms.radio.config.impairments import Bursts

# Beyond this many relaxation times 1 / (a + b) the past has no effect: exp(-40) is lost in a draw's 53 bits.
FORGOTTEN = 40.0
STATE, LOSS = purpose("burst state"), purpose("burst loss")
NO_LINK = -1  # a free place of the table
MIN_CAPACITY = 1024
HASH_FACTOR = np.uint64(0x9E3779B97F4A7C15)  # 2^64 / golden section: Knuth's multiplicative hashing


@njit()
def bad_after(was_bad, dt_s, a, b, u):
    """Whether a link is bad `dt_s` after it was in a known state; rates a and b in 1/s, u uniform in [0, 1).

    dt_s = inf is the stationary state, and so is anything beyond `FORGOTTEN` relaxation times.
    """
    share = a / (a + b)
    elapsed = (a + b) * dt_s
    if elapsed >= FORGOTTEN:
        return u < share
    return u < share + ((1.0 if was_bad else 0.0) - share) * math.exp(-elapsed)


class Bursting(NamedTuple):
    """The hash table of link states, and the parameters of the chain, as input of kernels."""

    link: IntArray  # (capacity,) sender x rows + receiver, or NO_LINK
    at_ns: IntArray  # (capacity,) time of its last use
    bad: BoolArray  # (capacity,)
    added: IntArray  # (1,) number of links that kernels added
    a: float  # in 1/s: good turns bad
    b: float  # in 1/s: bad turns good
    loss_bad: float
    loss_good: float


class BurstStates:
    """A sparse table of directed links: a hash by sender and receiver row, open addressing, at most half full.

    Draws are keyed by (sender, receiver, sequence), so fates do not depend on batching, as long as packets of a link
    come in the order of time. A link that was silent for so long that its past has no effect is dropped, which changes
    nothing.
    """

    def __init__(self, bursts: Bursts, keys: KeyArray, robots: int) -> None:
        self._bursts, self._keys, self._robots = bursts, keys, robots
        self._rows = len(keys) * robots
        self._clear(MIN_CAPACITY)

    def __len__(self) -> int:
        """Number of links in the table."""
        return self._kept

    def change(self, bursts: Bursts, now_ns: int) -> None:
        """Use these parameters from `now_ns` on."""
        # Drop outdated states now: slower bursts must not depend on outdated states that happen to be kept.
        self._rebuild(now_ns, 0)
        self._bursts = bursts

    def lost(self, sender: IntArray, receiver: IntArray, sequence: IntArray, at_ns: IntArray) -> BoolArray:
        """Whether each packet (k,) is lost; rows of sender and receiver, times in ns that never fall for a link."""
        if not len(sender):
            return np.zeros(0, np.bool_)
        self.make_room(int(at_ns.min()), len(sender))
        bursting = self.bursting
        ends = _lost(bursting, self._keys, self._robots, self._rows, sender, receiver, sequence, at_ns)
        self.count_added(bursting)
        return ends

    def make_room(self, now_ns: int, links: int) -> None:
        """Make room for `links` more links at `now_ns` or later."""
        if 2 * (self._kept + links) > len(self._link):
            self._rebuild(now_ns, links)

    @property
    def bursting(self) -> Bursting:
        """The table for kernels, which add at most as many links as there is room for; then call `count_added`."""
        bursts, added = self._bursts, np.zeros(1, np.int64)
        a, b = 1.0 / bursts.good_s, 1.0 / bursts.bad_s
        return Bursting(self._link, self._at_ns, self._bad, added, a, b, bursts.loss_bad, bursts.loss_good)

    def count_added(self, bursting: Bursting) -> None:
        """Count the links that kernels added to the table."""
        self._kept += int(bursting.added[0])

    def _clear(self, capacity: int) -> None:
        self._link = np.full(capacity, NO_LINK, np.int64)
        self._at_ns = np.zeros(capacity, np.int64)
        self._bad = np.zeros(capacity, np.bool_)
        self._kept = 0

    def _rebuild(self, now_ns: int, room: int) -> None:
        """Rebuild the table for states valid at `now_ns` and `room` more links, at most a quarter full."""
        relaxation_s = 1.0 / (1.0 / self._bursts.good_s + 1.0 / self._bursts.bad_s)
        # One relaxation time more than `bad_after` needs: rounding then cannot make a difference.
        silent_ns = math.ceil((FORGOTTEN + 1.0) * relaxation_s * NS_PER_S)
        counts = (self._link != NO_LINK) & (now_ns - self._at_ns <= silent_ns)
        link, at_ns, bad = self._link[counts], self._at_ns[counts], self._bad[counts]
        self._clear(max(1 << (4 * (len(link) + room) - 1).bit_length(), MIN_CAPACITY))
        _insert(self._link, self._at_ns, self._bad, link, at_ns, bad)
        self._kept = len(link)


@njit()
def _place(links, link):
    """The place of a link in the table, or the free place for it."""
    mask = np.uint64(len(links) - 1)
    # The upper half of the product depends on all bits of the link; its lowest bits would only on the lowest.
    at = ((np.uint64(link) * HASH_FACTOR) >> np.uint64(32)) & mask
    while links[at] != NO_LINK and links[at] != link:
        at = (at + np.uint64(1)) & mask
    return at


@njit()
def _insert(links, links_at_ns, links_bad, link, at_ns, bad):
    for i in range(len(link)):
        at = _place(links, link[i])
        links[at], links_at_ns[at], links_bad[at] = link[i], at_ns[i], bad[i]


@njit()
def _lost(bursting, keys, robots, rows, sender, receiver, sequence, at_ns):
    ends = np.zeros(len(sender), np.bool_)
    for i in range(len(sender)):
        key, s, r = keys[sender[i] // robots], sender[i] % robots, receiver[i] % robots
        link = sender[i] * rows + receiver[i]
        ends[i] = takes(bursting, link, key, s, r, sequence[i], 0, at_ns[i])
    return ends


@kernel()
def takes(bursting, link, key, s, r, sequence, attempt, at_ns):
    """Whether a packet from s to r, indices in the arena, is lost at `at_ns`."""
    at = _place(bursting.link, link)
    silent_s = np.inf
    if bursting.link[at] == NO_LINK:
        bursting.link[at] = link
        bursting.added[0] += 1
    else:
        silent_s = (at_ns - bursting.at_ns[at]) / NS_PER_S
    u = uniform(key, s, r, sequence, STATE + attempt)
    bad = bad_after(bursting.bad[at], silent_s, bursting.a, bursting.b, u)
    bursting.at_ns[at], bursting.bad[at] = at_ns, bad
    return uniform(key, s, r, sequence, LOSS + attempt) < (bursting.loss_bad if bad else bursting.loss_good)
