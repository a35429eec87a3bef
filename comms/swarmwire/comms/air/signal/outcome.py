"""The outcome of a frame that was received: right, or what it was that took it."""

# pyright: basic, reportUnknownMemberType=false

import math

import numpy as np
from numba import njit

from swarmwire.comms.air.decibels import from_db
from swarmwire.comms.air.fixed_loss import LOSS
from swarmwire.comms.air.reception.burst_states import takes
from swarmwire.comms.air.signal.log_success import NEVER, log_success
from swarmwire.comms.air.signal.tables import ACKNOWLEDGEMENT, DATA, NOBODY
from swarmwire.comms.air.trace import TRACE
from swarmwire.comms.borrowing import borrowing
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import uniform
from swarmwire.comms.fates import Fate

RECEPTION, ACKNOWLEDGED = purpose("reception"), purpose("reception of an acknowledgement")
ACKNOWLEDGED_LOSS = purpose("fixed loss of an acknowledgement")
ACKNOWLEDGED_TRACE = purpose("trace of an acknowledgement")
HEARD, LOST, TOO_WEAK = int(Fate.HEARD), int(Fate.LOST), int(Fate.TOO_WEAK)
COLLIDED, BURST, JAMMED = int(Fate.COLLIDED), int(Fate.BURST), int(Fate.JAMMED)


@borrowing()
def outcome(rules, bursts, state, s, i, log_right):
    """What becomes of the frame that robot s has on air, on link i, if it is right with this probability's logarithm.

    By draws keyed by (sender, receiver, sequence), and attempt. The same draw tells why it was not right: COLLIDED if
    it would have been right without interference, JAMMED if without jammers alone.
    """
    me = state.robot[s]
    receiver = state.link.receiver[i]
    key, a, b = state.keys[s // rules.robots], s % rules.robots, receiver % rules.robots
    if me.on_air == ACKNOWLEDGEMENT:
        if not _is_answer(state, s, receiver):
            return HEARD  # it is nothing to others
        it = state.robot[receiver]
        sequence, attempt = state.packet[it.packet].sequence, it.attempt
        reception, fixed_loss, trace = ACKNOWLEDGED, ACKNOWLEDGED_LOSS, ACKNOWLEDGED_TRACE
    else:
        sequence, attempt = state.packet[me.packet].sequence, me.attempt
        reception, fixed_loss, trace = RECEPTION, LOSS, TRACE
    u = uniform(key, a, b, sequence, reception + attempt)
    if u >= math.exp(log_right):
        if u < math.exp(log_right + state.reception[receiver].jam_log):
            return JAMMED
        alone = math.exp(alone_log_success(rules, state.link.power_mw[i], me.bits))
        return COLLIDED if u < alone else TOO_WEAK
    if rules.loss > 0.0 and uniform(key, a, b, sequence, fixed_loss + attempt) < rules.loss:
        return LOST
    if len(state.traced.link) > 0:
        ratio = _ratio(state.traced, a * rules.robots + b)
        if ratio < 1.0 and uniform(key, a, b, sequence, trace + attempt) >= ratio:
            return LOST
    if bursts.is_on and me.on_air == DATA:
        index = s * np.int64(len(state.robot)) + receiver
        burst, added = takes(
            bursts.link,
            bursts.at_ns,
            bursts.bad,
            index,
            key,
            a,
            b,
            sequence,
            attempt,
            me.on_air_ns,
            bursts.a,
            bursts.b,
            bursts.loss_bad,
            bursts.loss_good,
        )
        bursts.added[0] += added
        if burst:
            return BURST
    return HEARD


@borrowing()
def alone_log_success(rules, power_mw, bits):
    """The logarithm of the probability that a frame is right without interference."""
    if power_mw < rules.least_mw or power_mw < rules.least_sinr * rules.noise_mw:
        return bits * NEVER
    if power_mw >= rules.sure_sinr * rules.noise_mw:
        return 0.0
    return log_success(rules.log_success, rules.receiver, power_mw / rules.noise_mw, bits)


@borrowing(from_python=True)
def lone_delivery(rules, mean_dbm, bits):
    """The probability that a lone frame of so many bits is right at this power."""
    return math.exp(alone_log_success(rules, from_db(mean_dbm), bits))


@njit(cache=True)
def lone_deliveries(rules, mean_dbm, bits):
    """The same at several powers, (k,)."""
    found = np.empty(len(mean_dbm))
    for i in range(len(found)):
        found[i] = lone_delivery(rules, mean_dbm[i], bits)
    return found


@borrowing()
def _ratio(traced, link):
    """The delivery ratio of a link (indices in the arena: sender x robots + receiver); 1 where none was measured."""
    low, high = 0, len(traced.link)
    while low < high:
        middle = (low + high) // 2
        if traced.link[middle] < link:
            low = middle + 1
        else:
            high = middle
    return traced.ratio[low] if low < len(traced.link) and traced.link[low] == link else 1.0


@borrowing()
def _is_answer(state, s, r):
    """Whether the acknowledgement that robot s has on air is for robot r, which waits for it."""
    it = state.robot[r]
    return state.robot[s].answers_to == r and it.packet != NOBODY and state.packet[it.packet].to == s
