"""LoRaSim's experiment SN1 (Bor et al. 2016): data extraction rate (DER) of one gateway, by its rule and by the medium.

Nodes are uniform in a circle in which all reach the gateway; each sends 20 bytes at SF12, 125 kHz, 4/8, in exponential
intervals of 1000 s. The rule is written down here once more, without a radio: it gets the times at which the medium's
frames went on air, and their mean powers.
"""

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.robot.packets import Fate, Payloads, SentPackets
from swarmwire.deploy.runs.scenario_parts import radio_of

INTERVAL_S, PAYLOAD_BYTES, POWER_DBM = 1000.0, 20, 14.0
LOSS_40M_DB, EXPONENT, SENSITIVITY_DBM = 127.41, 2.08, -133.25  # measured by the paper's authors
RADIUS_M = 40.0 * 10.0 ** ((POWER_DBM - SENSITIVITY_DBM - LOSS_40M_DB) / (10.0 * EXPONENT))
SYMBOL_S, AIRTIME_S = 2**12 / 125e3, 52.25 * 2**12 / 125e3  # 12.25 symbols of preamble, 8 and 32 of header and payload
CRITICAL_S = 3.0 * SYMBOL_S  # a frame that ends before this time of another's preamble does not overlap it
CAPTURE_DB = 6.0
RATE_HZ, QUIET_TICKS = 1, 10
SETTINGS = (
    *("radio.lora.spreading_factor=12", "radio.lora.coding_rate=4/8", "radio.lora.duty_cycle=1.0"),
    *(f"radio.antenna.power_dbm={POWER_DBM}", "radio.overhead_bytes=0"),
    *(f"radio.log_distance.exponent={EXPONENT}", "radio.noise.figure_db=0.0"),  # the rule has no noise
    f"radio.log_distance.reference_loss_db={LOSS_40M_DB - 10.0 * EXPONENT * float(np.log10(40.0))}",
)


class Extraction(NamedTuple):
    """DER of the same frames, by LoRaSim's rule and by the medium."""

    by_rule: float
    by_medium: float


def extraction(nodes: int, frames: int, seed: int) -> Extraction:
    """Return the DER of about this number of frames of `nodes` nodes."""
    rng = np.random.default_rng(seed)
    radius_m, angle = RADIUS_M * np.sqrt(rng.random(nodes)), 2.0 * np.pi * rng.random(nodes)
    xy_m = np.column_stack([radius_m * np.cos(angle), radius_m * np.sin(angle)])
    pose = np.column_stack([np.vstack([xy_m, [0.0, 0.0]]), np.zeros(nodes + 1)])
    ticks = round(frames * INTERVAL_S / nodes)
    keys = np.array([derive_key("LoRaSim", seed)], np.uint64)
    size_m = 2.0 * RADIUS_M, 2.0 * RADIUS_M
    context = ChannelContext.open_space(radio_of("lora-eu868", [*SETTINGS]), keys, nodes + 1, size_m)
    medium = RadioMedium(context, RATE_HZ)
    # An interval of 1000 s after each frame, in ticks of 1 s; the medium spreads the frames of a tick over it.
    next_s = rng.exponential(INTERVAL_S, nodes)
    start_ns, sender, fate = [np.empty(0, np.int64)], [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    for tick in range(ticks + QUIET_TICKS):
        at_ns = tick_start_ns(tick, RATE_HZ)
        finished = medium.step(at_ns, pose).finished
        start_ns.append(finished.on_air_at_ns)
        sender.append(finished.sender)
        fate.append(finished.fate)
        due = np.flatnonzero(next_s < tick + 1) if tick < ticks else np.empty(0, np.int64)
        next_s[due] += AIRTIME_S + rng.exponential(INTERVAL_S, len(due))
        payloads = Payloads.from_rows([bytes(PAYLOAD_BYTES)] * len(due))
        medium.send(at_ns, tick, SentPackets(due, np.full(len(due), nodes), payloads))
    on_air_ns, node = np.concatenate(start_ns), np.concatenate(sender)
    loss_db = LOSS_40M_DB + 10.0 * EXPONENT * np.log10(np.maximum(radius_m, 1.0) / 40.0)
    survives = by_rule(on_air_ns, POWER_DBM - loss_db[node])
    return Extraction(float(survives.mean()), float((np.concatenate(fate) == Fate.RECEIVED).mean()))


def by_rule(on_air_ns: IntArray, power_dbm: FloatArray) -> BoolArray:
    """Whether each frame (k,) survives: of two that overlap one 6 dB stronger does, else none (loraDir.py, 0.2.1).

    An overlap counts from the critical section of the later frame on, which follows three symbols of its preamble.
    """
    order = np.argsort(on_air_ns, kind="stable")
    start_s, dbm, survives = on_air_ns[order] / 1e9, power_dbm[order], np.ones(len(order), np.bool_)
    for i in range(len(order)):
        j = i + 1
        while j < len(order) and start_s[j] + CRITICAL_S < start_s[i] + AIRTIME_S:
            survives[i] &= dbm[i] - dbm[j] >= CAPTURE_DB
            survives[j] &= dbm[j] - dbm[i] >= CAPTURE_DB
            j += 1
    out = np.empty(len(order), np.bool_)
    out[order] = survives
    return out
