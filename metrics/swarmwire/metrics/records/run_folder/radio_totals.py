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
# Decided before any receiver is: by the sender alone, or of receivers that are not listed.
SENDERS_FATES = {
    Fate.OUT_OF_RANGE,
    Fate.QUEUE_FULL,
    Fate.TOO_LARGE,
    Fate.IN_FLIGHT,
    Fate.SENDER_DEAD,
    Fate.CHANNEL_BUSY,
}
RECEIVERS_FATES = tuple(fate for fate in Fate if fate not in SENDERS_FATES)
FATES = len(FATE_NAMES)
NOT_FINAL = FATE_NAMES[Fate.IN_FLIGHT]  # the summary counts packets too that never left their sender's radio
# Fates that every receiver has on a link of its own.
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
    )
)
WAITING_ROWS = 250_000  # before they are added up


class RadioRobots(RecordedTable):
    """A row per robot over the whole run; none without a radio, nor of a killed run.

    Columns: arena, robot (name); of its own packets: packets (that left its radio, refused ones too), packets_on_air,
    airtime_s, airtime (share of the run), intended (receivers), as_sender_FATE for every fate (receivers, which add up
    to intended); of those of others: as_receiver_FATE (packets that might have reached it; out of range is not
    counted), received_bytes (payload with tags), throughput_bps (over the run).

    A packet that never left the sender's radio until the run ended is not counted. Of a packet sent again for want of
    an acknowledgement the airtime of one try is; that of acknowledgements is not.
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
        **{f"as_receiver_{FATE_NAMES[fate]}": pl.Int64 for fate in RECEIVERS_FATES},
    }

    def recorder(self, options: RecordOptions) -> Observer | None:
        """A recorder, which writes nothing without a radio."""
        return TotalsRecorder(options.folder, self.name, RobotCounts)

    def max_rows(self, static: Static, ticks: int) -> int:
        """One for each robot."""
        return static.arenas * static.robots

    def compare(self, files: list[Path], summary: Mapping[str, Any] | None) -> Verdict:
        """As many receivers of each fate over all senders, and of fates that links have over all receivers too."""
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
        """Also robots that do not stand in the order of static.json, arena after arena."""
        return super().fault(table, static) or (None if static is None else _names_fault(table, static))


def _names_fault(table: pl.LazyFrame, static: Static) -> str | None:
    found = table.select("arena", "robot").collect().rows()
    expected = [(arena, robot) for arena in range(static.arenas) for robot in static.robot_names]
    if len(found) != len(expected):
        return f"{len(found)} robots; static.json has {len(expected)}"
    for (arena, robot), other in zip(expected, found, strict=True):
        if (arena, robot) != other:
            return f"{other[1]} (arena {other[0]}) stands in the place of {robot} (arena {arena}) of static.json"
    return None


class RobotCounts(Totals):
    """Packets counted for each robot row, as sender and as receiver; O(robots) memory.

    Attributes:
        packets: (rows,) that left its radio, refused ones too.
        packets_on_air: (rows,) of these, that it put on air.
        on_air_ns: (rows,) their airtime.
        intended: (rows,) receivers that its packets were meant for.
        as_sender: (rows, fates) these receivers by the packet's fate, as far as it is final.
        as_receiver: (rows, fates) packets that might have reached it, by fate.
        received_bytes: (rows,) payload that it received, with tags.
    """

    def __init__(self, static: Static) -> None:
        self._static, self._robots, self._rows = static, static.robots, static.arenas * static.robots
        self._ticks = np.zeros(static.arenas, np.int64)  # of each arena
        self.packets, self.packets_on_air, self.on_air_ns = self._zeros(), self._zeros(), self._zeros()
        self.intended, self.received_bytes = self._zeros(), self._zeros()
        self.as_sender: IntArray = np.zeros((self._rows, FATES), np.int64)
        self.as_receiver: IntArray = np.zeros((self._rows, FATES), np.int64)

    def see(self, truth: Truth) -> None:
        """Add what a tick brought."""
        self._ticks += truth.running
        if truth.departed is not None and truth.finished is not None:
            self.add(truth.departed, truth.finished)

    def frame(self) -> pl.DataFrame:
        """A row per arena and robot."""
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
            **{f"as_receiver_{FATE_NAMES[fate]}": self.as_receiver[:, fate] for fate in RECEIVERS_FATES},
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
        """Receivers of packets that left the radio, whose fates are not final yet, (rows,)."""
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


def _add(to: IntArray, place: IntArray, amount: IntArray | None = None) -> None:
    """Add amounts, 1 each if left out, at places of the flattened table."""
    np.add.at(to.reshape(-1), place, 1 if amount is None else amount)


class RadioLinks(RecordedTable):
    """A row per link and fate that occurred on it.

    Columns: arena, sender and receiver (indices), fate, packets. Receivers out of range have no rows, nor has a packet
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
        """A recorder, if links are to be recorded."""
        return TotalsRecorder(options.folder, self.name, LinkCounts) if options.links else None

    def max_rows(self, static: Static, ticks: int) -> int:
        """One for each link and fate."""
        return static.arenas * static.robots**2 * len(Fate)

    def compare(self, files: list[Path], summary: Mapping[str, Any] | None) -> Verdict:
        """As many packets of each fate that only links have, over all links."""
        found = scan_files(files).group_by("arena", "fate").agg(pl.col("packets").sum()).collect()
        return compare_fates(
            {(arena, fate): packets for arena, fate, packets in found.iter_rows()}, LINK_FATES, summary
        )


class LinkCounts(Totals):
    """Packets counted by (arena, sender, receiver, fate); memory grows with the links that occurred, not with time."""

    def __init__(self, static: Static) -> None:
        self._robots = static.robots
        self._key: IntArray = np.zeros(0, np.int64)  # rising
        self._packets: IntArray = np.zeros(0, np.int64)
        self._waiting: list[IntArray] = []
        self._rows = 0

    def see(self, truth: Truth) -> None:
        """Add what a tick brought."""
        if truth.finished is not None:
            self.add(truth.finished)

    def frame(self) -> pl.DataFrame:
        """A row per arena, sender, receiver and fate."""
        columns: dict[str, Any] = dict(self.columns())
        columns["fate"] = pl.Series(FATE_NAMES).gather(columns["fate"])
        return pl.DataFrame(columns, schema_overrides=RadioLinks.types)

    def add(self, finished: ReceptionRecords) -> None:
        """Add packets whose fate is final."""
        rows = np.flatnonzero(finished.receiver != NO_ROBOT)
        link = (finished.arena[rows] * self._robots + finished.sender[rows]) * self._robots + finished.receiver[rows]
        self._waiting.append(link * FATES + finished.fate[rows])
        self._rows += len(rows)
        if self._rows >= WAITING_ROWS:
            self._add_up()

    def columns(self) -> dict[str, IntArray]:
        """arena, sender, receiver, fate and packets, a row per combination that occurred, in that order."""
        self._add_up()
        link, fate = np.divmod(self._key, FATES)
        row, receiver = np.divmod(link, self._robots)
        arena, sender = np.divmod(row, self._robots)
        return {"arena": arena, "sender": sender, "receiver": receiver, "fate": fate, "packets": self._packets}

    def _add_up(self) -> None:
        """Sort what waits and merge it in: so often that sorting costs little, so seldom that merging does."""
        new, counts = np.unique(np.concatenate([np.zeros(0, np.int64), *self._waiting]), return_counts=True)
        self._waiting, self._rows = [], 0
        self._key, place = np.unique(np.concatenate([self._key, new]), return_inverse=True)
        packets = np.zeros(len(self._key), np.int64)
        np.add.at(packets, place, np.concatenate([self._packets, counts]))
        self._packets = packets
