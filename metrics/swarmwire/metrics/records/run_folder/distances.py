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
from swarmwire.metrics.records.run_folder.packets import POSES_KEPT_S, geometry_tick
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

TOLERANCE = 1e-9  # of a ratio
BINS_WITHIN_RANGE = 20  # at least
RANGES_ACROSS = 40  # ranges that an arena has bins of their own for; of shorter ones it has 2000 bins at most
MAX_BINS = 2002  # with one for rounding, and one for what is farther
ROUND_WIDTHS = (1.0, 2.0, 5.0)
PAIRS_PER_TICK = 5_000  # at most about, in an arena where each robot broadcasts once in a tick
# Odd multipliers: that of Knuth's Fibonacci hashing (2^64 over the golden ratio), and another.
SPREAD_SEQUENCE, SPREAD_SENDER = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xC2B2AE3D27D4EB4F)


class RadioDistances(RecordedTable):
    """A row per bin of the distance between sender and receiver; none without a radio, nor of a killed run.

    Columns: arena, from_m, to_m (centre to centre, when the packet went on air), intended (receivers of packets that
    went on air: all robots alive then, however far, or the one addressed), received (of these), pdr (received /
    intended; null if there was no intended receiver). Of more than 70 robots one of so many packets is counted as
    `record.radio_distances.every` says in the summary. If packets were on their way for more than 5 s, as `unknown`
    beside it says, pdr is null.
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
        """A recorder, which writes nothing without a radio."""
        return TotalsRecorder(options.folder, self.name, DistanceCounts)

    def max_rows(self, static: Static, ticks: int) -> int:
        """One for each arena and bin."""
        return MAX_BINS * static.arenas

    def compare(self, files: list[Path], summary: Mapping[str, Any] | None) -> Verdict:
        """If every packet was counted: as many that were received, over all distances."""
        counted: dict[str, Any] = {} if summary is None else summary["record"].get(self.name, {})
        if counted.get("every") != 1 or counted.get("unknown") != 0:
            return None
        received = FATE_NAMES[Fate.RECEIVED]
        totals = {(row["arena"], received): row["received"] for row in sums(scan_files(files), ["received"])}
        return compare_fates(totals, (received,), summary)

    def fault(self, table: pl.LazyFrame, static: Static | None) -> str | None:
        """Also a pdr that is not received / intended."""
        fault = super().fault(table, static)
        if fault is not None:
            return fault
        pdr, intended, received = pl.col("pdr"), pl.col("intended"), pl.col("received")
        wrong = (pdr * intended - received).abs() > TOLERANCE * intended + TOLERANCE
        rows = table.filter(wrong).select(pl.len()).collect().item()
        return f"pdr is not received / intended in {rows} row{'s' if rows != 1 else ''}" if rows else None


class DistanceCounts(Totals):
    """PDR(d) = receivers that received / receivers intended, of packets that went on air, by their distance.

    Intended are all robots alive in the arena when a broadcast goes on air, however far, and the one receiver of an
    addressed packet; who was out of range, in the way of a wall, dead before it received or not reached when the run
    ended has not received. The distance is that at the tick in which the packet went on air, centre to centre.

    Counted is one of every `every` packets, which bounds the pairs to look at: all of them up to 70 robots.

    Attributes:
        width_m: of a bin; bin b holds b x width to (b + 1) x width.
        every: one of so many packets is counted.
        intended: (arenas, bins) receivers.
        received: (arenas, bins) of these, receivers that received.
        unknown: receivers that received but are missing in `received`, since their packet was on its way for too long;
            where there are any, the ratio is not known.
    """

    def __init__(self, static: Static) -> None:
        self._static = static
        self._wrap_m = static.arena_size_m if static.boundary == "torus" else (0.0, 0.0)
        across_m = math.hypot(*static.arena_size_m)
        range_m = across_m if static.range_m is None else static.range_m
        self.width_m = bin_width_m(min(max(range_m, across_m / RANGES_ACROSS), across_m))
        self._bins = int(across_m / self.width_m) + 2
        self._bits = max(0, math.ceil(math.log2(static.robots**2 / PAIRS_PER_TICK)))
        self.every = 2**self._bits
        self.intended: IntArray = np.zeros((static.arenas, self._bins), np.int64)
        self.received: IntArray = np.zeros((static.arenas, self._bins), np.int64)
        self.unknown = 0
        self._places: dict[int, RobotPositions] = {}  # by tick

    def see(self, truth: Truth) -> None:
        """Add what a tick brought."""
        if self._static.range_m is None:  # there is no radio
            return
        shape = self._static.arenas, self._static.robots
        x_m, y_m = truth.pose[:, 0].reshape(shape), truth.pose[:, 1].reshape(shape)
        self._places[truth.tick] = RobotPositions(x_m, y_m, truth.alive.reshape(shape), self._wrap_m)
        self._places.pop(truth.tick - int(POSES_KEPT_S * self._static.rate_hz) - 1, None)
        if truth.departed is not None and truth.finished is not None:
            self._add_intended(truth.departed)
            self._add_received(truth.finished)

    def frame(self) -> pl.DataFrame:
        """A row per arena and bin, up to the last that any receiver was in."""
        bins = int(np.flatnonzero(self.intended.any(axis=0)).max(initial=-1)) + 1
        arenas = len(self.intended)
        intended, received = self.intended[:, :bins].ravel(), self.received[:, :bins].ravel()
        edges_m = self.width_m * np.arange(bins + 1)
        known = (intended > 0) & (self.unknown == 0)
        pdr = np.divide(received, intended, out=np.full(len(received), np.nan), where=known)
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
        """One of so many packets was counted; receivers that received at a distance that was not known any more."""
        return {"every": self.every, "unknown": self.unknown}

    def _add_intended(self, departed: TransmissionRecords) -> None:
        rows = np.flatnonzero(self._taken(departed.sender, departed.sequence) & (departed.fate == ON_AIR))
        ticks = geometry_tick(departed.on_air_at_ns[rows], self._static.rate_hz)
        everyone = np.arange(self._static.robots)
        for tick in np.unique(ticks).tolist():
            if tick not in self._places:
                continue
            at, of = self._places[tick], rows[ticks == tick]
            arena, sender, to = departed.arena[of, None], departed.sender[of, None], departed.to[of, None]
            meant = np.where(to == BROADCAST, at.alive[arena[:, 0]], everyone == to) & (everyone != sender)
            self._count(self.intended, arena, at.apart_m(arena, sender, everyone), meant)

    def _add_received(self, finished: ReceptionRecords) -> None:
        rows = np.flatnonzero(self._taken(finished.sender, finished.sequence) & (finished.fate == Fate.RECEIVED))
        ticks = geometry_tick(finished.on_air_at_ns[rows], self._static.rate_hz)
        for tick in np.unique(ticks).tolist():
            of = rows[ticks == tick]
            if tick not in self._places:
                self.unknown += len(of)
                continue
            arena, sender, receiver = finished.arena[of], finished.sender[of], finished.receiver[of]
            apart_m = self._places[tick].apart_m(arena, sender, receiver)
            self._count(self.received, arena, apart_m, np.ones(len(of), np.bool_))

    def _taken(self, sender: IntArray, sequence: IntArray) -> BoolArray:
        """Which packets are counted, (k,): evenly spread over each robot's packets, and over robots in each tick."""
        if self.every == 1:
            return np.ones(len(sender), np.bool_)
        mixed = sequence.view(np.uint64) * SPREAD_SEQUENCE + sender.view(np.uint64) * SPREAD_SENDER
        return mixed < np.uint64(2 ** (64 - self._bits))

    def _count(self, to: IntArray, arena: IntArray, apart_m: FloatArray, meant: BoolArray) -> None:
        place = arena * self._bins + np.minimum((apart_m / self.width_m).astype(np.int64), self._bins - 1)
        np.add.at(to.reshape(-1), place[meant], 1)


@dataclass(frozen=True, slots=True)
class RobotPositions:
    """Where robots stood in a tick."""

    x_m: FloatArray  # (arenas, robots)
    y_m: FloatArray  # (arenas, robots)
    alive: BoolArray  # (arenas, robots)
    wrap_m: tuple[float, float]  # the sides of a torus, else 0

    def apart_m(self, arena: IntArray, a: IntArray, b: IntArray) -> FloatArray:
        """Distances between robots a and b of arenas, in the shape that the three come to together."""
        along_m = self.x_m[arena, b] - self.x_m[arena, a]
        across_m = self.y_m[arena, b] - self.y_m[arena, a]
        if self.wrap_m[0]:
            along_m -= self.wrap_m[0] * np.floor(along_m / self.wrap_m[0] + 0.5)
            across_m -= self.wrap_m[1] * np.floor(across_m / self.wrap_m[1] + 0.5)
        return np.sqrt(along_m * along_m + across_m * across_m)


def bin_width_m(range_m: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten with at least 20 bins within this range."""
    most = range_m / BINS_WITHIN_RANGE * (1.0 + 1e-9)
    decade = 10.0 ** math.floor(math.log10(most))
    return max(width * decade for width in ROUND_WIDTHS if width * decade <= most)
