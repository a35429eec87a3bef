"""The log of one robot: what it did in each step, and what its radio sent and received."""

from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path

import numpy as np

from swarmwire.comms.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.config import from_json
from swarmwire.metrics.real_log.about import ROBOT, AboutRobot, read_about_robot
from swarmwire.metrics.real_log.log_table import LogTable

TICKS, RECEIVED, SENT, SUMMARY = "ticks.csv", "received.csv", "sent.csv", "summary.json"
POSE = ("x_m", "y_m", "heading_rad")
COMMAND = ("linear_mps", "angular_radps")
TICK_COLUMNS = ("t_s", *POSE, *COMMAND, "state", "value")
RECEIVED_COLUMNS = ("t_s", "tx", "rx", "seq", "to", "size_bytes", "tag", "latency_s", "distance_m")
SENT_COLUMNS = ("t_s", "seq", "to", "size_bytes", "tag", "fate")
TOO_LARGE = "too_large"


@dataclass(frozen=True)
class Steps:
    """A row per step of the robot, in the order of time."""

    time_s: FloatArray  # (n,) UTC since 1970
    pose: FloatArray  # (n, 3) x, y in m, heading in rad, tracker's frame; NaN: not known
    command: FloatArray  # (n, 2) forward m/s, left turn rad/s, as handed to the driver
    state: list[str]  # (n,) "": none
    value: FloatArray  # (n,) NaN: none


@dataclass(frozen=True)
class ReceivedPackets:
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
    def by_sender(self) -> "dict[str, ReceivedPackets]":
        """The packets of each sender."""
        names, of = np.unique(self.sender, return_inverse=True)
        rows = np.split(np.argsort(of, kind="stable"), np.cumsum(np.bincount(of, minlength=len(names)))[:-1])
        return {str(name): self.picked(own) for name, own in zip(names, rows, strict=False)}

    def picked(self, rows: IntArray) -> "ReceivedPackets":
        """Some of the packets, by their rows."""
        return ReceivedPackets(**{field.name: getattr(self, field.name)[rows] for field in fields(self)})

    @property
    def sent_s(self) -> FloatArray:
        """When they had been sent, (k,); where the latency is not known, when they arrived."""
        return self.time_s - np.nan_to_num(self.latency_s)


@dataclass(frozen=True)
class SentPackets:
    """A row per packet that the agent handed to the radio."""

    time_s: FloatArray  # (k,) UTC since 1970
    sequence: IntArray  # (k,)
    to: AnyArray  # (k,) names; "": everybody
    size_bytes: IntArray  # (k,)
    tag: AnyArray  # (k,) names
    too_large: BoolArray  # (k,) refused by the radio


@dataclass(frozen=True)
class RobotLog:
    """A robot's folder, read."""

    about: AboutRobot
    where: str
    steps: Steps
    received: ReceivedPackets
    sent: SentPackets
    ended: str | None  # None: it was killed
    half_lines: tuple[str, ...]  # files that ended in half a line, which was dropped

    @property
    def name(self) -> str:
        """The robot's name."""
        return self.about.name


def read_robot_log(folder: Path) -> RobotLog:
    """The log in this folder; BadInput names file, row and column of what cannot be."""
    about = read_about_robot(folder / ROBOT)
    ticks, received, sent = (
        LogTable(folder / name, columns)
        for name, columns in ((TICKS, TICK_COLUMNS), (RECEIVED, RECEIVED_COLUMNS), (SENT, SENT_COLUMNS))
    )
    halves = tuple(name for name, of in ((TICKS, ticks), (RECEIVED, received), (SENT, sent)) if of.half_line)
    return RobotLog(about, str(folder), _steps(ticks), received_packets(received), _sent(sent), _ended(folder), halves)


def received_packets(table: LogTable) -> ReceivedPackets:
    """The rows of a received.csv, whose columns latency_s and distance_m may be missing."""
    nothing = np.full(len(table), np.nan)
    latency_s, distance_m = (
        table.numbers(name) if name in table.columns else nothing for name in ("latency_s", "distance_m")
    )
    has_more = "size_bytes" in table.columns
    return ReceivedPackets(
        table.times_s(),
        np.array(table.texts("tx"), np.str_),
        table.whole_numbers("seq"),
        np.array(table.words("to") if "to" in table.columns else [""] * len(table), np.str_),
        table.whole_numbers("size_bytes") if has_more else np.zeros(len(table), np.int64),
        np.array(table.words("tag") if "tag" in table.columns else [""] * len(table), np.str_),
        latency_s,
        distance_m,
    )


def _steps(table: LogTable) -> Steps:
    time_s = table.times_s()
    back = np.append(False, np.diff(time_s) <= 0.0)
    table.refuse_where(back, "t_s", "does not rise; expected steps in the order of time")
    pose = np.stack([table.numbers(name) for name in POSE], axis=1)
    pose[np.isnan(pose).any(axis=1)] = np.nan
    command = np.nan_to_num(np.stack([table.numbers(name) for name in COMMAND], axis=1))
    return Steps(time_s, pose, command, table.words("state"), table.numbers("value"))


def _sent(table: LogTable) -> SentPackets:
    too_large = np.array([fate == TOO_LARGE for fate in table.words("fate")], np.bool_)
    return SentPackets(
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
