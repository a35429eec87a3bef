"""The table `radio_distances`: the PDR (received / intended) over distance, a row per bin."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.radio.records import ON_AIR, ReceptionRecords, TransmissionRecords
from swarmwire.comms.robot.packets import FATE_NAMES, Fate
from swarmwire.metrics.records.run_folder.packets import POSES_S, geometry_tick
from swarmwire.metrics.records.run_folder.table import (
    RecordedTable,
    RecordOptions,
    Totals,
    TotalsRecorder,
    Verdict,
    compare_fates,
    sums,
)
from swarmwire.metrics.records.run_folder.writer import scan_files

TOLERANCE = 1e-9  # relative
MIN_BINS_WITHIN_RANGE = 20
MAX_RANGES_ACROSS = 40  # shorter ranges have fewer bins within: an arena has 2000 bins at most
MAX_BINS = 2002  # 2000, a bin for rounding, and a bin for greater distances
ROUND_WIDTHS = (1.0, 2.0, 5.0)
PAIRS_PER_TICK = 5_000  # approximate maximum per arena, if each robot broadcasts once in a tick
# Odd multipliers: that of Knuth's Fibonacci hashing (2^64 over the golden ratio), and another.
SEQUENCE_MULTIPLIER, SENDER_MULTIPLIER = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xC2B2AE3D27D4EB4F)


class RadioDistances(RecordedTable):
    """A row per bin of the distance between sender and receiver; no table without a radio, or of a killed run.

    Columns: arena, from_m, to_m (centre to centre in space, when the packet went on air), intended (receivers of
    packets that went on air: all robots alive then, at any distance, or the addressed robot), received (receivers that
    received), pdr (received / intended; null without an intended receiver). With more than 70 robots one of n packets
    is counted; n is `record.radio_distances.every` in the summary. If packets were under way for more than 5 s, counted
    in `unknown` there, pdr is null.
    """

    name = "radio_distances"
    may_be_null = ("pdr",)

    types: ClassVar = {
        "arena": pl.Int32,
        "from_m": pl.Float64,
        "to_m": pl.Float64,
        "intended": pl.Int64,
        "received": pl.Int64,
        "pdr": pl.Float64,
    }

    def recorder(self, options: RecordOptions) -> Observer | None:
        """Return a recorder that writes nothing without a radio."""
        return TotalsRecorder(options.folder, self.name, DistanceCounts)

    def max_rows(self, static: Static, ticks: int) -> int:
        """Return a row for each arena and bin."""
        return MAX_BINS * static.arenas

    def compare(self, files: list[Path], summary: Mapping[str, Any] | None) -> Verdict:
        """Compare the received packets over all distances, if every packet was counted."""
        counted: dict[str, Any] = {} if summary is None else summary["record"].get(self.name, {})
        if counted.get("every") != 1 or counted.get("unknown") != 0:
            return None
        received = FATE_NAMES[Fate.RECEIVED]
        totals = {(row["arena"], received): row["received"] for row in sums(scan_files(files), ["received"])}
        return compare_fates(totals, (received,), summary)

    def fault(self, table: pl.LazyFrame, static: Static | None) -> str | None:
        """Return the first fault, also a pdr that is not received / intended."""
        fault = super().fault(table, static)
        if fault is not None:
            return fault
        pdr, intended, received = pl.col("pdr"), pl.col("intended"), pl.col("received")
        wrong = (pdr * intended - received).abs() > TOLERANCE * intended + TOLERANCE
        rows = table.filter(wrong).select(pl.len()).collect().item()
        return f"pdr is not received / intended in {rows} row{'s' if rows != 1 else ''}" if rows else None


class DistanceCounts(Totals):
    """PDR(d) = receivers that received / intended receivers, of packets that went on air, by distance.

    Intended receivers are all robots alive in the arena when a broadcast goes on air, at any distance, or the addressed
    robot. The distance is that at the tick in which the packet went on air, centre to centre.

    One of `every` packets is counted, which bounds the number of pairs; all packets up to 70 robots.

    Attributes:
        width_m: width of a bin; bin b counts b x width to (b + 1) x width.
        every: number of packets per counted packet.
        intended: (arenas, bins) intended receivers.
        received: (arenas, bins) receivers that received.
        unknown: intended receivers and receptions that are missing in both, since their packet was on air or under
            way for too long; if there are any, the ratio is unknown.
    """

    def __init__(self, static: Static) -> None:
        self._static = static
        self._wrap_m = static.arena_size_m if static.boundary == "torus" else (0.0, 0.0)
        diagonal_m = math.hypot(*static.arena_size_m)
        range_m = diagonal_m if static.range_m is None else static.range_m
        self.width_m = bin_width_m(min(max(range_m, diagonal_m / MAX_RANGES_ACROSS), diagonal_m))
        self._bins = int(diagonal_m / self.width_m) + 2
        self._bits = max(0, math.ceil(math.log2(static.robots**2 / PAIRS_PER_TICK)))
        self.every = 2**self._bits
        self.intended: IntArray = np.zeros((static.arenas, self._bins), np.int64)
        self.received: IntArray = np.zeros((static.arenas, self._bins), np.int64)
        self.unknown = 0
        self._positions: dict[int, RobotPositions] = {}  # tick: positions

    def see(self, truth: Truth) -> None:
        """Add the packets of a tick."""
        if self._static.range_m is None:  # no radio
            return
        shape = self._static.arenas, self._static.robots
        x_m, y_m, z_m = (column.reshape(shape) for column in truth.position_m.T)
        self._positions[truth.tick] = RobotPositions(x_m, y_m, z_m, truth.alive.reshape(shape), self._wrap_m)
        self._positions.pop(truth.tick - int(POSES_S * self._static.rate_hz) - 1, None)
        super().see(truth)

    def add(self, departed: TransmissionRecords, finished: ReceptionRecords) -> None:
        """Add packets of ticks whose positions are known."""
        self._add_intended(departed)
        self._add_received(finished)

    def frame(self) -> pl.DataFrame:
        """Return a row per arena and bin, up to the last bin with a receiver."""
        bins = int(np.flatnonzero(self.intended.any(axis=0)).max(initial=-1)) + 1
        arenas = len(self.intended)
        intended, received = self.intended[:, :bins].ravel(), self.received[:, :bins].ravel()
        edges_m = self.width_m * np.arange(bins + 1)
        is_defined = (intended > 0) & (self.unknown == 0)
        pdr = np.divide(received, intended, out=np.full(len(received), np.nan), where=is_defined)
        columns: dict[str, Any] = {
            "arena": np.repeat(np.arange(arenas), bins),
            "from_m": np.tile(edges_m[:-1], arenas),
            "to_m": np.tile(edges_m[1:], arenas),
            "intended": intended,
            "received": received,
            "pdr": pl.Series(pdr).fill_nan(None),
        }
        return pl.DataFrame(columns, schema_overrides=RadioDistances.types)

    def about(self) -> dict[str, Any]:
        """Return `every` and `unknown`."""
        return {"every": self.every, "unknown": self.unknown}

    def _add_intended(self, departed: TransmissionRecords) -> None:
        counted = np.flatnonzero(self._is_counted(departed.sender, departed.sequence) & (departed.fate == ON_AIR))
        ticks = geometry_tick(departed.on_air_at_ns[counted], self._static.rate_hz)
        robots = np.arange(self._static.robots)
        for tick in np.unique(ticks).tolist():
            rows = counted[ticks == tick]
            if tick not in self._positions:
                self.unknown += int(departed.intended[rows].sum())
                continue
            positions = self._positions[tick]
            arena, sender, to = departed.arena[rows, None], departed.sender[rows, None], departed.to[rows, None]
            is_intended = np.where(to == BROADCAST, positions.alive[arena[:, 0]], robots == to) & (robots != sender)
            self._count(self.intended, arena, positions.apart_m(arena, sender, robots), is_intended)

    def _add_received(self, finished: ReceptionRecords) -> None:
        is_counted = self._is_counted(finished.sender, finished.sequence)
        counted = np.flatnonzero(is_counted & (finished.fate == Fate.RECEIVED))
        ticks = geometry_tick(finished.on_air_at_ns[counted], self._static.rate_hz)
        for tick in np.unique(ticks).tolist():
            rows = counted[ticks == tick]
            if tick not in self._positions:
                self.unknown += len(rows)
                continue
            arena, sender, receiver = finished.arena[rows], finished.sender[rows], finished.receiver[rows]
            apart_m = self._positions[tick].apart_m(arena, sender, receiver)
            self._count(self.received, arena, apart_m, np.ones(len(rows), np.bool_))

    def _is_counted(self, sender: IntArray, sequence: IntArray) -> BoolArray:
        """Return True for counted packets, (k,): evenly over each robot's packets, and over robots in each tick."""
        if self.every == 1:
            return np.ones(len(sender), np.bool_)
        mixed = sequence.view(np.uint64) * SEQUENCE_MULTIPLIER + sender.view(np.uint64) * SENDER_MULTIPLIER
        return mixed < np.uint64(2 ** (64 - self._bits))

    def _count(self, table: IntArray, arena: IntArray, apart_m: FloatArray, mask: BoolArray) -> None:
        index = arena * self._bins + np.minimum((apart_m / self.width_m).astype(np.int64), self._bins - 1)
        np.add.at(table.reshape(-1), index[mask], 1)


@dataclass(frozen=True, slots=True)
class RobotPositions:
    """Positions of robots in a tick."""

    x_m: FloatArray  # (arenas, robots)
    y_m: FloatArray  # (arenas, robots)
    z_m: FloatArray  # (arenas, robots)
    alive: BoolArray  # (arenas, robots)
    wrap_m: tuple[float, float]  # the sides of a torus, else 0

    def apart_m(self, arena: IntArray, a: IntArray, b: IntArray) -> FloatArray:
        """Return distances between robots a and b of arenas, in the broadcast shape of the three."""
        along_m = self.x_m[arena, b] - self.x_m[arena, a]
        across_m = self.y_m[arena, b] - self.y_m[arena, a]
        if self.wrap_m[0]:
            along_m -= self.wrap_m[0] * np.floor(along_m / self.wrap_m[0] + 0.5)
            across_m -= self.wrap_m[1] * np.floor(across_m / self.wrap_m[1] + 0.5)
        up_m = self.z_m[arena, b] - self.z_m[arena, a]
        return np.sqrt(along_m * along_m + across_m * across_m + up_m * up_m)


def bin_width_m(range_m: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten with at least 20 bins within this range."""
    limit_m = range_m / MIN_BINS_WITHIN_RANGE * (1.0 + 1e-9)
    decade = 10.0 ** math.floor(math.log10(limit_m))
    return max(width * decade for width in ROUND_WIDTHS if width * decade <= limit_m)
