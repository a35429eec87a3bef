"""Access: throughput of ALOHA over load, and delivery of each method over the number of nodes beside ns-3's."""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Sequence

import numpy as np

from benchmarks.ns3_reference import AS_RUN, recorded
from docs.pictures.radio.sheet import legend, line_color, panels, say, write
from swarmwire.comms.clock import tick_start_ns
from swarmwire.comms.draws import derive_key
from swarmwire.comms.geometry.obstacles import obstacle_arrays
from swarmwire.comms.packets import Fate, Payloads, SentPackets
from swarmwire.comms.radio.analysis.contention import contention
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.deploy.scenario_parts import radio_of
from swarmwire.metrics.drawing.canvas import INK

LOADS = (0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0)
SENDERS, FRAME_BYTES, RATE_HZ, TICKS = 200, 30, 10, 20
NODES = (2, 5, 10, 20, 40, 80)
SEEDS = range(1, 4)
METHODS = ("none", "aloha", "csma-802154")
WIFI = (("aloha", "wifi-b-1M", 0.1), ("dcf", "wifi-b-1M", 0.1), ("dcf", "wifi-a-6M", 0.02))


def draw() -> None:
    """Write access.svg."""
    figure, (aloha, short, wifi) = panels(3, 2.8)
    fine = np.linspace(0.0, LOADS[-1], 100)
    aloha.plot(fine, fine * np.exp(-2.0 * fine), color=line_color(0), lw=1.4, label="G exp(-2G)")
    aloha.plot(LOADS, [throughput(load) for load in LOADS], "o", ms=3.5, color=line_color(1), label="ours")
    aloha.set_ylim(0.0, 0.24)
    say(aloha, "ALOHA without capture", "load G: frames begun per airtime", "throughput S: frames received per airtime")
    legend(aloha, "upper right", ncols=2, columnspacing=1.0)

    for index, method in enumerate(METHODS):
        settings = [f"radio.access.method={method}"]
        _curve(short, "ieee802154", settings, 20, 0.1, index, method)
    _points(short, "ns3_802154_contention.json", "802.15.4", 20, 0.1)
    _over_nodes(short, "802.15.4, 20 bytes, 100 ms")
    legend(short, "lower left")

    for index, (method, preset, interval_s) in enumerate(WIFI):
        name = f"{method}, {preset.removeprefix('wifi-')}, {1e3 * interval_s:g} ms"
        _curve(wifi, preset, [f"radio.access.method={method}"], 128, interval_s, index + 1, name)
    _points(wifi, "ns3_80211_contention.json", "802.11b 1 Mbit/s", 128, 0.1)
    _points(wifi, "ns3_80211_contention.json", "802.11a 6 Mbit/s", 128, 0.02)
    _over_nodes(wifi, "802.11, 128 bytes")
    legend(wifi, "lower left")
    write(figure, "access")


def _over_nodes(axes, title: str) -> None:
    axes.set_xscale("log")
    axes.set_xticks(NODES, [str(nodes) for nodes in NODES])
    axes.minorticks_off()
    axes.set_ylim(0.0, 1.05)
    say(axes, title, "nodes in one spot", "share received")


def _curve(
    axes, preset: str, settings: Sequence[str], payload_bytes: int, interval_s: float, index: int, name: str
) -> None:
    """Our delivery over the number of nodes."""
    radio = radio_of(preset, [*AS_RUN[preset], *settings])
    found = [contention(radio, nodes, payload_bytes, interval_s, SEEDS).delivery_ratio for nodes in NODES]
    axes.plot(NODES, found, color=line_color(index), lw=1.4, label=name)


def _points(axes, file: str, technology: str, payload_bytes: int, interval_s: float) -> None:
    """ns-3's delivery, where it was run."""
    asked = {"technology": technology, "payload_bytes": payload_bytes, "interval_s": interval_s, "sending": "spread"}
    rows = [row for row in recorded(file)["rows"] if asked.items() <= row.items()]
    shown = [handle.get_label() for handle in axes.lines]
    label = None if "ns-3" in shown else "ns-3"
    at, found = [row["nodes"] for row in rows], [row["delivery_ratio"] for row in rows]
    axes.plot(at, found, "x", ms=5, color=INK, label=label)


def throughput(load: float) -> float:
    """Frames received per airtime by one listener amidst many equal senders, each of which sends one frame a tick."""
    bit_rate_bps = round(SENDERS * RATE_HZ * FRAME_BYTES * 8 / load)
    settings = [f"radio.bit_rate_bps={bit_rate_bps}", "radio.access.method=aloha", "radio.overhead_bytes=0"]
    settings += ["radio.reception.model=threshold", "radio.reception.min_sinr_db=3"]
    radio = radio_of("ieee802154", settings)
    keys = np.array([derive_key("figure of access")], np.uint64)
    medium = RadioMedium(radio, keys, SENDERS + 1, (2.0, 2.0), obstacle_arrays(((),)), RATE_HZ)
    rows = np.arange(SENDERS)
    sent = SentPackets(rows, np.full(SENDERS, SENDERS), Payloads.of([bytes(FRAME_BYTES)] * SENDERS))
    pose = np.zeros((SENDERS + 1, 3))
    received = 0
    for tick in range(TICKS + 2):
        at_ns = tick_start_ns(tick, RATE_HZ)
        received += int(medium.step(at_ns, pose).tally.fates[0, Fate.RECEIVED])
        if tick < TICKS:
            medium.send(at_ns, tick, sent)
    return load * received / (SENDERS * TICKS)
