"""The logarithm of a bit's success by SINR, as a table: interference changes too often to work out a formula each time.

256 rows to an octave from 2^-10 to 2^12, found by the bits of the number, a straight line between two: the success of a
frame is right to 1e-3.
"""

# pyright: basic, reportUnknownMemberType=false

import math

import numpy as np
from numba import njit

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import uniform
from swarmwire.comms.kernels import kernel
from swarmwire.comms.packets import Fate
from swarmwire.comms.radio.config.phy import METHODS
from swarmwire.comms.radio.phy import dcf
from swarmwire.comms.radio.phy.event_queue import OFF_AIR, schedule
from swarmwire.comms.radio.phy.losses import taken_by, takes_none
from swarmwire.comms.radio.phy.state import ACKNOWLEDGEMENT, DATA, RECEIVING, SILENT, TURNING
from swarmwire.comms.radio.propagation.decibels import from_db
from swarmwire.comms.radio.reception.receiver import Model, Receiver, chunk_success
from swarmwire.comms.truth import NO_ROBOT

MIN_OCTAVE, MAX_OCTAVE, ROWS = -10, 12, 256
LEAST, MOST = 2.0**MIN_OCTAVE, 2.0**MAX_OCTAVE
NEVER = -100.0  # of a bit that is never right
MANY = 1000.0  # bits, so that success close to 1 keeps its digits
THRESHOLD = int(Model.THRESHOLD)
_FRACTION_BITS = np.int64(44)  # 52 bits of a double's fraction, of which 8 choose the row
_FRACTION = np.int64(2**44 - 1)
_FIRST = np.int64((1023 + MIN_OCTAVE) * ROWS)


def log_success_table(receiver: Receiver) -> FloatArray:
    """The table of a receiver; a threshold has none that would be of use."""
    octave = np.repeat(np.arange(MIN_OCTAVE, MAX_OCTAVE), ROWS)
    sinr = np.append(2.0**octave * (1.0 + np.tile(np.arange(ROWS), MAX_OCTAVE - MIN_OCTAVE) / ROWS), MOST)
    return _table(receiver, sinr)


@kernel()
def log_success(table, receiver, sinr, bits):
    """The logarithm of the probability that so many bits are right at this SINR, a ratio."""
    if receiver.model == THRESHOLD:
        return 0.0 if chunk_success(receiver, sinr, bits) > 0.0 else bits * NEVER
    if sinr >= MOST:
        return 0.0
    at = np.float64(max(sinr, LEAST)).view(np.int64)
    row = (at >> _FRACTION_BITS) - _FIRST
    share = (at & _FRACTION) * (1.0 / (1 << 44))
    return bits * (table[row] + share * (table[row + 1] - table[row]))


@njit(cache=True)
def _table(receiver, sinr):
    out = np.empty(len(sinr))
    for i in range(len(out)):
        many, one = chunk_success(receiver, sinr[i], MANY), chunk_success(receiver, sinr[i], 1.0)
        if many > 0.1:
            out[i] = math.log(many) / MANY
        else:
            out[i] = max(math.log(one), NEVER) if one > 0.0 else NEVER
    return out


# --- The outcome of a frame that was received: right, or what it was that took it.


RECEPTION, ACKNOWLEDGED = purpose("reception"), purpose("reception of an acknowledgement")
RECEIVED, TOO_WEAK, COLLIDED, JAMMED = int(Fate.RECEIVED), int(Fate.TOO_WEAK), int(Fate.COLLIDED), int(Fate.JAMMED)


@kernel()
def fate_of_frame(rules, losses, state, s, i, log_right):
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
            return RECEIVED  # it is nothing to others
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


@kernel()
def alone_log_success(rules, power_mw, bits):
    """The logarithm of the probability that a frame is right without interference."""
    if power_mw < rules.least_mw or power_mw < rules.least_sinr * rules.noise_mw:
        return bits * NEVER
    if power_mw >= rules.sure_sinr * rules.noise_mw:
        return 0.0
    return log_success(rules.log_success, rules.receiver, power_mw / rules.noise_mw, bits)


@kernel(from_python=True)
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


@kernel()
def _is_answer(state, s, r):
    """Whether the acknowledgement that robot s has on air is for robot r, which waits for it."""
    it = state.robot[r]
    return state.robot[s].answers_to == r and it.packet != NO_ROBOT and state.packet[it.packet].to == s


# --- Frames on air: who receives them, what they do to the reception of others, and how that ends.
#
# A receiver that is free locks to a frame whose preamble stands out of noise and interference; all else on air is then
# interference, until the frame ends. Success is the product over chunks of constant interference. Where frames never
# disturb one another (access "none"), every receiver hears each of them on its own.


HOPELESS = -50.0  # a logarithm below that of the least draw
ALONE = METHODS.index("none")


@kernel()
def put_on_air(rules, state, queue, s, now_ns, airtime_ns, bits):
    """The frame of robot s, `on_air`, starts; its links are those from `first_link` to `stop_link`."""
    me = state.robot[s]
    me.on_air_ns, me.airtime_ns, me.bits = now_ns, airtime_ns, bits
    schedule(queue, OFF_AIR, s, now_ns + airtime_ns)
    robot, reception, link = state.robot, state.reception, state.link
    if rules.method == ALONE:
        for i in range(me.first_link, me.weak_link):
            link[i].now = RECEIVING if link[i].fate == RECEIVED else link[i].fate
        return
    turn_away(state, s)
    dcf.sense(rules, state, queue, s, now_ns)
    first, weak, stop = np.uint64(me.first_link), np.uint64(me.weak_link), np.uint64(me.stop_link)
    for i in range(first, weak):
        if link[i].fate != RECEIVED:
            link[i].now = link[i].fate
            continue
        r = np.int64(link[i].receiver)
        it = reception[np.uint64(r)]
        count_chunk(rules, robot, it, now_ns)
        _arrive(rules, robot, it, link, s, i, now_ns)
        dcf.sense(rules, state, queue, r, now_ns)
    for i in range(weak, stop):
        r = np.int64(link[i].receiver)
        it = reception[np.uint64(r)]
        count_chunk(rules, robot, it, now_ns)
        _add(it, link[i].power_mw)
        dcf.sense(rules, state, queue, r, now_ns)


@kernel()
def take_off_air(rules, losses, state, queue, s, now_ns):
    """The frame of robot s ends: each of its links that may be told of has a fate in `now`."""
    me = state.robot[s]
    robot, reception, link = state.robot, state.reception, state.link
    if rules.method == ALONE:
        for i in range(me.first_link, me.weak_link):
            if link[i].now == RECEIVING:
                log_right = alone_log_success(rules, link[i].power_mw, me.bits)
                link[i].now = fate_of_frame(rules, losses, state, s, i, log_right)
        me.on_air = SILENT
        return
    # Nothing but noise could take a frame.
    is_sure = takes_none(losses) and me.on_air == DATA
    first, weak, stop = np.uint64(me.first_link), np.uint64(me.weak_link), np.uint64(me.stop_link)
    for i in range(first, weak):
        if link[i].fate != RECEIVED:
            continue
        r = np.int64(link[i].receiver)
        it = reception[np.uint64(r)]
        count_chunk(rules, robot, it, now_ns)
        _remove(it, link[i].power_mw)
        if (it.locked_to == s) & (it.link == np.int64(i)):
            let_go(it)
            if is_sure and it.log_success == 0.0:
                link[i].now = RECEIVED
            else:
                link[i].now = fate_of_frame(rules, losses, state, s, np.int64(i), it.log_success)
            robot[r].trust_from_ns = 0 if link[i].now == RECEIVED else now_ns + rules.distrust_ns
        dcf.sense(rules, state, queue, r, now_ns)
    for i in range(weak, stop):
        r = np.int64(link[i].receiver)
        it = reception[np.uint64(r)]
        count_chunk(rules, robot, it, now_ns)
        _remove(it, link[i].power_mw)
        dcf.sense(rules, state, queue, r, now_ns)
    me.on_air = SILENT
    reception[s].is_deaf = me.stage == TURNING
    dcf.sense(rules, state, queue, s, now_ns)


@kernel()
def turn_away(state, r):
    """Robot r does not listen any more: what it was receiving is lost to it."""
    it = state.reception[r]
    it.is_deaf = 1
    if it.locked_to != NO_ROBOT:
        state.link[it.link].now = COLLIDED
        let_go(it)


@kernel(inline="always")
def let_go(it):
    """A robot receives no frame any more."""
    it.locked_to, it.signal_mw = NO_ROBOT, np.inf


@kernel(inline="always")
def _add(it, power_mw):
    """A frame's power comes to a robot."""
    it.power_mw += power_mw
    it.signals += 1
    it.peak_mw = max(it.peak_mw, it.power_mw)


@kernel(inline="always")
def _remove(it, power_mw):
    """A frame's power goes."""
    it.signals -= 1
    it.power_mw = it.power_mw - power_mw if it.signals > 0 else 0.0  # no rounding piles up


@kernel(inline="always")
def _arrive(rules, robot, it, link, s, i, now_ns):
    """Frame s comes to a robot on link i; it locks to the frame, or takes it for noise."""
    power_mw, noise_mw = link[i].power_mw, rules.noise_mw + it.jam_mw
    could = (power_mw >= rules.least_mw) & (power_mw >= rules.least_sinr * rules.noise_mw)
    does = could & (power_mw >= rules.least_sinr * (noise_mw + it.power_mw)) & (it.is_deaf == 0)
    link[i].now = COLLIDED if could else TOO_WEAK
    if it.jam_mw > 0.0 and could and not (does or it.is_deaf) and it.locked_to == NO_ROBOT:
        would = power_mw >= rules.least_sinr * (rules.noise_mw + it.power_mw)
        link[i].now = JAMMED if would else COLLIDED
    _add(it, power_mw)
    if it.locked_to != NO_ROBOT:
        if now_ns - robot[it.locked_to].on_air_ns > rules.take_over_ns:
            does = False
        else:
            drowned = it.signal_mw < rules.least_sinr * (noise_mw + max(it.power_mw - it.signal_mw, 0.0))
            does = does and (drowned or power_mw > it.signal_mw)
            if drowned or does:
                link[it.link].now = COLLIDED
                let_go(it)
    if does:
        link[i].now = RECEIVING
        it.locked_to, it.link, it.since_ns, it.signal_mw = s, i, now_ns, power_mw
        it.log_success = it.jam_log = 0.0


@kernel(inline="always")
def count_chunk(rules, robot, it, now_ns):
    """The interference at a robot is about to change: what it received so far counts."""
    # Without a branch for robots that receive nothing, which would be guessed wrong often: their signal is infinite.
    others_mw = max(it.power_mw - it.signal_mw, 0.0) * (it.signals > 1)
    noise_mw = rules.noise_mw + it.jam_mw + others_mw
    if (it.signal_mw < rules.sure_sinr * noise_mw) & (it.log_success > HOPELESS):
        sender = robot[it.locked_to]
        bits = sender.bits * ((now_ns - it.since_ns) / sender.airtime_ns)
        log_right = log_success(rules.log_success, rules.receiver, it.signal_mw / noise_mw, bits)
        it.log_success += log_right
        if it.jam_mw > 0.0:
            sinr = it.signal_mw / (rules.noise_mw + others_mw)
            it.jam_log += log_success(rules.log_success, rules.receiver, sinr, bits) - log_right
    it.since_ns = now_ns
