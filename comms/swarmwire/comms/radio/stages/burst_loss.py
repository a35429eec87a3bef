"""Burst loss: a link changes between a good and a bad state and loses a share of its packets in either.

The chain of E. N. Gilbert (Bell Syst. Tech. J. 39, 1960) and E. O. Elliott (42, 1963) in continuous time, so that a
burst's duration does not depend on the packet rate: good turns bad at rate a, bad turns good at rate b, and

    P(bad at t + dt) = pi + (bad at t - pi) exp(-(a + b) |dt|),     pi = a / (a + b).

A chain of two states is reversible, so the same holds for dt < 0. That is needed where both directions of a link share
a state (`symmetric`): within a tick, packets of different senders are not in the order of their times.
"""

# pyright: basic, reportUnknownMemberType=false

import math
from typing import Any, ClassVar

import numpy as np

from swarmwire.comms.base.arrays import Table, record_type
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


# The state of a link in the hash table.
LINK_STATE = record_type(
    [
        ("link", np.int64),  # one end x rows + the other, or NO_LINK
        ("at_ns", np.int64),  # time of its state: that of its latest frame
        ("is_bad", np.bool_),
    ]
)
NO_STATES: Table = np.empty(0, LINK_STATE)


@njit()
def _slot(states, link):
    """Return the slot of a link in the table, or the empty slot for it."""
    mask = np.uint64(len(states) - 1)
    # The upper half of the product depends on all bits of the link, its lowest bits on the lowest ones alone.
    slot = ((np.uint64(link) * HASH_FACTOR) >> np.uint64(32)) & mask
    while states[slot].link != NO_LINK and states[slot].link != link:
        slot = (slot + np.uint64(1)) & mask
    return slot


@kernel()
def burst_loss(params, states, frame):
    """Return BURST by the link's state, which changes with the time since its last frame."""
    if not params.is_used:
        return UNDER_WAY
    a, b = frame.sender, frame.receiver
    if params.symmetric:
        a, b = min(a, b), max(a, b)
    link = a * params.rows + b
    state, silent_s = states[_slot(states, link)], np.inf
    if state.link == NO_LINK:
        state.link = link
    else:
        silent_s = abs(frame.at_ns - state.at_ns) / NS_PER_S
    u = loss_uniform(frame, STATE, ACK_STATE)
    is_bad = bad_after(state.is_bad, silent_s, params.a, params.b, u)
    if frame.at_ns >= state.at_ns:
        state.at_ns, state.is_bad = frame.at_ns, is_bad
    loss = params.loss_bad if is_bad else params.loss_good
    return BURST if loss_uniform(frame, LOSS, ACK_LOSS) < loss else UNDER_WAY


class BurstLoss(FrameLoss):
    """The Gilbert-Elliott chain in continuous time, for each directed link, or for both directions of a link together.

    The states are in a hash table by sender and receiver row, with open addressing, at most half full. Links that were
    silent for so long that their past has no effect are dropped, which changes no fate.
    """

    name = "burst_loss"
    keys = ("bursts",)
    has_state = True
    FIELDS: ClassVar = [
        ("is_used", np.bool_),
        ("symmetric", np.bool_),  # True: both directions of a link share a state
        ("rows", np.int64),  # number of robots of all arenas
        ("a", np.float64),  # rate in 1/s at which good turns bad
        ("b", np.float64),  # rate in 1/s at which bad turns good
        ("loss_bad", np.float64),
        ("loss_good", np.float64),
    ]

    @classmethod
    def create(cls, context: ChannelContext) -> FrameLoss | None:
        """Return the loss if the radio has bursts."""
        bursts = context.radio.bursts
        return None if bursts is None else BurstLoss(bursts, context.rows)

    def __init__(self, bursts: Bursts, rows: int) -> None:
        """Create a table without links; `rows` is the number of robots of all arenas."""
        self._bursts, self._rows = bursts, rows
        self._states, self._most_links = _no_links(MIN_CAPACITY), 0

    def __len__(self) -> int:
        """Number of links in the table."""
        return int(np.count_nonzero(self._states["link"] != NO_LINK))

    def write(self, params: Any) -> None:
        """Set the parameters of the chain."""
        bursts = self._bursts
        params.is_used, params.symmetric, params.rows = True, bursts.symmetric, self._rows
        params.a, params.b = 1.0 / bursts.good_s, 1.0 / bursts.bad_s
        params.loss_bad, params.loss_good = bursts.loss_bad, bursts.loss_good

    def reserve(self, from_ns: int, links: int) -> Table:
        """Return the table, with room for `links` more links, for frames at `from_ns` or later."""
        self._most_links += links  # a bound: most links are in the table already, so they are counted before it grows
        if 2 * self._most_links > len(self._states):
            self._most_links = len(self) + links
            if 2 * self._most_links > len(self._states):
                self._rebuild(from_ns, links)
        return self._states

    @property
    def passing(self) -> float:
        """1 - long-run loss."""
        return 1.0 - self._bursts.loss

    def continue_from(self, previous: FrameLoss, at_ns: int) -> None:
        """Keep the state of all links."""
        assert isinstance(previous, BurstLoss)
        # Drop outdated states now: slower bursts must not depend on outdated states that happen to be in the table.
        previous._rebuild(at_ns, 0)
        self._states, self._most_links = previous._states, previous._most_links

    def _rebuild(self, now_ns: int, room: int) -> None:
        """Rebuild the table for states valid at `now_ns` and `room` more links, at most a quarter full."""
        relaxation_s = 1.0 / (1.0 / self._bursts.good_s + 1.0 / self._bursts.bad_s)
        # One relaxation time more than `bad_after` needs: rounding then cannot make a difference.
        silent_ns = math.ceil((FORGOTTEN + 1.0) * relaxation_s * NS_PER_S)
        states = self._states
        valid = states[(states["link"] != NO_LINK) & (now_ns - states["at_ns"] <= silent_ns)]
        self._most_links = len(valid) + room
        self._states = _no_links(max(1 << (4 * self._most_links - 1).bit_length(), MIN_CAPACITY))
        _insert(self._states, valid)


def _no_links(capacity: int) -> Table:
    states: Table = np.zeros(capacity, LINK_STATE)
    states["link"] = NO_LINK
    return states


@njit()
def _insert(states, new):
    for k in range(len(new)):
        states[_slot(states, new[k].link)] = new[k]
