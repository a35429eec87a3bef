"""Reception in the PHY: preamble detection, capture, interference and the fate of each frame.

A free receiver locks to a frame whose preamble is strong enough for noise and interference. All other frames on air are
then interference until that frame ends. Success is the product over chunks of constant interference. If frames never
interfere (access "none"), a receiver receives each frame as if it were alone.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.draws_compiled import uniform
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.comms.base.sentinels import NO_PACKET, NO_ROBOT, UNDER_WAY
from swarmwire.comms.radio.config.phy import METHODS
from swarmwire.comms.radio.phy import dcf
from swarmwire.comms.radio.phy.event_queue import OFF_AIR, schedule
from swarmwire.comms.radio.phy.state import ACKNOWLEDGEMENT, DATA, RECEIVING, SILENT, TURNAROUND
from swarmwire.comms.radio.propagation.decibels import from_db
from swarmwire.comms.radio.reception.receiver import Model, Receiver, chunk_success
from swarmwire.comms.radio.stages.link_draws import ReceivedFrame
from swarmwire.comms.radio.stages.losses import frame_fate
from swarmwire.comms.robot.packets import Fate

MIN_OCTAVE, MAX_OCTAVE, ROWS = -10, 12, 256
MIN_SINR, MAX_SINR = 2.0**MIN_OCTAVE, 2.0**MAX_OCTAVE
LOG_NEVER = -100.0  # log success of a bit that is always wrong
CHUNK_BITS = 1000.0  # length at which the table evaluates success, for the digits of success close to 1
THRESHOLD = int(Model.THRESHOLD)
_FRACTION_BITS = np.int64(44)  # a double's fraction has 52 bits, of which the first 8 select the row
_FRACTION = np.int64(2**44 - 1)
_FIRST = np.int64((1023 + MIN_OCTAVE) * ROWS)


def log_success_table(receiver: Receiver) -> FloatArray:
    """Return the logarithm of a bit's success by SINR, (rows,), which the threshold model does not use.

    Interference changes too often to evaluate a formula each time. The table has 256 rows per octave from 2^-10 to
    2^12. The bits of the SINR select the row; with linear interpolation a frame's success is accurate to 1e-3.
    """
    octave = np.repeat(np.arange(MIN_OCTAVE, MAX_OCTAVE), ROWS)
    sinr = np.append(2.0**octave * (1.0 + np.tile(np.arange(ROWS), MAX_OCTAVE - MIN_OCTAVE) / ROWS), MAX_SINR)
    return _table(receiver, sinr)


@kernel()
def log_success(params, rate, sinr, bits):
    """Return the logarithm of the probability of `bits` bits at this rate without error at this SINR, a ratio."""
    table, receiver = params.log_success, params.receiver
    if receiver.model == THRESHOLD:
        return 0.0 if chunk_success(receiver, sinr, bits) > 0.0 else bits * LOG_NEVER
    if sinr >= MAX_SINR:
        return 0.0
    sinr_bits = np.float64(max(sinr, MIN_SINR)).view(np.int64)
    row = (sinr_bits >> _FRACTION_BITS) - _FIRST
    share = (sinr_bits & _FRACTION) * (1.0 / (1 << 44))
    return bits * (table[rate, row] + share * (table[rate, row + 1] - table[rate, row]))


@njit()
def _table(receiver, sinr):
    out = np.empty(len(sinr))
    for i in range(len(out)):
        chunk, bit = chunk_success(receiver, sinr[i], CHUNK_BITS), chunk_success(receiver, sinr[i], 1.0)
        if chunk > 0.1:
            out[i] = math_compiled.log(chunk) / CHUNK_BITS
        else:
            out[i] = max(math_compiled.log(bit), LOG_NEVER) if bit > 0.0 else LOG_NEVER
    return out


RECEPTION, ACKNOWLEDGED = purpose("reception"), purpose("reception of an acknowledgement")
RECEIVED, TOO_WEAK, COLLIDED, JAMMED = int(Fate.RECEIVED), int(Fate.TOO_WEAK), int(Fate.COLLIDED), int(Fate.JAMMED)


@kernel()
def fate_of_frame(params, losses, state, s, i, frame_log_success):
    """Return the fate on link i of the frame of robot s; `frame_log_success` is the log of its success.

    Draws are keyed by (sender, receiver, sequence) and attempt. The same draw decides the drop reason: COLLIDED if the
    frame would have succeeded without interference, JAMMED if it would have succeeded without jammers alone.
    """
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
    frame = ReceivedFrame(key, s, receiver, a, b, sequence, attempt, is_ack, sender.on_air_ns, losses.trace_ns)
    return frame_fate(losses, frame)


@kernel()
def alone_log_success(params, power_mw, bits, rate):
    """Return the logarithm of a frame's success probability without interference."""
    if power_mw < params.min_preamble_mw or power_mw < params.min_preamble_sinr * params.noise_mw:
        return bits * LOG_NEVER
    if power_mw >= params.error_free_sinr * params.noise_mw:
        return 0.0
    return log_success(params, rate, power_mw / params.noise_mw, bits)


@kernel(from_python=True)
def lone_delivery(params, mean_dbm, bits):
    """Return the success probability of a lone frame of `bits` bits at this power."""
    return math_compiled.exp(alone_log_success(params, from_db(mean_dbm), bits, params.data_rate))


@njit()
def lone_deliveries(params, mean_dbm, bits):
    """Return `lone_delivery` at several powers, (k,)."""
    delivery = np.empty(len(mean_dbm))
    for i in range(len(delivery)):
        delivery[i] = lone_delivery(params, mean_dbm[i], bits)
    return delivery


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
        end_chunk(params, robot, rx, now_ns)
        _arrive(params, robot, rx, link, s, i, now_ns)
        dcf.sense(params, state, events, r, now_ns)
    for i in range(weak, stop):
        r = np.int64(link[i].receiver)
        rx = reception[np.uint64(r)]
        end_chunk(params, robot, rx, now_ns)
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
                link[i].frame_fate = fate_of_frame(params, losses, state, s, i, alone)
        sender.on_air = SILENT
        return
    # Without other losses, a data frame of success 1 is received.
    is_sure = not losses.has_any and sender.on_air == DATA
    first, weak, stop = np.uint64(sender.first_link), np.uint64(sender.weak_link), np.uint64(sender.stop_link)
    for i in range(first, weak):
        if link[i].fate != UNDER_WAY:
            continue
        r = np.int64(link[i].receiver)
        rx = reception[np.uint64(r)]
        end_chunk(params, robot, rx, now_ns)
        _remove(rx, link[i].power_mw)
        if (rx.locked_to == s) & (rx.link == np.int64(i)):
            unlock(rx)
            if is_sure and rx.log_success == 0.0:  # without a draw; pragma: no mutate (the fate is the same)
                link[i].frame_fate = RECEIVED
            else:
                link[i].frame_fate = fate_of_frame(params, losses, state, s, np.int64(i), rx.log_success)
            dcf.reception_ended(params, robot, r, s, link[i].frame_fate == RECEIVED, now_ns)
        dcf.sense(params, state, events, r, now_ns)
    for i in range(weak, stop):
        r = np.int64(link[i].receiver)
        rx = reception[np.uint64(r)]
        end_chunk(params, robot, rx, now_ns)
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


@kernel(inline="always")
def end_chunk(params, robot, rx, now_ns):
    """Add the log success of the current chunk, before the interference at a robot changes."""
    # The signal of idle receivers is infinite: a branch for them would be mispredicted too often.
    others_mw = max(rx.power_mw - rx.signal_mw, 0.0) * (rx.signals > 1)
    noise_mw = params.noise_mw + rx.jam_mw + others_mw
    if (rx.signal_mw < params.error_free_sinr * noise_mw) & (rx.log_success > LOG_HOPELESS):
        sender = robot[rx.locked_to]
        bits = sender.bits * ((now_ns - rx.since_ns) / sender.airtime_ns)
        chunk = log_success(params, sender.rate, rx.signal_mw / noise_mw, bits)
        rx.log_success += chunk
        if rx.jam_mw > 0.0:
            sinr = rx.signal_mw / (params.noise_mw + others_mw)
            rx.jam_log += log_success(params, sender.rate, sinr, bits) - chunk
    rx.since_ns = now_ns
