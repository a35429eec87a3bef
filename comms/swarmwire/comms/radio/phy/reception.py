"""Reception in the PHY: preamble detection, capture, interference and the fate of each frame.

A free receiver locks to a frame whose preamble is strong enough for noise and interference. All other frames on air are
then interference until that frame ends. Success is the product over chunks of constant interference. If frames never
interfere (access "none"), a receiver receives each frame as if it were alone.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.draws_compiled import uniform
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.comms.base.sentinels import NO_PACKET, NO_ROBOT, UNDER_WAY
from swarmwire.comms.radio.config.phy import METHODS
from swarmwire.comms.radio.phy import dcf
from swarmwire.comms.radio.phy.event_queue import OFF_AIR, schedule
from swarmwire.comms.radio.phy.ht import decoding
from swarmwire.comms.radio.phy.state import ACKNOWLEDGEMENT, DATA, RECEIVING, SILENT, TURNAROUND
from swarmwire.comms.radio.phy.success import alone_log_success, log_success
from swarmwire.comms.radio.stages.link_draws import ReceivedFrame
from swarmwire.comms.radio.stages.losses import frame_fate
from swarmwire.comms.robot.packets import Fate

RECEPTION, ACKNOWLEDGED = purpose("reception"), purpose("reception of an acknowledgement")
RECEIVED, TOO_WEAK, COLLIDED, JAMMED = int(Fate.RECEIVED), int(Fate.TOO_WEAK), int(Fate.COLLIDED), int(Fate.JAMMED)


@kernel()
def fate_of_frame(ht, params, losses, state, s, i, frame_log_success):
    """Return the fate on link i of the frame of robot s; `frame_log_success` is the log of its success.

    Draws are keyed by (sender, receiver, sequence) and attempt. The same draw decides the drop reason: COLLIDED if the
    frame would have succeeded without interference, JAMMED if it would have succeeded without jammers alone. `ht` is
    `state.ht`.
    """
    if ht is not None:
        return decoding.fate_of_frame(params, losses, state, s, i)
    sender = state.robot[s]
    receiver = np.int64(state.link[i].receiver)
    key, a, b = state.keys[s // params.robots], s % params.robots, receiver % params.robots
    is_ack = sender.on_air == ACKNOWLEDGEMENT
    if is_ack:
        # Under DCF all robots decode it, since EIFS follows a frame with errors.
        if not _is_expected_ack(state, s) or (receiver != sender.to and params.method != dcf.DCF):
            return RECEIVED
        data_sender = state.robot[sender.to]
        sequence, attempt = state.packet[data_sender.packet].sequence, data_sender.attempt
        draw_purpose = ACKNOWLEDGED
    else:
        sequence, attempt, draw_purpose = sender.sequence, sender.attempt, RECEPTION
    u = uniform(key, a, b, sequence, draw_purpose + attempt)
    # exp(x) is at least 1 + x: most frames need no exponential.
    if u >= 1.0 + frame_log_success and u >= math_compiled.exp(frame_log_success):
        if u < math_compiled.exp(frame_log_success + state.reception[receiver].jam_log):
            return JAMMED
        alone = math_compiled.exp(alone_log_success(params, state.link[i].power_mw, sender.bits, sender.rate))
        return COLLIDED if u < alone else TOO_WEAK
    frame = ReceivedFrame(
        key, s, receiver, a, b, sequence, attempt, is_ack, sender.on_air_ns, losses.params[0].trace_ns
    )
    return frame_fate(losses, frame)


@kernel()
def _is_expected_ack(state, s):
    """Return True if the robot to which robot s has an acknowledgement on air expects it."""
    rx = state.robot[state.robot[s].to]
    return rx.packet != NO_PACKET and state.packet[rx.packet].to == s


LOG_HOPELESS = -50.0  # less than the logarithm of the smallest draw
WITHOUT_INTERFERENCE = METHODS.index("none")


@kernel()
def start_frame(params, state, events, s, now_ns, airtime_ns, bits):
    """Start the frame of robot s on its links `first_link` to `stop_link`."""
    sender = state.robot[s]
    sender.on_air_ns, sender.airtime_ns, sender.bits = now_ns, airtime_ns, bits
    schedule(events, OFF_AIR, s, now_ns + airtime_ns)
    robot, reception, link = state.robot, state.reception, state.link
    if params.method == WITHOUT_INTERFERENCE:
        for i in range(sender.first_link, sender.weak_link):
            link[i].frame_fate = RECEIVING if link[i].fate == UNDER_WAY else link[i].fate
        return
    stop_receiving(state, s)
    dcf.sense(params, state, events, s, now_ns)
    first, weak, stop = np.uint64(sender.first_link), np.uint64(sender.weak_link), np.uint64(sender.stop_link)
    for i in range(first, weak):
        if link[i].fate != UNDER_WAY:
            link[i].frame_fate = link[i].fate
            continue
        r = np.int64(link[i].receiver)
        rx = reception[np.uint64(r)]
        end_chunk(state.ht, params, robot, rx, r, now_ns)
        _arrive(params, robot, rx, link, s, i, now_ns)
        dcf.sense(params, state, events, r, now_ns)
    for i in range(weak, stop):
        r = np.int64(link[i].receiver)
        rx = reception[np.uint64(r)]
        end_chunk(state.ht, params, robot, rx, r, now_ns)
        _add(rx, link[i].power_mw)
        dcf.sense(params, state, events, r, now_ns)


@kernel()
def end_frame(params, losses, state, events, s, now_ns):
    """End the frame of robot s: the `frame_fate` of each of its strong links becomes final."""
    sender = state.robot[s]
    robot, reception, link = state.robot, state.reception, state.link
    if params.method == WITHOUT_INTERFERENCE:
        for i in range(sender.first_link, sender.weak_link):
            if link[i].frame_fate == RECEIVING:
                alone = alone_log_success(params, link[i].power_mw, sender.bits, sender.rate)
                link[i].frame_fate = fate_of_frame(state.ht, params, losses, state, s, i, alone)
        sender.on_air = SILENT
        return
    # Without other losses, a data frame of success 1 is received.
    is_sure = not losses.params[0].has_any and sender.on_air == DATA
    first, weak, stop = np.uint64(sender.first_link), np.uint64(sender.weak_link), np.uint64(sender.stop_link)
    for i in range(first, weak):
        if link[i].fate != UNDER_WAY:
            continue
        r = np.int64(link[i].receiver)
        rx = reception[np.uint64(r)]
        end_chunk(state.ht, params, robot, rx, r, now_ns)
        _remove(rx, link[i].power_mw)
        if (rx.locked_to == s) & (rx.link == np.int64(i)):
            unlock(rx)
            if is_sure and rx.log_success == 0.0:  # without a draw; pragma: no mutate (the fate is the same)
                link[i].frame_fate = RECEIVED
            else:
                link[i].frame_fate = fate_of_frame(state.ht, params, losses, state, s, np.int64(i), rx.log_success)
            dcf.reception_ended(params, robot, r, s, link[i].frame_fate == RECEIVED, now_ns)
        dcf.sense(params, state, events, r, now_ns)
    for i in range(weak, stop):
        r = np.int64(link[i].receiver)
        rx = reception[np.uint64(r)]
        end_chunk(state.ht, params, robot, rx, r, now_ns)
        _remove(rx, link[i].power_mw)
        dcf.sense(params, state, events, r, now_ns)
    sender.on_air = SILENT
    reception[s].is_deaf = sender.mac_state == TURNAROUND
    dcf.sense(params, state, events, s, now_ns)


@kernel()
def stop_receiving(state, r):
    """Stop the reception of robot r, because it sends: the frame that it was receiving is lost."""
    rx = state.reception[r]
    rx.is_deaf = 1
    if rx.locked_to != NO_ROBOT:
        state.link[rx.link].frame_fate = COLLIDED
        unlock(rx)


@kernel(inline="always")
def unlock(rx):
    """Release the receiver from its frame."""
    rx.locked_to, rx.signal_mw = NO_ROBOT, np.inf


@kernel(inline="always")
def _add(rx, power_mw):
    """Add a frame's power at a robot."""
    rx.power_mw += power_mw
    rx.signals += 1
    rx.peak_mw = max(rx.peak_mw, rx.power_mw)


@kernel(inline="always")
def _remove(rx, power_mw):
    """Remove a frame's power at a robot."""
    rx.signals -= 1
    rx.power_mw = rx.power_mw - power_mw if rx.signals > 0 else 0.0  # rounding errors do not accumulate


@kernel(inline="always")
def _arrive(params, robot, rx, link, s, i, now_ns):
    """Start the frame of robot s at a robot on link i: the receiver locks to it, or it is interference."""
    power_mw, noise_mw = link[i].power_mw, params.noise_mw + rx.jam_mw
    receivable = (power_mw >= params.min_preamble_mw) & (power_mw >= params.min_preamble_sinr * params.noise_mw)
    locks = receivable & (power_mw >= params.min_preamble_sinr * (noise_mw + rx.power_mw)) & (rx.is_deaf == 0)
    link[i].frame_fate = COLLIDED if receivable else TOO_WEAK
    if rx.jam_mw > 0.0 and receivable and not (locks or rx.is_deaf) and rx.locked_to == NO_ROBOT:
        would_lock = power_mw >= params.min_preamble_sinr * (params.noise_mw + rx.power_mw)
        link[i].frame_fate = JAMMED if would_lock else COLLIDED
    _add(rx, power_mw)
    if rx.locked_to != NO_ROBOT:
        if now_ns - robot[rx.locked_to].on_air_ns > params.capture_window_ns:
            locks = False
        else:
            drowned = rx.signal_mw < params.min_preamble_sinr * (noise_mw + max(rx.power_mw - rx.signal_mw, 0.0))
            locks = locks and (drowned or power_mw > rx.signal_mw)
            if drowned or locks:
                link[rx.link].frame_fate = COLLIDED
                unlock(rx)
    if locks:
        link[i].frame_fate = RECEIVING
        rx.locked_to, rx.link, rx.since_ns, rx.signal_mw = s, i, now_ns, power_mw
        rx.log_success = rx.jam_log = 0.0


@kernel()  # not inlined by numba, which then drops branches by the type of `ht`
def end_chunk(ht, params, robot, rx, r, now_ns):
    """Add the log success of the current chunk, before the interference at robot r changes; `ht` is `state.ht`."""
    # The signal of idle receivers is infinite: a branch for them would be mispredicted too often.
    others_mw = max(rx.power_mw - rx.signal_mw, 0.0) * (rx.signals > 1)
    noise_mw = params.noise_mw + rx.jam_mw + others_mw
    if ht is not None:
        if rx.signal_mw < params.error_free_sinr * noise_mw:
            decoding.add_chunk(ht, rx, r, now_ns, rx.signal_mw / noise_mw, rx.signal_mw / (params.noise_mw + others_mw))
        rx.since_ns = now_ns
        return
    if (rx.signal_mw < params.error_free_sinr * noise_mw) & (rx.log_success > LOG_HOPELESS):
        sender = robot[rx.locked_to]
        bits = sender.bits * ((now_ns - rx.since_ns) / sender.airtime_ns)
        chunk = log_success(params, sender.rate, rx.signal_mw / noise_mw, bits)
        rx.log_success += chunk
        if rx.jam_mw > 0.0:
            sinr = rx.signal_mw / (params.noise_mw + others_mw)
            rx.jam_log += log_success(params, sender.rate, sinr, bits) - chunk
    rx.since_ns = now_ns
