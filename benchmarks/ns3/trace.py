"""A motion trace in both simulators: the same movement file, packets and send times; delivery over time and distance.

ns-3 reads the file with its own Ns2MobilityHelper. The record has its delivery in bins of time and distance.
"""

# pyright: basic, reportUnknownMemberType=false

import json
import multiprocessing
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.ns3.comparison import DIGITS, HEAD, RECORD
from benchmarks.ns3.configurations import Configuration, radio_like_ns3
from benchmarks.ns3.simulators import in_wheel, received
from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.radio.config.radio import POSITIONS
from swarmwire.world.motion.traces.reading import read_trace, write_trace
from swarmwire.world.motion.traces.trace import TracePoses

WALK = Configuration("802.11a", 6.0, 20, 128, 0.1, seeds=6, measured_s=120.0)  # its places are those of the trace
TRACE = Path(__file__).parents[2] / "scenarios" / "walk.movements"
TRACE_RECORD = RECORD.with_name("ns3_trace.json")
BIN_S, BIN_M = 2.0, 1.0
NEAR_M = 60.0  # nothing is received from farther away
BY_DISTANCE_M = 46.0, 56.0
EDGE_M, WIDE_M = 51.4, 1.0  # where -82 dBm arrive, below which no preamble is detected; to either side
STEP_S = 0.01  # over which a pair approaches or moves apart
OVER_TIME, NEAR = f"{BIN_S:g} s, all pairs", f"{BIN_S:g} s, pairs within {NEAR_M:g} m"
BY_DISTANCE = f"{BIN_M:g} m of distance, {BY_DISTANCE_M[0]:g} to {BY_DISTANCE_M[1]:g} m"
APART, TOGETHER = (f"within {WIDE_M:g} m of the edge, {way}" for way in ("moving apart", "approaching"))
Deliveries = dict[str, FloatArray]  # by name, (bins,) each, of all seeds together


class Figures(NamedTuple):
    """What is recorded of ns-3."""

    deliveries: Deliveries
    offset_m: float  # greatest distance along an axis between a sender's place in ns-3 and in the trace


def trace(is_recorded: bool, is_record: bool) -> list[str]:
    """Lines of Markdown: how far the delivery in bins differs, with positions held and interpolated."""
    ns3 = recorded_trace() if is_recorded else theirs()
    if is_record:
        write_trace_record(ns3)
    cells = [f"{positions}: {figure}" for positions in POSITIONS for figure in ("mean difference", "greatest")]
    lines = ["| " + " | ".join(["bins of", "number", "ns-3: delivery", *cells]) + " |", "| --- " * 7 + "|"]
    both = [deliveries(ours(positions)) for positions in POSITIONS]
    for name, delivery in ns3.deliveries.items():
        cells = [name, str(len(delivery)), f"{delivery.mean():.3f}"]
        for figures in both:
            off = np.round(figures[name] - delivery, 4) + 0.0  # no -0
            cells += [f"{np.abs(off).mean():.4f}", f"{off[np.abs(off).argmax()]:+.4f}"]
        lines.append("| " + " | ".join(cells) + " |")
    return [*lines, "", f"Places of senders in ns-3 and in the trace differ by at most {ns3.offset_m:.0e} m."]


def theirs() -> Figures:
    """ns-3, a run for each seed, in a process of its own."""
    got, offset_m = np.zeros(_shape(), np.bool_), 0.0
    nodes, counted = np.arange(WALK.nodes), slice(*WALK.counted)
    spawn = multiprocessing.get_context("spawn")
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(1, spawn) as pool:
        file = _exported(Path(folder))
        answers = [pool.submit(in_wheel, WALK.ns3_input(seed, file)) for seed in range(WALK.seeds)]
        for seed, answer in enumerate(answers):
            words = np.array(answer.result().split()[1 + 2 * WALK.nodes**2 :], np.float64)
            places_m, log = np.split(words, [2 * WALK.ticks * WALK.nodes])
            index, receiver = log.astype(np.int64).reshape(-1, 2).T
            got[seed, index // WALK.nodes, index % WALK.nodes, receiver] = True
            off_m = places_m.reshape(WALK.ticks, WALK.nodes, 2) - _places_m()[seed][:, nodes, nodes]
            offset_m = max(offset_m, float(np.abs(off_m[counted]).max()))
    return Figures(deliveries(got), offset_m)


def ours(positions: str) -> BoolArray:
    """Which packets each receiver got in the medium."""
    radio = replace(radio_like_ns3(WALK.standard, WALK.rate_mbps), positions=positions)
    with tempfile.TemporaryDirectory() as folder:
        poses = TracePoses(read_trace(_exported(Path(folder))), range(WALK.nodes), 0.0)
    walk_m = (np.tile(poses.at(tick / WALK.rate_hz)[:, :2], (WALK.seeds, 1)) for tick in range(WALK.ticks + 1))
    got = np.zeros(_shape(), np.bool_)
    for done in received(WALK, radio, walk_m):
        got[done.seed, done.sequence, done.sender, done.receiver] = True
    return got


def deliveries(got: BoolArray) -> Deliveries:
    """The delivery in each bin."""
    figures: Deliveries = {}
    for name, bins in _bins().items():
        sent = np.bincount(bins[bins >= 0])
        figures[name] = np.bincount(bins[got & (bins >= 0)], minlength=len(sent)) / sent
    return figures


def _shape() -> tuple[int, ...]:
    return WALK.seeds, WALK.ticks, WALK.nodes, WALK.nodes


def _exported(folder: Path) -> Path:
    """The trace as a movement file of ns-2."""
    write_trace(folder / "walk.tcl", read_trace(TRACE))
    return folder / "walk.tcl"


@cache
def _places_m(later_s: float = 0.0) -> FloatArray:
    """Where all nodes are when each packet is handed over, or some time later, (seeds, ticks, senders, nodes, 2)."""
    at_s = WALK.sent_at_ns().transpose(1, 0, 2) / NS_PER_S + later_s
    paths = [rows.T for rows in read_trace(TRACE).samples()]
    by_axis = [[np.interp(at_s, path[0], path[axis]) for path in paths] for axis in (1, 2)]
    return np.array(by_axis).transpose(2, 3, 4, 1, 0)


@cache
def _bins() -> dict[str, IntArray]:
    """Bin of each packet at each receiver, (seeds, ticks, senders, receivers), by the name of the bins; -1: none."""
    distance_m, later_m = (_distance_m(later_s) for later_s in (0.0, STEP_S))
    tick, (first, last) = np.arange(WALK.ticks), WALK.counted
    counts = ((tick >= first) & (tick < last))[:, None, None] & ~np.eye(WALK.nodes, dtype=np.bool_)
    time_bin = np.broadcast_to(((tick - first) / (BIN_S * WALK.rate_hz)).astype(np.int64)[:, None, None], _shape())
    distance_bin = ((distance_m - BY_DISTANCE_M[0]) // BIN_M).astype(np.int64)
    is_near, is_edge = distance_m < NEAR_M, np.abs(distance_m - EDGE_M) < WIDE_M
    in_range = (distance_m >= BY_DISTANCE_M[0]) & (distance_m < BY_DISTANCE_M[1])
    nothing = np.zeros_like(time_bin)
    return {
        name: np.where(counts & which, bins, -1)
        for name, bins, which in (
            (OVER_TIME, time_bin, True),
            (NEAR, time_bin, is_near),
            (BY_DISTANCE, distance_bin, in_range),
            (APART, nothing, is_edge & (later_m > distance_m)),
            (TOGETHER, nothing, is_edge & (later_m < distance_m)),
        )
    }


def _distance_m(later_s: float) -> FloatArray:
    places_m, nodes = _places_m(later_s), np.arange(WALK.nodes)
    return np.linalg.norm(places_m - places_m[:, :, nodes, nodes][:, :, :, None], axis=-1)


def write_trace_record(ns3: Figures) -> None:
    """Write the record."""
    head = {
        **HEAD,
        "command": f"{HEAD['command']} --only trace",
        "what": f"delivery in bins, of nodes that move by {TRACE.name}",
        "offset_m": float(f"{ns3.offset_m:.1g}"),
    }
    figures = {name: json.dumps(np.round(each, DIGITS).tolist()) for name, each in ns3.deliveries.items()}
    rows = ",\n".join(f'    "{name}": {each}' for name, each in figures.items())
    before = json.dumps(head, indent=2)[:-2]
    TRACE_RECORD.write_text(f'{before},\n  "deliveries": {{\n{rows}\n  }}\n}}\n', encoding="utf-8")


def recorded_trace() -> Figures:
    """Read the record."""
    record = json.loads(TRACE_RECORD.read_text(encoding="utf-8"))
    return Figures({name: np.array(each) for name, each in record["deliveries"].items()}, record["offset_m"])
