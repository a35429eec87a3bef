"""The outcome of a frame that was received: right, or what it was that took it."""

# pyright: basic, reportUnknownMemberType=false

import math

import numpy as np
from numba import njit

from swarmwire.comms.air.decibels import from_db
from swarmwire.comms.air.signal.log_success import NEVER, log_success
from swarmwire.comms.air.signal.losses import taken_by
from swarmwire.comms.air.signal.tables import ACKNOWLEDGEMENT
from swarmwire.comms.borrowing import borrowing
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import uniform
from swarmwire.comms.fates import Fate
from swarmwire.comms.truth import NOBODY

RECEPTION, ACKNOWLEDGED = purpose("reception"), purpose("reception of an acknowledgement")
HEARD, TOO_WEAK, COLLIDED, JAMMED = int(Fate.HEARD), int(Fate.TOO_WEAK), int(Fate.COLLIDED), int(Fate.JAMMED)


@borrowing()
def outcome(rules, losses, state, s, i, log_right):
    """What becomes of the frame that robot s has on air, on link i, if it is right with this probability's logarithm.

    By draws keyed by (sender, receiver, sequence), and attempt. The same draw tells why it was not right: COLLIDED if
    it would have been right without interference, JAMMED if without jammers alone.
    """
    me = state.robot[s]
    receiver = np.int64(state.link[i].receiver)
    key, a, b = state.keys[s // rules.robots], s % rules.robots, receiver % rules.robots
    is_answer = me.on_air == ACKNOWLEDGEMENT
    if is_answer:
        if not _is_answer(state, s, receiver):
            return HEARD  # it is nothing to others
        it = state.robot[receiver]
        sequence, attempt, reception = state.packet[it.packet].sequence, it.attempt, ACKNOWLEDGED
    else:
        sequence, attempt, reception = state.packet[me.packet].sequence, me.attempt, RECEPTION
    u = uniform(key, a, b, sequence, reception + attempt)
    if u >= math.exp(log_right):
        if u < math.exp(log_right + state.reception[receiver].jam_log):
            return JAMMED
        alone = math.exp(alone_log_success(rules, state.link[i].power_mw, me.bits))
        return COLLIDED if u < alone else TOO_WEAK
    link = s * np.int64(len(state.robot)) + receiver
    return taken_by(losses, key, rules.robots, link, a, b, sequence, attempt, is_answer, me.on_air_ns)


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
def _is_answer(state, s, r):
    """Whether the acknowledgement that robot s has on air is for robot r, which waits for it."""
    it = state.robot[r]
    return state.robot[s].answers_to == r and it.packet != NOBODY and state.packet[it.packet].to == s
