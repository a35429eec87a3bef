"""Frames on air: who receives them, what they do to the reception of others, and how that ends.

A receiver that is free locks to a frame whose preamble stands out of noise and interference; all else on air is then
interference, until the frame ends. Success is the product over chunks of constant interference. Where frames never
disturb one another (access "none"), every receiver hears each of them on its own.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.air.parameters.access import METHODS
from swarmwire.comms.air.signal import dcf
from swarmwire.comms.air.signal.event_queue import OFF_AIR, schedule
from swarmwire.comms.air.signal.frame_fate import alone_log_success, outcome
from swarmwire.comms.air.signal.log_success import log_success
from swarmwire.comms.air.signal.losses import takes_none
from swarmwire.comms.air.signal.tables import DATA, RECEIVING, SILENT, TURNING
from swarmwire.comms.borrowing import borrowing
from swarmwire.comms.fates import Fate
from swarmwire.comms.truth import NOBODY

HEARD, TOO_WEAK, COLLIDED, JAMMED = int(Fate.HEARD), int(Fate.TOO_WEAK), int(Fate.COLLIDED), int(Fate.JAMMED)
HOPELESS = -50.0  # a logarithm below that of the least draw
ALONE = METHODS.index("none")


@borrowing()
def put_on_air(rules, state, queue, s, now_ns, airtime_ns, bits):
    """The frame of robot s, `on_air`, starts; its links are those from `first_link` to `stop_link`."""
    me = state.robot[s]
    me.on_air_ns, me.airtime_ns, me.bits = now_ns, airtime_ns, bits
    schedule(queue, OFF_AIR, s, now_ns + airtime_ns)
    robot, reception, link = state.robot, state.reception, state.link
    if rules.method == ALONE:
        for i in range(me.first_link, me.weak_link):
            link[i].now = RECEIVING if link[i].fate == HEARD else link[i].fate
        return
    turn_away(state, s)
    dcf.sense(rules, state, queue, s, now_ns)
    first, weak, stop = np.uint64(me.first_link), np.uint64(me.weak_link), np.uint64(me.stop_link)
    for i in range(first, weak):
        if link[i].fate != HEARD:
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


@borrowing()
def take_off_air(rules, losses, state, queue, s, now_ns):
    """The frame of robot s ends: each of its links that may be told of has a fate in `now`."""
    me = state.robot[s]
    robot, reception, link = state.robot, state.reception, state.link
    if rules.method == ALONE:
        for i in range(me.first_link, me.weak_link):
            if link[i].now == RECEIVING:
                log_right = alone_log_success(rules, link[i].power_mw, me.bits)
                link[i].now = outcome(rules, losses, state, s, i, log_right)
        me.on_air = SILENT
        return
    # Nothing but noise could take a frame.
    is_sure = takes_none(losses) and me.on_air == DATA
    first, weak, stop = np.uint64(me.first_link), np.uint64(me.weak_link), np.uint64(me.stop_link)
    for i in range(first, weak):
        if link[i].fate != HEARD:
            continue
        r = np.int64(link[i].receiver)
        it = reception[np.uint64(r)]
        count_chunk(rules, robot, it, now_ns)
        _remove(it, link[i].power_mw)
        if (it.locked_to == s) & (it.link == np.int64(i)):
            let_go(it)
            if is_sure and it.log_success == 0.0:
                link[i].now = HEARD
            else:
                link[i].now = outcome(rules, losses, state, s, np.int64(i), it.log_success)
            robot[r].trust_from_ns = 0 if link[i].now == HEARD else now_ns + rules.distrust_ns
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


@borrowing()
def turn_away(state, r):
    """Robot r does not listen any more: what it was receiving is lost to it."""
    it = state.reception[r]
    it.is_deaf = 1
    if it.locked_to != NOBODY:
        state.link[it.link].now = COLLIDED
        let_go(it)


@borrowing(inline="always")
def let_go(it):
    """A robot receives no frame any more."""
    it.locked_to, it.signal_mw = NOBODY, np.inf


@borrowing(inline="always")
def _add(it, power_mw):
    """A frame's power comes to a robot."""
    it.power_mw += power_mw
    it.signals += 1
    it.peak_mw = max(it.peak_mw, it.power_mw)


@borrowing(inline="always")
def _remove(it, power_mw):
    """A frame's power goes."""
    it.signals -= 1
    it.power_mw = it.power_mw - power_mw if it.signals > 0 else 0.0  # no rounding piles up


@borrowing(inline="always")
def _arrive(rules, robot, it, link, s, i, now_ns):
    """Frame s comes to a robot on link i; it locks to the frame, or takes it for noise."""
    power_mw, noise_mw = link[i].power_mw, rules.noise_mw + it.jam_mw
    could = (power_mw >= rules.least_mw) & (power_mw >= rules.least_sinr * rules.noise_mw)
    does = could & (power_mw >= rules.least_sinr * (noise_mw + it.power_mw)) & (it.is_deaf == 0)
    link[i].now = COLLIDED if could else TOO_WEAK
    if it.jam_mw > 0.0 and could and not (does or it.is_deaf) and it.locked_to == NOBODY:
        would = power_mw >= rules.least_sinr * (rules.noise_mw + it.power_mw)
        link[i].now = JAMMED if would else COLLIDED
    _add(it, power_mw)
    if it.locked_to != NOBODY:
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


@borrowing(inline="always")
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
