"""Burst loss: a link changes between a good and a bad state and loses a share of its packets in either.

The chain of E. N. Gilbert (Bell Syst. Tech. J. 39, 1960) and E. O. Elliott (42, 1963) in continuous time, so that a
burst's duration does not depend on the packet rate: good turns bad at rate a, bad turns good at rate b, and

    P(bad at t + dt) = pi + (bad at t - pi) exp(-(a + b) |dt|),     pi = a / (a + b).

A chain of two states is reversible, so the same holds for dt < 0. That is needed where both directions of a link share
a state (`symmetric`): within a tick, packets of different senders are not in the order of their times.
"""

# pyright: basic, reportUnknownMemberType=false

import math
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, IntArray
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.comms.base.sentinels import UNDER_WAY
from swarmwire.comms.radio.config.impairments import Bursts
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.stages.link_draws import loss_uniform
from swarmwire.comms.radio.stages.loss import FrameLoss
from swarmwire.comms.robot.packets import Fate

# Beyond this many relaxation times 1 / (a + b) the past has no effect: exp(-40) is lost in a draw's 53 bits.
FORGOTTEN = 40.0
STATE, LOSS = purpose("burst state"), purpose("burst loss")
ACK_STATE, ACK_LOSS = purpose("burst state of an acknowledgement"), purpose("burst loss of an acknowledgement")
BURST = int(Fate.BURST)
NO_LINK = -1  # an empty slot of the table
MIN_CAPACITY = 1024
HASH_FACTOR = np.uint64(0x9E3779B97F4A7C15)  # 2^64 / golden section: Knuth's multiplicative hashing


@njit()
def bad_after(was_bad, dt_s, a, b, u):
    """Return True if a link is bad `dt_s` after it was bad or good; rates a and b in 1/s, u uniform in [0, 1).

    From `FORGOTTEN` relaxation times on, and for dt_s = inf, this is the stationary state.
    """
    share = a / (a + b)
    elapsed = (a + b) * dt_s
    if elapsed >= FORGOTTEN:
        return u < share
    return u < share + ((1.0 if was_bad else 0.0) - share) * math_compiled.exp(-elapsed)


class BurstParams(NamedTuple):
    """The hash table of link states, and the parameters of the chain, as input of kernels."""

    is_used: bool
    rows: int  # number of robots of all arenas
    symmetric: bool  # True: both directions of a link share a state
    link: IntArray  # (capacity,) one end x rows + the other, or NO_LINK
    at_ns: IntArray  # (capacity,) time of its state: that of its latest frame
    bad: BoolArray  # (capacity,)
    links: IntArray  # (1,) number of links in the table
    a: float  # rate in 1/s at which good turns bad
    b: float  # rate in 1/s at which bad turns good
    loss_bad: float
    loss_good: float


NO_TABLE = np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0, np.bool_), np.zeros(1, np.int64)
NO_BURSTS = BurstParams(False, 0, False, *NO_TABLE, 0.0, 0.0, 0.0, 0.0)


@njit()
def _slot(links, link):
    """Return the slot of a link in the table, or the empty slot for it."""
    mask = np.uint64(len(links) - 1)
    # The upper half of the product depends on all bits of the link, its lowest bits on the lowest ones alone.
    slot = ((np.uint64(link) * HASH_FACTOR) >> np.uint64(32)) & mask
    while links[slot] != NO_LINK and links[slot] != link:
        slot = (slot + np.uint64(1)) & mask
    return slot


@kernel()
def burst_loss(params, frame):
    """Return BURST by the link's state, which changes with the time since its last frame."""
    if not params.is_used:
        return UNDER_WAY
    a, b = frame.sender, frame.receiver
    if params.symmetric:
        a, b = min(a, b), max(a, b)
    link = a * params.rows + b
    slot = _slot(params.link, link)
    silent_s = np.inf
    if params.link[slot] == NO_LINK:
        params.link[slot] = link
        params.links[0] += 1
    else:
        silent_s = abs(frame.at_ns - params.at_ns[slot]) / NS_PER_S
    u = loss_uniform(frame, STATE, ACK_STATE)
    bad = bad_after(params.bad[slot], silent_s, params.a, params.b, u)
    if frame.at_ns >= params.at_ns[slot]:
        params.at_ns[slot], params.bad[slot] = frame.at_ns, bad
    return BURST if loss_uniform(frame, LOSS, ACK_LOSS) < (params.loss_bad if bad else params.loss_good) else UNDER_WAY


class BurstLoss(FrameLoss):
    """The Gilbert-Elliott chain in continuous time, for each directed link, or for both directions of a link together.

    The states are in a hash table by sender and receiver row, with open addressing, at most half full. Links that were
    silent for so long that their past has no effect are dropped, which changes no fate.
    """

    name = "burst_loss"
    keys = ("bursts",)
    has_state = True

    @classmethod
    def create(cls, context: ChannelContext) -> FrameLoss | None:
        """Return the loss if the radio has bursts."""
        bursts = context.radio.bursts
        return None if bursts is None else BurstLoss(bursts, context.rows)

    def __init__(self, bursts: Bursts, rows: int) -> None:
        """Create a table without links; `rows` is the number of robots of all arenas."""
        self._bursts, self._rows = bursts, rows
        self._clear(MIN_CAPACITY)

    def __len__(self) -> int:
        """Number of links in the table."""
        return int(self._links[0])

    def params(self, from_ns: int, links: int) -> BurstParams:
        """Return the table, with room for `links` more links."""
        if 2 * (len(self) + links) > len(self._link):
            self._rebuild(from_ns, links)
        a, b = 1.0 / self._bursts.good_s, 1.0 / self._bursts.bad_s
        loss_bad, loss_good = float(self._bursts.loss_bad), float(self._bursts.loss_good)
        table = self._link, self._at_ns, self._bad, self._links
        return BurstParams(True, self._rows, self._bursts.symmetric, *table, a, b, loss_bad, loss_good)

    @property
    def passing(self) -> float:
        """1 - long-run loss."""
        return 1.0 - self._bursts.loss

    def continue_from(self, previous: FrameLoss, at_ns: int) -> None:
        """Keep the state of all links."""
        assert isinstance(previous, BurstLoss)
        # Drop outdated states now: slower bursts must not depend on outdated states that happen to be in the table.
        previous._rebuild(at_ns, 0)
        self._link, self._at_ns, self._bad, self._links = (
            previous._link,
            previous._at_ns,
            previous._bad,
            previous._links,
        )

    def _clear(self, capacity: int) -> None:
        self._link = np.full(capacity, NO_LINK, np.int64)
        self._at_ns = np.zeros(capacity, np.int64)
        self._bad = np.zeros(capacity, np.bool_)
        self._links = np.zeros(1, np.int64)

    def _rebuild(self, now_ns: int, room: int) -> None:
        """Rebuild the table for states valid at `now_ns` and `room` more links, at most a quarter full."""
        relaxation_s = 1.0 / (1.0 / self._bursts.good_s + 1.0 / self._bursts.bad_s)
        # One relaxation time more than `bad_after` needs: rounding then cannot make a difference.
        silent_ns = math.ceil((FORGOTTEN + 1.0) * relaxation_s * NS_PER_S)
        is_valid = (self._link != NO_LINK) & (now_ns - self._at_ns <= silent_ns)
        link, at_ns, bad = self._link[is_valid], self._at_ns[is_valid], self._bad[is_valid]
        self._clear(max(1 << (4 * (len(link) + room) - 1).bit_length(), MIN_CAPACITY))
        _insert(self._link, self._at_ns, self._bad, link, at_ns, bad)
        self._links[0] = len(link)


@njit()
def _insert(links, links_at_ns, links_bad, link, at_ns, bad):
    for i in range(len(link)):
        slot = _slot(links, link[i])
        links[slot], links_at_ns[slot], links_bad[slot] = link[i], at_ns[i], bad[i]
