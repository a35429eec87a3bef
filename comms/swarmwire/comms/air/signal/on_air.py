"""Frames on air: who receives them, what they do to the reception of others, and how that ends.

A receiver that is free locks to a frame whose preamble stands out of noise and interference; all else on air is then
interference, until the frame ends. Success is the product over chunks of constant interference. Where frames never
disturb one another (access "none"), every receiver hears each of them on its own.
"""

# pyright: basic, reportUnknownMemberType=false

import math

import numpy as np
from numba import njit

from swarmwire.comms.air.decibels import from_db
from swarmwire.comms.air.fixed_loss import LOSS
from swarmwire.comms.air.reception.burst_states import takes
from swarmwire.comms.air.signal import dcf
from swarmwire.comms.air.signal.event_queue import OFF_AIR, schedule
from swarmwire.comms.air.signal.log_success import log_success
from swarmwire.comms.air.signal.parameters import METHODS
from swarmwire.comms.air.signal.tables import ACKNOWLEDGEMENT, DATA, NOBODY, RECEIVING, SILENT, TURNING
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import uniform
from swarmwire.comms.fates import Fate

RECEPTION, ACKNOWLEDGED = purpose("reception"), purpose("reception of an acknowledgement")
ACKNOWLEDGED_LOSS = purpose("fixed loss of an acknowledgement")
HEARD, LOST, TOO_WEAK = int(Fate.HEARD), int(Fate.LOST), int(Fate.TOO_WEAK)
COLLIDED, BURST = int(Fate.COLLIDED), int(Fate.BURST)
HOPELESS = -50.0  # a logarithm below that of the least draw
ALONE, DCF = METHODS.index("none"), METHODS.index("dcf")


@njit(cache=True)
def put_on_air(rules, state, queue, s, kind, now_ns, airtime_ns, bits):
    """The frame of robot s starts; its links are those from `first_link` to `stop_link`."""
    me = state.robot[s]
    me.on_air, me.on_air_ns, me.airtime_ns, me.bits = kind, now_ns, airtime_ns, bits
    schedule(queue, OFF_AIR, s, now_ns + airtime_ns)
    if rules.method == ALONE:
        for i in range(me.first_link, me.stop_link):
            state.link[i].now = RECEIVING if state.link[i].fate == HEARD else state.link[i].fate
        return
    turn_away(state, s)
    if rules.method == DCF:
        dcf.sense(rules, state, queue, s, now_ns)
    robots, links = state.robot, state.link  # once: each look into `state` counts references
    for i in range(me.first_link, me.stop_link):
        link = links[i]
        if link.fate == HEARD:
            _arrive(rules, robots, links, s, i, now_ns)
            if rules.method == DCF:
                dcf.sense(rules, state, queue, link.receiver, now_ns)
        else:
            link.now = link.fate


@njit(cache=True)
def turn_away(state, r):
    """Robot r does not listen any more: what it was receiving is lost to it."""
    me = state.robot[r]
    if me.locked_to != NOBODY:
        state.link[me.link].now = COLLIDED
        me.locked_to = NOBODY


@njit(cache=True)
def take_off_air(rules, bursts, state, queue, s, now_ns):
    """The frame of robot s ends: each of its links has a fate in `now`."""
    me = state.robot[s]
    robots, links = state.robot, state.link
    for i in range(me.first_link, me.stop_link):
        link = links[i]
        if rules.method == ALONE:
            if link.now == RECEIVING:
                success = _alone(rules, link.power_mw, me.bits)
                link.now = _fate(rules, bursts, state, s, i, success)
        elif link.fate == HEARD:
            if _leave(rules, robots, links, s, i, now_ns):
                it = robots[link.receiver]
                link.now = _fate(rules, bursts, state, s, i, math.exp(it.log_success))
                it.trust_from_ns = 0 if link.now == HEARD else now_ns + rules.distrust_ns
            if rules.method == DCF:
                dcf.sense(rules, state, queue, link.receiver, now_ns)
    me.on_air = SILENT
    if rules.method == DCF:
        dcf.sense(rules, state, queue, s, now_ns)


@njit(cache=True, inline="always")
def _arrive(rules, robots, links, s, i, now_ns):
    """A frame reaches a receiver, which locks to it or takes it for noise."""
    link = links[i]
    it = robots[link.receiver]
    _count_chunk(rules, robots, link.receiver, now_ns)
    others_mw = it.power_mw
    it.power_mw += link.power_mw
    it.signals += 1
    it.peak_mw = max(it.peak_mw, it.power_mw)
    could = link.power_mw >= rules.least_mw and link.power_mw >= rules.least_sinr * rules.noise_mw
    does = could and link.power_mw >= rules.least_sinr * (rules.noise_mw + others_mw)
    link.now = COLLIDED if could else TOO_WEAK
    if it.on_air != SILENT or it.stage == TURNING:
        return
    if it.locked_to != NOBODY:
        if now_ns - robots[it.locked_to].on_air_ns > rules.take_over_ns:
            return
        drowned = it.signal_mw < rules.least_sinr * (rules.noise_mw + max(it.power_mw - it.signal_mw, 0.0))
        if not drowned and not (does and link.power_mw > it.signal_mw):
            return
        links[it.link].now = COLLIDED
        it.locked_to = NOBODY
    if does:
        link.now = RECEIVING
        it.locked_to, it.link, it.since_ns, it.signal_mw, it.log_success = s, i, now_ns, link.power_mw, 0.0


@njit(cache=True, inline="always")
def _leave(rules, robots, links, s, i, now_ns):
    """A frame ends at a receiver; whether it was receiving this one."""
    link = links[i]
    it = robots[link.receiver]
    _count_chunk(rules, robots, link.receiver, now_ns)
    it.signals -= 1
    it.power_mw = it.power_mw - link.power_mw if it.signals > 0 else 0.0  # no rounding piles up
    if it.locked_to != s or it.link != i:
        return False
    it.locked_to = NOBODY
    return True


@njit(cache=True, inline="always")
def _count_chunk(rules, robots, r, now_ns):
    """The interference at a robot is about to change: what it received so far counts."""
    it = robots[r]
    if it.locked_to == NOBODY or now_ns == it.since_ns:
        return
    noise_mw = rules.noise_mw
    if it.signals > 1:
        noise_mw += max(it.power_mw - it.signal_mw, 0.0)
    if it.signal_mw < rules.sure_sinr * noise_mw and it.log_success > HOPELESS:
        sender = robots[it.locked_to]
        bits = sender.bits * ((now_ns - it.since_ns) / sender.airtime_ns)
        it.log_success += log_success(rules.log_success, rules.receiver, it.signal_mw / noise_mw, bits)
    it.since_ns = now_ns


@njit(cache=True)
def delivery_of(rules, mean_dbm, bits):
    """The probability that lone frames of so many bits are right at these powers, (k,)."""
    out = np.empty(len(mean_dbm))
    for i in range(len(out)):
        out[i] = _alone(rules, from_db(mean_dbm[i]), bits)
    return out


@njit(cache=True)
def _alone(rules, power_mw, bits):
    """The probability that a frame is right without interference."""
    if power_mw < rules.least_mw or power_mw < rules.least_sinr * rules.noise_mw:
        return 0.0
    if power_mw >= rules.sure_sinr * rules.noise_mw:
        return 1.0
    return math.exp(log_success(rules.log_success, rules.receiver, power_mw / rules.noise_mw, bits))


@njit(cache=True)
def _fate(rules, bursts, state, s, i, success):
    """What becomes of a frame that was received, by draws keyed by (sender, receiver, sequence), and attempt.

    The same draw tells why it was not right: COLLIDED if it would have been right without interference.
    """
    me, link = state.robot[s], state.link[i]
    key, a, b = state.keys[s // rules.robots], s % rules.robots, link.receiver % rules.robots
    if me.on_air == ACKNOWLEDGEMENT:
        if not _is_answer(state, s, link.receiver):
            return HEARD  # it is nothing to others
        it = state.robot[link.receiver]
        sequence, attempt = state.packet[it.packet].sequence, it.attempt
        reception, fixed_loss = ACKNOWLEDGED, ACKNOWLEDGED_LOSS
    else:
        sequence, attempt = state.packet[me.packet].sequence, me.attempt
        reception, fixed_loss = RECEPTION, LOSS
    u = uniform(key, a, b, sequence, reception + attempt)
    if u >= success:
        return COLLIDED if u < _alone(rules, link.power_mw, me.bits) else TOO_WEAK
    if rules.loss > 0.0 and uniform(key, a, b, sequence, fixed_loss + attempt) < rules.loss:
        return LOST
    if bursts.is_on and me.on_air == DATA:
        index = s * np.int64(len(state.robot)) + link.receiver
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


@njit(cache=True)
def _is_answer(state, s, r):
    """Whether the acknowledgement that robot s has on air is for robot r, which waits for it."""
    it = state.robot[r]
    return state.robot[s].answers_to == r and it.packet != NOBODY and state.packet[it.packet].to == s
