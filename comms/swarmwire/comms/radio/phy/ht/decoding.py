"""Decoding of 802.11n's frames: each MPDU of a PPDU has its own stretch of airtime, SINR and draw.

A receiver needs HT-SIG, which is sent with BPSK at code rate 1/2, and then decodes MPDU by MPDU.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.draws_compiled import uniform
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.radio.phy.ht.params import BASIC_RATE, HT_PREAMBLE_NS
from swarmwire.comms.radio.phy.ht.state import CHUNKS
from swarmwire.comms.radio.phy.state import DATA
from swarmwire.comms.radio.phy.success import alone_log_success, log_success
from swarmwire.comms.radio.stages.link_draws import ReceivedFrame
from swarmwire.comms.radio.stages.losses import frame_fate
from swarmwire.comms.radio.timing import US
from swarmwire.comms.robot.packets import Fate

MPDU, CONTROL, HEADER = purpose("reception"), purpose("reception of a control frame"), purpose("reception of HT-SIG")
RECEIVED, TOO_WEAK, COLLIDED, JAMMED = int(Fate.RECEIVED), int(Fate.TOO_WEAK), int(Fate.COLLIDED), int(Fate.JAMMED)
HEADER_BITS, HEADER_NS, HEADER_END_NS = 72, 12 * US, 28 * US  # L-SIG and HT-SIG


@kernel()
def add_chunk(ht, rx, r, now_ns, sinr, clear_sinr):
    """Add the chunk of the frame that robot r receives, from `rx.since_ns` to now; `ht` is `HtState`."""
    if rx.log_success == 0.0:  # the first chunk of this frame in which bits may be wrong
        rx.log_success, ht.chunks[r] = -1.0, 0
    if now_ns == rx.since_ns:
        return
    k = ht.chunks[r]
    if k == CHUNKS:
        last = ht.chunk[r, k - 1]
        last.until_ns, last.sinr, last.clear_sinr = now_ns, min(last.sinr, sinr), min(last.clear_sinr, clear_sinr)
        return
    chunk = ht.chunk[r, k]
    chunk.since_ns, chunk.until_ns, chunk.sinr, chunk.clear_sinr = rx.since_ns, now_ns, sinr, clear_sinr
    ht.chunks[r] = k + 1


@kernel()
def fate_of_frame(params, losses, state, s, i):
    """Return the fate of the frame of robot s on link i: RECEIVED if a part of it was decoded.

    For the addressed robot, it writes the `last_fate` of each MPDU.
    """
    sender, station = state.robot[s], state.ht.station[s]
    r, start_ns = np.int64(state.link[i].receiver), sender.on_air_ns
    if sender.on_air != DATA:
        end_ns = start_ns + sender.airtime_ns
        return _fate(
            params, losses, state, s, i, start_ns, end_ns, sender.bits, sender.rate, station.frames, CONTROL, 0
        )
    if sender.to == BROADCAST:
        end_ns, sequence = start_ns + sender.airtime_ns, state.packet[sender.packet].sequence
        return _fate(params, losses, state, s, i, start_ns, end_ns, sender.bits, sender.rate, sequence, MPDU, 0)
    header_ns = start_ns + HEADER_END_NS
    sequence = station.frames
    header = _fate(
        params, losses, state, s, i, header_ns - HEADER_NS, header_ns, HEADER_BITS, BASIC_RATE, sequence, HEADER, 0
    )
    if header != RECEIVED:
        return header
    data_ns = sender.airtime_ns - HT_PREAMBLE_NS - params.ht.extension_ns
    fate, remaining, k = RECEIVED, station.count, station.first
    while remaining > 0:
        packet = state.packet[state.order[k]]
        k += 1
        if packet.is_in_ppdu == 0:
            continue
        first_ns = start_ns + HT_PREAMBLE_NS + packet.offset_bytes * data_ns // station.psdu_bytes
        end_ns = first_ns + packet.bits // 8 * data_ns // station.psdu_bytes
        attempt = packet.attempts - 1
        this = _fate(
            params, losses, state, s, i, first_ns, end_ns, packet.bits, sender.rate, packet.sequence, MPDU, attempt
        )
        fate = this if remaining == station.count or this == RECEIVED else fate
        remaining -= 1
        if r == sender.to:
            packet.last_fate = this
        elif fate == RECEIVED:
            return fate
    return fate


@kernel()
def _fate(params, losses, state, s, i, start_ns, end_ns, bits, rate, sequence, draw_purpose, attempt):
    """Return the fate on link i of the bits that robot s has on air from `start_ns` to `end_ns`, and draw it.

    HT-SIG meets no losses, since the MPDUs behind it do.
    """
    r = np.int64(state.link[i].receiver)
    key, a, b = state.keys[s // params.robots], s % params.robots, r % params.robots
    if state.reception[r].log_success != 0.0:
        u = uniform(key, a, b, sequence, draw_purpose + attempt)
        log, clear_log = _log_success(params, state.ht, r, start_ns, end_ns, bits, rate)
        if u >= math_compiled.exp(log):
            if u < math_compiled.exp(clear_log):
                return JAMMED
            alone = math_compiled.exp(alone_log_success(params, state.link[i].power_mw, bits, rate))
            return COLLIDED if u < alone else TOO_WEAK
    if draw_purpose == HEADER:
        return RECEIVED
    is_control, at_ns = draw_purpose == CONTROL, state.robot[s].on_air_ns
    frame = ReceivedFrame(key, s, r, a, b, sequence, attempt, is_control, at_ns, losses.params[0].trace_ns)
    return frame_fate(losses, frame)


@kernel()
def _log_success(params, ht, r, start_ns, end_ns, bits, rate):
    """Return the log success of bits between two times at robot r, with and without jammers."""
    log = clear_log = 0.0
    for k in range(ht.chunks[r]):
        chunk = ht.chunk[r, k]
        overlap_ns = min(chunk.until_ns, end_ns) - max(chunk.since_ns, start_ns)
        if overlap_ns > 0:
            share = bits * (overlap_ns / (end_ns - start_ns))
            log += log_success(params, rate, chunk.sinr, share)
            clear_log += log_success(params, rate, chunk.clear_sinr, share)
    return log, clear_log
