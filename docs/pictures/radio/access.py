"""Access: throughput of ALOHA over load, and delivery of each method over the number of nodes beside ns-3's."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import replace

import numpy as np

from benchmarks.ns3.closed_forms import aloha as throughput
from benchmarks.ns3.comparison import recorded
from benchmarks.ns3.configurations import radio_like_ns3
from benchmarks.ns3.sections import SECTIONS
from docs.pictures.radio.sheet import legend, line_color, panels, set_labels, write
from swarmwire.comms.radio.analysis.contention import contention
from swarmwire.comms.radio.config.phy import Access
from swarmwire.metrics.pictures.drawing.canvas import INK

LOADS = (0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0)
ALOHA_TICKS = 20
NODES = (2, 5, 10, 20, 40, 80)
SEEDS = range(1, 4)
METHODS = ("none", "aloha", "csma-802154")
WPAN, A6, B1 = ("802.15.4", 0.25), ("802.11a", 6.0), ("802.11b", 1.0)
WIFI = (("aloha", B1, 0.1), ("dcf", B1, 0.1), ("dcf", A6, 0.02))


def draw() -> None:
    """Write access.svg."""
    figure, (aloha, short, wifi) = panels(3, 2.8)
    fine = np.linspace(0.0, LOADS[-1], 100)
    aloha.plot(fine, fine * np.exp(-2.0 * fine), color=line_color(0), lw=1.4, label="G exp(-2G)")
    aloha.plot(LOADS, [throughput(load, ALOHA_TICKS) for load in LOADS], "o", ms=3.5, color=line_color(1), label="ours")
    aloha.set_ylim(0.0, 0.24)
    set_labels(
        aloha, "ALOHA without capture", "load G: frames begun per airtime", "throughput S: frames received per airtime"
    )
    legend(aloha, "upper right", ncols=2, columnspacing=1.0)

    for index, method in enumerate(METHODS):
        _curve(short, WPAN, method, 20, 0.1, index, method)
    _points(short, WPAN, 20, 0.1)
    _over_nodes(short, "802.15.4, 20 bytes, 100 ms")
    legend(short, "lower left")

    for index, (method, (standard, rate_mbps), interval_s) in enumerate(WIFI):
        name = f"{method}, {standard} {rate_mbps:g}M, {1e3 * interval_s:g} ms"
        _curve(wifi, (standard, rate_mbps), method, 128, interval_s, index + 1, name)
    _points(wifi, B1, 128, 0.1)
    _points(wifi, A6, 128, 0.02)
    _over_nodes(wifi, "802.11, 128 bytes")
    legend(wifi, "lower left")
    write(figure, "access")


def _over_nodes(axes, title: str) -> None:
    axes.set_xscale("log")
    axes.set_xticks(NODES, [str(nodes) for nodes in NODES])
    axes.minorticks_off()
    axes.set_ylim(0.0, 1.05)
    set_labels(axes, title, "nodes in one spot", "share received")


def _curve(
    axes, kind: tuple[str, float], method: str, payload_bytes: int, interval_s: float, index: int, name: str
) -> None:
    """Our delivery over the number of nodes."""
    radio = replace(radio_like_ns3(*kind), access=Access(method))
    delivery = [contention(radio, nodes, payload_bytes, interval_s, SEEDS).pdr for nodes in NODES]
    axes.plot(NODES, delivery, color=line_color(index), lw=1.4, label=name)


def _points(axes, kind: tuple[str, float], payload_bytes: int, interval_s: float) -> None:
    """ns-3's delivery, where it was run."""
    figures = recorded()
    radio = (*kind, payload_bytes, interval_s)
    rows = [
        row for row in SECTIONS["spot"]() if (row.standard, row.rate_mbps, row.payload_bytes, row.interval_s) == radio
    ]
    shown = [handle.get_label() for handle in axes.lines]
    label = None if "ns-3" in shown else "ns-3"
    delivery = [figures[row]["delivery"].mean() for row in rows]
    axes.plot([row.nodes for row in rows], delivery, "x", ms=5, color=INK, label=label)
