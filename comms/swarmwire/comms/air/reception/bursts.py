"""Bursts: a link changes between a good and a bad state and loses a share of its packets in either.

The chain of E. N. Gilbert (Bell Syst. Tech. J. 39, 1960) and E. O. Elliott (42, 1963) in continuous time, so that a
burst lasts as long however often robots speak: good turns bad at rate a, bad turns good at rate b, and

    P(bad at t + dt) = pi + (bad at t - pi) exp(-(a + b) dt),     pi = a / (a + b).
"""

# pyright: basic, reportUnknownMemberType=false

import math

from numba import njit

# Beyond this many relaxation times 1 / (a + b) the past counts for nothing: exp(-40) is lost in a draw's 53 bits.
FORGOTTEN = 40.0


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
