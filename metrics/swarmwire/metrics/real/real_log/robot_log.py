"""The log of one robot: the robot, its steps, and the packets that its radio sent and received."""

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
LATEST_S = 9e9  # whose nanoseconds fit an integer
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

    kind: str  # "world": the packets went over a run's radio


@dataclass(frozen=True)
class AboutRobot:
    """robot.json, as far as it is read."""

    name: str
    swarm: str
    robots: tuple[str, ...]  # all of the swarm, in the order of their index
    agent: str  # as the robot's settings have it
    agent_sha256: str
    params: dict[str, Any]
    body: dict[str, Any]  # its data sheet
    rate_hz: float
    started_utc_ns: int
    radio: LoggedRadio


@dataclass(frozen=True)
class Steps:
    """A row per step of the robot, in the order of time."""

    time_s: FloatArray  # (n,) UTC since 1970
    pose: FloatArray  # (n, 3) x, y in m, heading in rad, tracker's frame; NaN: not known
    command: FloatArray  # (n, 2) forward m/s, left turn rad/s, as handed to the driver
    state: list[str]  # (n,) "": none
    value: FloatArray  # (n,) NaN: none


@dataclass(frozen=True)
class LoggedReceptions:
    """A row per packet that arrived, also of those that were addressed to others."""

    time_s: FloatArray  # (k,) UTC since 1970, when it arrived
    sender: AnyArray  # (k,) names
    sequence: IntArray  # (k,)
    to: AnyArray  # (k,) names; "": everybody
    size_bytes: IntArray  # (k,)
    tag: AnyArray  # (k,) names
    latency_s: FloatArray  # (k,) by the clocks of both robots; NaN: not known
    distance_m: FloatArray  # (k,) NaN: not known

    @cached_property
    def by_sender(self) -> "dict[str, LoggedReceptions]":
        """The packets of each sender."""
        names, of = np.unique(self.sender, return_inverse=True)
        rows = np.split(np.argsort(of, kind="stable"), np.cumsum(np.bincount(of, minlength=len(names)))[:-1])
        return {str(name): self.picked(own) for name, own in zip(names, rows, strict=False)}

    def picked(self, rows: IntArray) -> "LoggedReceptions":
        """Some of the packets, by their rows."""
        return LoggedReceptions(**{field.name: getattr(self, field.name)[rows] for field in fields(self)})

    @property
    def sent_s(self) -> FloatArray:
        """When they had been sent, (k,); where the latency is not known, when they arrived."""
        return self.time_s - np.nan_to_num(self.latency_s)


@dataclass(frozen=True)
class LoggedTransmissions:
    """A row per packet that the agent handed to the radio."""

    time_s: FloatArray  # (k,) UTC since 1970
    sequence: IntArray  # (k,)
    to: AnyArray  # (k,) names; "": everybody
    size_bytes: IntArray  # (k,)
    tag: AnyArray  # (k,) names
    too_large: BoolArray  # (k,) refused by the radio


@dataclass(frozen=True)
class RealRobotLog:
    """A robot's folder, read."""

    about: AboutRobot
    body: Body
    where: str
    steps: Steps
    received: LoggedReceptions
    sent: LoggedTransmissions
    ended: str | None  # None: it was killed
    half_lines: tuple[str, ...]  # files that ended in half a line, which was dropped

    @property
    def name(self) -> str:
        """The robot's name."""
        return self.about.name


def read_robot_log(folder: Path) -> RealRobotLog:
    """The log in this folder; BadInput names file, row and column of what cannot be."""
    about = read_about_robot(folder / ROBOT)
    ticks, received, sent = (
        LogTable(folder / name, columns)
        for name, columns in ((TICKS, TICK_COLUMNS), (RECEIVED, RECEIVED_COLUMNS), (SENT, SENT_COLUMNS))
    )
    halves = tuple(name for name, of in ((TICKS, ticks), (RECEIVED, received), (SENT, sent)) if of.half_line)
    body = body_from_mapping(about.body, str(folder / ROBOT))
    return RealRobotLog(
        about, body, str(folder), _steps(ticks), received_packets(received), _sent(sent), _ended(folder), halves
    )


def read_about_robot(path: Path) -> AboutRobot:
    """The robot of a log; BadInput if the file is missing, damaged, or of another format."""
    about = read_json(AboutRobot, path, LOG_FORMAT)
    if len(set(about.robots)) < len(about.robots):
        raise BadInput(str(path), "robots", "expected a list of names, each once")
    if about.name not in about.robots:
        raise BadInput(str(path), "name", f"expected one of robots, got {about.name!r}")
    if not (isfinite(about.rate_hz) and about.rate_hz > 0.0):
        raise BadInput(str(path), "rate_hz", f"expected more than 0 Hz, got {about.rate_hz:g}")
    return about


class LogTable(MeasuredTable):
    """The whole lines of a file, of which there may be none.

    Attributes:
        half_line: whether the file ended in half a line, which was dropped.
    """

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        """Read the file, all columns as texts; BadInput unless it has these columns, or if a line has others."""
        self.where = str(path)
        whole, half = _whole_lines(path)
        self.half_line = half
        try:
            self._frame = pl.read_csv(BytesIO(whole), infer_schema=False) if whole else _empty(columns)
        except corruption_errors() as error:
            raise self.refused("", f"expected a table of a robot's log: {str(error).splitlines()[0]}") from None
        self.need(columns)

    def __len__(self) -> int:
        return len(self._frame)

    def known(self, column: str, expected: str) -> FloatArray:
        """A column (rows,) without empty fields; BadInput where there is one."""
        values = self.numbers(column)
        self.refuse_where(np.isnan(values), column, f"expected {expected}")
        return values

    def times_s(self) -> FloatArray:
        """The column t_s (rows,), UTC since 1970; BadInput for what is no time."""
        values = self.known("t_s", "a time in s")
        self.refuse_where(np.abs(values) >= LATEST_S, "t_s", "expected a time in s since 1970")
        return values

    def whole_numbers(self, column: str) -> IntArray:
        """A column (rows,) of whole numbers; BadInput for others."""
        values = self.known(column, "a whole number")
        self.refuse_where((np.abs(values) >= 2.0**53) | (values % 1 != 0), column, "expected a whole number")
        return values.astype(np.int64)

    def words(self, column: str) -> list[str]:
        """A column (rows,) of texts, of which some may be empty."""
        return self._frame[column].fill_null("").to_list()


def received_packets(table: LogTable) -> LoggedReceptions:
    """The rows of a received.csv, whose columns latency_s and distance_m may be missing."""
    nothing = np.full(len(table), np.nan)
    latency_s, distance_m = (
        table.numbers(name) if name in table.columns else nothing for name in ("latency_s", "distance_m")
    )
    has_more = "size_bytes" in table.columns
    return LoggedReceptions(
        table.times_s(),
        np.array(table.texts("tx"), np.str_),
        table.whole_numbers("seq"),
        np.array(table.words("to") if "to" in table.columns else [""] * len(table), np.str_),
        table.whole_numbers("size_bytes") if has_more else np.zeros(len(table), np.int64),
        np.array(table.words("tag") if "tag" in table.columns else [""] * len(table), np.str_),
        latency_s,
        distance_m,
    )


def _whole_lines(path: Path) -> tuple[bytes, bool]:
    """The lines that were written to their end, and whether there was half of one more."""
    try:
        whole, end, half = path.read_bytes().rpartition(b"\n")
    except OSError as error:
        raise BadInput(str(path), "", f"expected a table of a robot's log: {error.strerror}") from None
    return whole + end, bool(half)


def _empty(columns: Sequence[str]) -> pl.DataFrame:
    return pl.DataFrame(schema=dict.fromkeys(columns, pl.String))


def _steps(table: LogTable) -> Steps:
    time_s = table.times_s()
    back = np.append(False, np.diff(time_s) <= 0.0)
    table.refuse_where(back, "t_s", "does not rise; expected steps in the order of time")
    pose = np.stack([table.numbers(name) for name in POSE], axis=1)
    pose[np.isnan(pose).any(axis=1)] = np.nan
    command = np.nan_to_num(np.stack([table.numbers(name) for name in COMMAND], axis=1))
    return Steps(time_s, pose, command, table.words("state"), table.numbers("value"))


def _sent(table: LogTable) -> LoggedTransmissions:
    too_large = np.array([fate == TOO_LARGE for fate in table.words("fate")], np.bool_)
    return LoggedTransmissions(
        table.times_s(),
        table.whole_numbers("seq"),
        np.array(table.words("to"), np.str_),
        table.whole_numbers("size_bytes"),
        np.array(table.words("tag"), np.str_),
        too_large,
    )


def _ended(folder: Path) -> str | None:
    """How it did, as the summary says; a summary that cannot be read was not written to its end."""
    try:
        return str(from_json((folder / SUMMARY).read_text(encoding="utf-8"))["ended"])
    except (OSError, ValueError, KeyError, TypeError):
        return None
