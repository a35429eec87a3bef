"""Bit rates of packets to one robot: fixed, ideal, or adaptive auto rate fallback (AARF).

Ideal takes the highest MCS whose bits are wrong once in 10^6 at the last SINR that the receiver reported with a
response. AARF (M. Lacage et al., MSWiM 2004) needs no report: the rate rises after 10 successes in sequence, and falls
after two failures; if the first frame at a new rate fails, it falls at once, and twice as many successes, at most 50,
have to precede the next rise.
"""

# pyright: basic, reportUnknownMemberType=false

from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import NOWHERE
from swarmwire.comms.radio.phy.ht.params import AARF, IDEAL

MIN_SUCCESSES, MAX_SUCCESSES, FAILURES = 10, 50, 2


@kernel()
def rate_to(params, state, r, to):
    """Return the MCS of the next frame of robot r to a robot."""
    ht = params.ht
    if ht.rate_control == IDEAL and to != NOWHERE:
        rate, sinr = 0, state.ht.peer[r, to % params.robots].sinr
        for mcs in range(ht.max_rate + 1):
            if ht.min_sinr[mcs] < sinr:
                rate = mcs
        return rate
    if ht.rate_control == AARF and to != NOWHERE:
        return min(int(state.ht.peer[r, to % params.robots].rate), ht.max_rate)
    return ht.max_rate


@kernel()
def report_success(params, state, r, to, sinr):
    """Note that a robot answered robot r, which sent with this SINR."""
    peer = state.ht.peer[r, to % params.robots]
    peer.sinr = sinr
    if params.ht.rate_control != AARF:
        return
    peer.failures = peer.is_probing = 0
    peer.successes += 1
    if peer.successes >= max(peer.threshold, MIN_SUCCESSES):
        peer.successes = 0
        if peer.rate < params.ht.max_rate:
            peer.rate, peer.is_probing = peer.rate + 1, 1


@kernel()
def report_failure(params, state, r, to):
    """Note that a robot did not answer robot r, or lacks more than half of the packets of a frame."""
    if params.ht.rate_control != AARF or to == NOWHERE:
        return
    peer = state.ht.peer[r, to % params.robots]
    peer.successes = 0
    peer.failures += 1
    if peer.is_probing:
        peer.threshold = min(2 * max(peer.threshold, MIN_SUCCESSES), MAX_SUCCESSES)
    elif peer.failures >= FAILURES:
        peer.threshold = MIN_SUCCESSES
    else:
        return
    peer.failures = peer.is_probing = 0
    peer.rate = max(peer.rate - 1, 0)
