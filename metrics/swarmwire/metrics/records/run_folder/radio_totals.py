"""The tables `radio_robots` and `radio_links`: the fates of the packets of each robot, and on each link."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.sentinels import NO_ROBOT
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.radio.records import ON_AIR, ReceptionRecords, TransmissionRecords
from swarmwire.comms.robot.packets import FATE_NAMES, Fate
from swarmwire.metrics.records.run_folder.table import (
    RecordedTable,
    RecordOptions,
    TableState,
    Totals,
    TotalsRecorder,
    Verdict,
    compare_fates,
    sums,
)
from swarmwire.metrics.records.run_folder.writer import scan_files

BITS_PER_BYTE = 8
# Fates without a receiver of their own: decided at the sender, or of receivers that are not listed.
SENDER_FATES = {
    Fate.OUT_OF_RANGE,
    Fate.QUEUE_FULL,
    Fate.TOO_LARGE,
    Fate.IN_FLIGHT,
    Fate.SENDER_DEAD,
    Fate.CHANNEL_BUSY,
    Fate.DUTY_CYCLE,
}
RECEIVER_FATES = tuple(fate for fate in Fate if fate not in SENDER_FATES)
FATES = len(FATE_NAMES)
NOT_FINAL = FATE_NAMES[Fate.IN_FLIGHT]  # the summary also counts packets that never left their sender's radio
# Fates that each receiver has on a separate link.
LINK_FATES = tuple(
    FATE_NAMES[fate]
    for fate in (
        Fate.RECEIVED,
        Fate.BLOCKED,
        Fate.LOST,
        Fate.TOO_WEAK,
        Fate.COLLIDED,
        Fate.BURST,
        Fate.PARTITIONED,
        Fate.JAMMED,
        Fate.NOT_LISTENING,
    )
)
MAX_PENDING_ROWS = 250_000  # more rows are added up


class RadioRobots(RecordedTable):
    """A row per robot over the run; no table without a radio, or of a killed run.

    Columns: arena, robot (name); for the packets that it sent: packets (that left its radio, refused ones too),
    packets_on_air, airtime_s, airtime (share of the run), intended (receivers), as_sender_FATE for every fate
    (receivers, which add up to intended); for packets of other robots: as_receiver_FATE (packets within reach),
    received_bytes (payload with tags), throughput_bps (over the run).

    A packet that never left the sender's radio until the run ended is not counted. The airtime of one attempt of a
    retransmitted packet counts; that of acknowledgements does not.
    """

    name = "radio_robots"

    types: ClassVar = {
        "arena": pl.Int32,
        "robot": pl.String,
        "packets": pl.Int64,
        "packets_on_air": pl.Int64,
        "airtime_s": pl.Float64,
        "airtime": pl.Float64,
        "received_bytes": pl.Int64,
        "throughput_bps": pl.Float64,
        "intended": pl.Int64,
        **{f"as_sender_{FATE_NAMES[fate]}": pl.Int64 for fate in Fate},
        **{f"as_receiver_{FATE_NAMES[fate]}": pl.Int64 for fate in RECEIVER_FATES},
    }

    def recorder(self, options: RecordOptions) -> Observer | None:
        """Return a recorder that writes nothing without a radio."""
        return TotalsRecorder(options.folder, self.name, RobotCounts)

    def max_rows(self, static: Static, ticks: int) -> int:
        """Return a row for each robot."""
        return static.arenas * static.robots

    def compare(self, files: list[Path], summary: Mapping[str, Any] | None) -> Verdict:
        """Compare the receivers of each fate, over senders; for fates of links also over receivers."""
        table = scan_files(files)
        for row in sums(table, [f"{side}_{fate}" for side in ("as_sender", "as_receiver") for fate in LINK_FATES]):
            for fate in LINK_FATES:
                sent, received = row[f"as_sender_{fate}"], row[f"as_receiver_{fate}"]
                if sent != received:
                    text = f"{received} {fate} over receivers and {sent} over senders (arena {row['arena']})"
                    return TableState.DIFFERS, f"{text}; expected as many"
        fates = [fate for fate in FATE_NAMES if fate != NOT_FINAL]
        rows = sums(table, [f"as_sender_{fate}" for fate in fates])
        return compare_fates(
            {(row["arena"], fate): row[f"as_sender_{fate}"] for row in rows for fate in fates}, fates, summary
        )

    def fault(self, table: pl.LazyFrame, static: Static | None) -> str | None:
        """Return the first fault, also if robots are not in the order of static.json, arena after arena."""
        return super().fault(table, static) or (None if static is None else _names_fault(table, static))


def _names_fault(table: pl.LazyFrame, static: Static) -> str | None:
    rows = table.select("arena", "robot").collect().rows()
    expected = [(arena, robot) for arena in range(static.arenas) for robot in static.robot_names]
    if len(rows) != len(expected):
        return f"{len(rows)} robots; static.json has {len(expected)}"
    for (arena, robot), listed in zip(expected, rows, strict=True):
        if (arena, robot) != listed:
            return f"{listed[1]} (arena {listed[0]}) stands in the place of {robot} (arena {arena}) of static.json"
    return None


class RobotCounts(Totals):
    """Packets counted for each robot row, as sender and as receiver; O(robots) memory.

    Attributes:
        packets: (rows,) packets that left the robot's radio, refused ones too.
        packets_on_air: (rows,) packets that went on air.
        on_air_ns: (rows,) their airtime.
        intended: (rows,) intended receivers of the robot's packets.
        as_sender: (rows, fates) these receivers by fate, if it is final.
        as_receiver: (rows, fates) packets of other robots within reach, by fate.
        received_bytes: (rows,) payload received, with tags.
    """

    def __init__(self, static: Static) -> None:
        self._static, self._robots, self._rows = static, static.robots, static.arenas * static.robots
        self._ticks = np.zeros(static.arenas, np.int64)  # ticks of each arena so far
        self.packets, self.packets_on_air, self.on_air_ns = self._zeros(), self._zeros(), self._zeros()
        self.intended, self.received_bytes = self._zeros(), self._zeros()
        self.as_sender: IntArray = np.zeros((self._rows, FATES), np.int64)
        self.as_receiver: IntArray = np.zeros((self._rows, FATES), np.int64)

    def see(self, truth: Truth) -> None:
        """Add the packets of a tick."""
        self._ticks += truth.running
        super().see(truth)

    def frame(self) -> pl.DataFrame:
        """Return a row per arena and robot."""
        static, time_s = self._static, np.repeat(self._ticks, self._robots) / self._static.rate_hz
        as_sender = self.as_sender.copy()
        as_sender[:, Fate.IN_FLIGHT] = self.in_flight
        columns: dict[str, Any] = {
            "arena": np.repeat(np.arange(static.arenas), static.robots),
            "robot": list(static.robot_names) * static.arenas,
            "packets": self.packets,
            "packets_on_air": self.packets_on_air,
            "airtime_s": self.on_air_ns / NS_PER_S,
            "airtime": self.on_air_ns / NS_PER_S / time_s,
            "received_bytes": self.received_bytes,
            "throughput_bps": BITS_PER_BYTE * self.received_bytes / time_s,
            "intended": self.intended,
            **{f"as_sender_{FATE_NAMES[fate]}": as_sender[:, fate] for fate in Fate},
            **{f"as_receiver_{FATE_NAMES[fate]}": self.as_receiver[:, fate] for fate in RECEIVER_FATES},
        }
        return pl.DataFrame(columns, schema=RadioRobots.types)

    def add(self, departed: TransmissionRecords, finished: ReceptionRecords) -> None:
        """Add packets that left their radios, and fates."""
        self._add_departed(departed)
        sender = finished.arena * self._robots + finished.sender
        _add(self.as_sender, sender * FATES + finished.fate, finished.receivers)
        receiver = finished.arena * self._robots + finished.receiver
        fate, size_bytes = finished.fate, finished.size_bytes
        linked = finished.receiver != NO_ROBOT
        if not linked.all():
            receiver, fate, size_bytes = receiver[linked], fate[linked], size_bytes[linked]
        _add(self.as_receiver, receiver * FATES + fate)
        _add(self.received_bytes, receiver, np.where(fate == Fate.RECEIVED, size_bytes, 0))

    @property
    def in_flight(self) -> IntArray:
        """Receivers whose fates are not final, of packets that left the radio, (rows,)."""
        return self.intended - self.as_sender.sum(axis=1)

    def _add_departed(self, departed: TransmissionRecords) -> None:
        sender = departed.arena * self._robots + departed.sender
        _add(self.packets, sender)
        _add(self.packets_on_air, sender[departed.fate == ON_AIR])
        _add(self.on_air_ns, sender, departed.off_air_at_ns - departed.on_air_at_ns)
        _add(self.intended, sender, departed.intended)
        _add(self.as_sender, sender * FATES + Fate.OUT_OF_RANGE, departed.out_of_range)

    def _zeros(self) -> IntArray:
        return np.zeros(self._rows, np.int64)


def _add(table: IntArray, index: IntArray, amount: IntArray | None = None) -> None:
    """Add amounts, by default 1 each, at indices of the flattened table."""
    np.add.at(table.reshape(-1), index, 1 if amount is None else amount)


class RadioLinks(RecordedTable):
    """A row per link and fate that occurred on it.

    Columns: arena, sender and receiver (indices), fate, packets. Receivers out of range have no rows, nor have packets
    that never went on air.
    """

    name = "radio_links"

    types: ClassVar = {
        "arena": pl.Int32,
        "sender": pl.Int32,
        "receiver": pl.Int32,
        "fate": pl.Enum(FATE_NAMES),
        "packets": pl.Int64,
    }

    def recorder(self, options: RecordOptions) -> Observer | None:
        """Return a recorder if the options include links."""
        return TotalsRecorder(options.folder, self.name, LinkCounts) if options.links else None

    def max_rows(self, static: Static, ticks: int) -> int:
        """Return a row for each link and fate."""
        return static.arenas * static.robots**2 * len(Fate)

    def compare(self, files: list[Path], summary: Mapping[str, Any] | None) -> Verdict:
        """Compare the packets of each fate that only links have, over all links."""
        totals = scan_files(files).group_by("arena", "fate").agg(pl.col("packets").sum()).collect()
        counted = {(arena, fate): packets for arena, fate, packets in totals.iter_rows()}
        return compare_fates(counted, LINK_FATES, summary)


class LinkCounts(Totals):
    """Packets counted by (arena, sender, receiver, fate); memory grows with the links that occurred, not with time."""

    def __init__(self, static: Static) -> None:
        self._robots = static.robots
        self._key: IntArray = np.zeros(0, np.int64)  # sorted
        self._packets: IntArray = np.zeros(0, np.int64)
        self._pending: list[IntArray] = []
        self._rows = 0

    def frame(self) -> pl.DataFrame:
        """Return a row per arena, sender, receiver and fate."""
        columns: dict[str, Any] = dict(self.columns())
        columns["fate"] = pl.Series(FATE_NAMES).gather(columns["fate"])
        return pl.DataFrame(columns, schema_overrides=RadioLinks.types)

    def add(self, departed: TransmissionRecords, finished: ReceptionRecords) -> None:
        """Add packets whose fate is final."""
        rows = np.flatnonzero(finished.receiver != NO_ROBOT)
        link = (finished.arena[rows] * self._robots + finished.sender[rows]) * self._robots + finished.receiver[rows]
        self._pending.append(link * FATES + finished.fate[rows])
        self._rows += len(rows)
        if self._rows >= MAX_PENDING_ROWS:
            self._merge()

    def columns(self) -> dict[str, IntArray]:
        """Return arena, sender, receiver, fate and packets, a sorted row per combination that occurred."""
        self._merge()
        link, fate = np.divmod(self._key, FATES)
        row, receiver = np.divmod(link, self._robots)
        arena, sender = np.divmod(row, self._robots)
        return {"arena": arena, "sender": sender, "receiver": receiver, "fate": fate, "packets": self._packets}

    def _merge(self) -> None:
        """Sort the pending rows and merge them into the sorted ones."""
        new, counts = np.unique(np.concatenate([np.zeros(0, np.int64), *self._pending]), return_counts=True)
        self._pending, self._rows = [], 0
        self._key, index = np.unique(np.concatenate([self._key, new]), return_inverse=True)
        packets = np.zeros(len(self._key), np.int64)
        np.add.at(packets, index, np.concatenate([self._packets, counts]))
        self._packets = packets
