"""Bursts: a link changes between a good and a bad state and loses a share of its packets in either.

The chain of E. N. Gilbert (Bell Syst. Tech. J. 39, 1960) and E. O. Elliott (42, 1963) in continuous time, so that a
burst lasts as long however often robots speak: good turns bad at rate a, bad turns good at rate b, and

    P(bad at t + dt) = pi + (bad at t - pi) exp(-(a + b) dt),     pi = a / (a + b).
"""

# pyright: basic, reportUnknownMemberType=false

import math
from dataclasses import dataclass

from numba import njit

from swarmwire.comms.parameters import parameter

# Beyond this many relaxation times 1 / (a + b) the past counts for nothing: exp(-40) is lost in a draw's 53 bits.
FORGOTTEN = 40.0


@dataclass(frozen=True)
class Bursts:
    """How long bad and good spells last, and what they lose."""

    bad_s: float = parameter(0.5, help="mean duration of a burst: 1 / b", unit="s", above=0, at_most=1e6)
    good_s: float = parameter(10.0, help="mean time between bursts: 1 / a", unit="s", above=0, at_most=1e6)
    loss_bad: float = parameter(1.0, help="probability that a packet is lost in a burst", at_least=0, at_most=1)
    loss_good: float = parameter(0.0, help="probability that a packet is lost otherwise", at_least=0, at_most=1)

    @property
    def bad_share(self) -> float:
        """The share of time that is bad: pi."""
        return self.bad_s / (self.bad_s + self.good_s)

    @property
    def loss(self) -> float:
        """The share of packets that are lost in the long run."""
        return self.bad_share * self.loss_bad + (1.0 - self.bad_share) * self.loss_good


def bursts_from_steps(p: float, r: float, loss_bad: float, loss_good: float, interval_s: float) -> Bursts:
    """The chain that packets `interval_s` apart see as the one of netem's `gemodel p r 1-h 1-k`; needs p + r < 1.

    p and r are the probabilities from one packet to the next that good turns bad and bad good: (a + b) interval =
    -ln(1 - p - r), and a / b = p / r.
    """
    relaxation_s = -interval_s / math.log1p(-(p + r))
    return Bursts(relaxation_s * (p + r) / r, relaxation_s * (p + r) / p, loss_bad, loss_good)


@njit(cache=True)
def bad_after(was_bad, dt_s, a, b, u):
    """Whether a link is bad `dt_s` after it was in a known state; rates a and b in 1/s, u uniform in [0, 1).

    dt_s = inf is the stationary state, and so is anything beyond `FORGOTTEN` relaxation times.
    """
    share = a / (a + b)
    elapsed = (a + b) * dt_s
    if elapsed >= FORGOTTEN:
        return u < share
    return u < share + ((1.0 if was_bad else 0.0) - share) * math.exp(-elapsed)
