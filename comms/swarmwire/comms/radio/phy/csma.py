"""Unslotted CSMA/CA of IEEE 802.15.4: wait at random, listen, and send if the medium is free, else wait longer."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import uniform
from swarmwire.comms.kernels import kernel
from swarmwire.comms.radio.phy import reception
from swarmwire.comms.radio.phy.event_queue import LISTENED, SEND, TIMER, schedule
from swarmwire.comms.radio.phy.state import BACKING_OFF, LISTENING, SILENT, TURNING

BACKOFF = purpose("csma backoff")


@kernel()
def want(rules, state, queue, r, now_ns):
    """The robot wants to send the packet that it serves."""
    me = state.robot[r]
    me.busy_times, me.exponent = 0, rules.least_exponent
    _back_off(rules, state, queue, r, now_ns)


@kernel()
def listen(rules, state, queue, r, now_ns):
    """The backoff is over."""
    state.robot[r].stage = LISTENING
    state.reception[r].peak_mw = 0.0
    schedule(queue, LISTENED, r, now_ns + rules.listen_ns)


@kernel()
def gives_up(rules, state, queue, r, now_ns):
    """The radio has listened: it sends, or backs off anew, or gives up (True), if the medium was busy too often.

    As in ns-3, it is busy if a frame began meanwhile or is on air at the end; one that ended meanwhile does not count.
    """
    me, it = state.robot[r], state.reception[r]
    if max(it.peak_mw, it.power_mw) + it.jam_mw < rules.busy_mw and me.on_air == SILENT:
        me.stage = TURNING
        reception.turn_away(state, r)
        schedule(queue, SEND, r, now_ns + rules.turnaround_ns)
        return False
    me.busy_times += 1
    me.exponent = min(me.exponent + 1, rules.most_exponent)
    if me.busy_times > rules.most_backoffs:
        return True
    _back_off(rules, state, queue, r, now_ns)
    return False


@kernel()
def _back_off(rules, state, queue, r, now_ns):
    """Wait U{0 .. 2^BE - 1} backoff periods, keyed by (robot, sequence, attempt and busy times)."""
    me = state.robot[r]
    me.stage = BACKING_OFF
    sequence, attempt = state.packet[me.packet].sequence, 16 * me.attempt + me.busy_times
    u = uniform(state.keys[r // rules.robots], r % rules.robots, sequence, attempt, BACKOFF)
    schedule(queue, TIMER, r, now_ns + np.int64(u * 2**me.exponent) * rules.backoff_ns)
