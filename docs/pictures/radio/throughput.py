"""Throughput over distance: what one robot gets across to another, by radio."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import replace
from math import ceil

import numpy as np
from matplotlib.ticker import EngFormatter

from docs.pictures.radio.sheet import legend_below, line_color, panels, set_labels, write
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.clock import NS_PER_S, tick_start_ns
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.radio.config.frames import airtime_ns
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.radio.phy.propagation import range_of
from swarmwire.comms.robot.packets import Fate, Payloads, SentPackets
from swarmwire.deploy.runs.scenario_parts import radio_of

MIN_S, MIN_FRAMES = 0.4, 40  # of each run
WARM_UP = 0.25  # share of a run that does not count
OFFERED = 1.3  # frames handed over per airtime: the queue is never empty
POINTS = 14, 26  # of a line, evenly over log10 up to half its range, and from there on
LINES = {  # by label: preset, keys that differ, dashes
    "802.11n, adaptive": ("wifi-n-5G", ["radio.access.rate_control=ideal"], "-"),
    "802.11n, 65 Mbit/s": ("wifi-n-5G", [], (0, (4, 2))),
    "802.11a, 54 Mbit/s": ("wifi-a-6M", ["radio.bit_rate_bps=54000000"], "-"),
    "802.11a, 6 Mbit/s": ("wifi-a-6M", [], "-"),
    "802.11g, 54 Mbit/s": (
        "wifi-a-6M",
        ["radio.bit_rate_bps=54000000", "radio.frame=802.11g", "radio.frequency_hz=2412e6"],
        "-",
    ),
    "802.11g, 6 Mbit/s": ("wifi-a-6M", ["radio.frame=802.11g", "radio.frequency_hz=2412e6"], "-"),
    "Crazyradio, 2 Mbit/s": ("crazyradio-2M", [], "-"),
    "Crazyradio, 250 kbit/s": ("crazyradio-250k", [], "-"),
    "LoRa SF7, any share of time": ("lora-us915", [], "-"),
    "LoRa SF7, 1 % of the time": ("lora-eu868", [], (0, (4, 2))),
    "LoRa SF12, 1 % of the time": ("lora-eu868", ["radio.lora.spreading_factor=12"], (0, (4, 2))),
}


def draw() -> None:
    """Write throughput.svg."""
    figure, (axes,) = panels(1, 3.6)
    for index, (label, (preset, settings, dashes)) in enumerate(LINES.items()):
        radio = radio_of(preset, settings)
        range_m = range_of(radio) or 1.0
        near_m, far_m = np.geomspace(1.0, 0.5 * range_m, POINTS[0]), np.linspace(0.5, 1.15, POINTS[1]) * range_m
        distances_m = np.concatenate([near_m, far_m[1:]])
        bps = throughput_bps(radio, distances_m)
        axes.plot(distances_m[bps > 0.0], bps[bps > 0.0], color=line_color(index), lw=1.5, ls=dashes, label=label)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_major_formatter(EngFormatter("bit/s"))
    set_labels(axes, "what one robot gets across to another, by path loss alone", "distance in m", "payload per second")
    legend_below(figure, axes, 4)
    write(figure, "throughput")


def throughput_bps(radio: Radio, distances_m: FloatArray) -> FloatArray:
    """Payload received per second by a robot at each distance from one that always sends the longest packet, (k,).

    A duty cycle takes its share of that: in an hour a robot has so much airtime.
    """
    lora = radio.lora_or_none
    if lora is not None and lora.duty_cycle is not None:
        return lora.duty_cycle * throughput_bps(replace(radio, lora=replace(lora, duty_cycle=None)), distances_m)
    frame_s = float(airtime_ns(radio, np.array([radio.overhead_bytes + radio.max_payload_bytes]))[0]) / NS_PER_S
    rate_hz, arenas = ceil(OFFERED / frame_s), len(distances_m)
    ticks = ceil(max(MIN_S, MIN_FRAMES * frame_s) * rate_hz)
    keys = np.array([derive_key("throughput", arena) for arena in range(arenas)], np.uint64)
    side_m = 2.0 * float(distances_m.max())
    medium = RadioMedium(ChannelContext.open_space(radio, keys, 2, (side_m, side_m)), rate_hz)
    pose = np.zeros((2 * arenas, 3))
    pose[1::2, 0] = distances_m
    sent = SentPackets(
        2 * np.arange(arenas),
        np.ones(arenas, np.int64),
        Payloads.from_rows([bytes(radio.max_payload_bytes)] * arenas),
    )
    from_ns, until_ns = tick_start_ns(round(WARM_UP * ticks), rate_hz), tick_start_ns(ticks, rate_hz)
    received = np.zeros(arenas)
    for tick in range(ticks + 1):
        at_ns = tick_start_ns(tick, rate_hz)
        done = medium.step(at_ns, pose).finished
        counts = (done.fate == Fate.RECEIVED) & (done.final_at_ns >= from_ns) & (done.final_at_ns < until_ns)
        received += np.bincount(done.arena[counts], minlength=arenas)
        if tick < ticks:
            medium.send(at_ns, tick, sent)
    return 8.0 * radio.max_payload_bytes * received * NS_PER_S / (until_ns - from_ns)
