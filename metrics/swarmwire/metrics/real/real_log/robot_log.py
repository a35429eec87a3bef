"""The log of a robot: its description, its steps, and the packets that its radio sent and received."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from io import BytesIO
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.config import from_json, read_json
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.robot.bodies.body import Body, body_from_mapping
from swarmwire.metrics.records.table_file import MeasuredTable, corruption_errors

LOG_FORMAT = 1
ROBOT = "robot.json"
MAX_TIME_S = 9e9  # its nanoseconds fit 64 bits
TICKS, RECEIVED, SENT, SUMMARY = "ticks.csv", "received.csv", "sent.csv", "summary.json"
POSE = ("x_m", "y_m", "heading_rad")
COMMAND = ("linear_mps", "angular_radps")
TICK_COLUMNS = ("t_s", *POSE, *COMMAND, "state", "value")
RECEIVED_COLUMNS = ("t_s", "tx", "rx", "seq", "to", "size_bytes", "tag", "latency_s", "distance_m")
SENT_COLUMNS = ("t_s", "seq", "to", "size_bytes", "tag", "fate")
TOO_LARGE = "too_large"


@dataclass(frozen=True)
class LoggedRadio:
    """The radio in robot.json."""

    kind: str  # "world": packets were sent over the radio of a run


@dataclass(frozen=True)
class AboutRobot:
    """The parts of robot.json that are read."""

    name: str
    swarm: str
    robots: tuple[str, ...]  # all robots of the swarm, by index
    agent: str  # the robot's setting; "": unknown, as are params and body
    agent_sha256: str
    params: dict[str, Any]
    body: dict[str, Any]  # data sheet
    rate_hz: float
    started_utc_ns: int
    radio: LoggedRadio


@dataclass(frozen=True)
class Steps:
    """A row per step of the robot, in the order of time."""

    time_s: FloatArray  # (n,) UTC since 1970
    pose: FloatArray  # (n, 3) x, y in m, heading in rad, tracker's frame; NaN: unknown
    command: FloatArray  # (n, 2) forward m/s, left turn rad/s, input of the driver; NaN: unknown
    state: list[str]  # (n,) "": none
    value: FloatArray  # (n,) NaN: none


@dataclass(frozen=True)
class LoggedReceptions:
    """A row per packet that arrived, including packets addressed to others."""

    time_s: FloatArray  # (k,) arrival, UTC since 1970
    sender: AnyArray  # (k,) names
    sequence: IntArray  # (k,)
    to: AnyArray  # (k,) names; "": broadcast
    size_bytes: IntArray  # (k,)
    tag: AnyArray  # (k,) names
    latency_s: FloatArray  # (k,) by the clocks of both robots; NaN: unknown
    distance_m: FloatArray  # (k,) NaN: unknown

    @cached_property
    def by_sender(self) -> "dict[str, LoggedReceptions]":
        """Packets of each sender."""
        names, sender = np.unique(self.sender, return_inverse=True)
        ends = np.cumsum(np.bincount(sender, minlength=len(names)))
        parts = np.split(np.argsort(sender, kind="stable"), ends[:-1])
        return {str(name): self.rows(part) for name, part in zip(names, parts, strict=False)}

    def rows(self, rows: IntArray) -> "LoggedReceptions":
        """Return the selected rows."""
        return LoggedReceptions(**{field.name: getattr(self, field.name)[rows] for field in fields(self)})

    @property
    def sent_s(self) -> FloatArray:
        """Times of sending, (k,); the arrival, if the latency is unknown."""
        return self.time_s - np.nan_to_num(self.latency_s)


@dataclass(frozen=True)
class LoggedTransmissions:
    """A row per packet that the agent sent."""

    time_s: FloatArray  # (k,) UTC since 1970
    sequence: IntArray  # (k,)
    to: AnyArray  # (k,) names; "": broadcast
    size_bytes: IntArray  # (k,)
    tag: AnyArray  # (k,) names
    too_large: BoolArray  # (k,) refused by the radio


@dataclass(frozen=True)
class RealRobotLog:
    """The content of a robot's folder."""

    about: AboutRobot
    body: Body | None  # None: unknown
    where: str
    steps: Steps
    received: LoggedReceptions
    sent: LoggedTransmissions
    ended: str | None  # None: the robot was killed
    half_lines: tuple[str, ...]  # files with an incomplete last line, which was dropped

    @property
    def name(self) -> str:
        """The robot's name."""
        return self.about.name


def read_robot_log(folder: Path) -> RealRobotLog:
    """Read the log in a folder; BadInput names file, row and column of an invalid value."""
    about = read_about_robot(folder / ROBOT)
    ticks, received, sent = (
        LogTable(folder / name, columns)
        for name, columns in ((TICKS, TICK_COLUMNS), (RECEIVED, RECEIVED_COLUMNS), (SENT, SENT_COLUMNS))
    )
    tables = ((TICKS, ticks), (RECEIVED, received), (SENT, sent))
    return RealRobotLog(
        about=about,
        body=body_from_mapping(about.body, str(folder / ROBOT)),
        where=str(folder),
        steps=_steps(ticks),
        received=received_packets(received),
        sent=_sent(sent),
        ended=_ended(folder),
        half_lines=tuple(name for name, table in tables if table.half_line),
    )


def read_about_robot(path: Path) -> AboutRobot:
    """Read robot.json of a log; BadInput if it is missing, damaged, or of another format."""
    about = read_json(AboutRobot, path, LOG_FORMAT)
    if len(set(about.robots)) < len(about.robots):
        raise BadInput(str(path), "robots", "expected a list of names, each once")
    if about.name not in about.robots:
        raise BadInput(str(path), "name", f"expected one of robots, got {about.name!r}")
    if not (isfinite(about.rate_hz) and about.rate_hz > 0.0):
        raise BadInput(str(path), "rate_hz", f"expected more than 0 Hz, got {about.rate_hz:g}")
    return about


class LogTable(MeasuredTable):
    """The complete lines of a file, possibly none.

    Attributes:
        half_line: True if the last line was incomplete and dropped.
    """

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        """Read the file, all columns as texts; BadInput unless every line has these columns."""
        self.where = str(path)
        lines, self.half_line = _complete_lines(path)
        try:
            self._frame = pl.read_csv(BytesIO(lines), infer_schema=False) if lines else _empty(columns)
        except corruption_errors() as error:
            raise self.refused("", f"expected a table of a robot's log: {str(error).splitlines()[0]}") from None
        self.need(columns)

    def __len__(self) -> int:
        return len(self._frame)

    def complete_numbers(self, column: str, expected: str) -> FloatArray:
        """Return a column (rows,) of numbers; BadInput for an empty field."""
        values = self.numbers(column)
        self.refuse_where(np.isnan(values), column, f"expected {expected}")
        return values

    def times_s(self) -> FloatArray:
        """Return the column t_s (rows,), UTC since 1970; BadInput for an invalid time."""
        values = self.complete_numbers("t_s", "a time in s")
        self.refuse_where(np.abs(values) >= MAX_TIME_S, "t_s", "expected a time in s since 1970")
        return values

    def whole_numbers(self, column: str) -> IntArray:
        """Return a column (rows,) of whole numbers; BadInput for other values."""
        values = self.complete_numbers(column, "a whole number")
        self.refuse_where((np.abs(values) >= 2.0**53) | (values % 1 != 0), column, "expected a whole number")
        return values.astype(np.int64)

    def optional_texts(self, column: str) -> list[str]:
        """Return a column (rows,) of texts; fields may be empty."""
        return self._frame[column].fill_null("").to_list()


def received_packets(table: LogTable) -> LoggedReceptions:
    """Return the rows of a received.csv; all columns but t_s, tx and seq are optional."""

    def numbers(name: str) -> FloatArray:
        return table.numbers(name) if name in table.columns else np.full(len(table), np.nan)

    def texts(name: str) -> AnyArray:
        return np.array(table.optional_texts(name) if name in table.columns else [""] * len(table), np.str_)

    has_sizes = "size_bytes" in table.columns
    return LoggedReceptions(
        time_s=table.times_s(),
        sender=np.array(table.texts("tx"), np.str_),
        sequence=table.whole_numbers("seq"),
        to=texts("to"),
        size_bytes=table.whole_numbers("size_bytes") if has_sizes else np.zeros(len(table), np.int64),
        tag=texts("tag"),
        latency_s=numbers("latency_s"),
        distance_m=numbers("distance_m"),
    )


def _complete_lines(path: Path) -> tuple[bytes, bool]:
    """Return the complete lines, and True if an incomplete one follows."""
    try:
        lines, end, incomplete = path.read_bytes().rpartition(b"\n")
    except OSError as error:
        raise BadInput(str(path), "", f"expected a table of a robot's log: {error.strerror}") from None
    return lines + end, bool(incomplete)


def _empty(columns: Sequence[str]) -> pl.DataFrame:
    return pl.DataFrame(schema=dict.fromkeys(columns, pl.String))


def _steps(table: LogTable) -> Steps:
    time_s = table.times_s()
    falls = np.append(False, np.diff(time_s) <= 0.0)
    table.refuse_where(falls, "t_s", "does not rise; expected steps in the order of time")
    pose = np.stack([table.numbers(name) for name in POSE], axis=1)
    pose[np.isnan(pose).any(axis=1)] = np.nan
    command = np.nan_to_num(np.stack([table.numbers(name) for name in COMMAND], axis=1))
    return Steps(time_s, pose, command, table.optional_texts("state"), table.numbers("value"))


def _sent(table: LogTable) -> LoggedTransmissions:
    too_large = np.array([fate == TOO_LARGE for fate in table.optional_texts("fate")], np.bool_)
    return LoggedTransmissions(
        table.times_s(),
        table.whole_numbers("seq"),
        np.array(table.optional_texts("to"), np.str_),
        table.whole_numbers("size_bytes"),
        np.array(table.optional_texts("tag"), np.str_),
        too_large,
    )


def _ended(folder: Path) -> str | None:
    """Return the summary's `ended`; None for a missing or incomplete summary."""
    try:
        return str(from_json((folder / SUMMARY).read_text(encoding="utf-8"))["ended"])
    except (OSError, ValueError, KeyError, TypeError):
        return None
