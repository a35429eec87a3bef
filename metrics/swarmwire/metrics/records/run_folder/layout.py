"""The files of a run folder, their formats, the columns of `ticks`, the metrics as run.json lists them, and the log."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isinf
from pathlib import Path
from typing import Any

from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.printable import LINES, printable
from swarmwire.metrics.measures.metric import Metric

SUMMARY = "summary.json"  # written last: where it is, the run is over
RUN_JSON = "run.json"  # from what the run was made, written first
SCENARIO = "scenario.toml"  # as run, with overrides and seed
STATIC = "static.json"  # arena, bodies and names: what does not change
RECORDING = "run.rrd"  # for the viewer
RECORDING_END = "end"  # its last property: where it is, the recording was closed
DIGESTS = "trajectory.digests"  # of each tick's state, for a repetition
INPUTS = "inputs/actions.frames"  # what came from outside
LIVE_EVENTS = "live_events.jsonl"  # commands of people during the run
LOG = "log.txt"  # messages, each with its time
DIGEST_BYTES = 8  # of each tick in DIGESTS
SUMMARY_FORMAT = 1  # of summary.json
RUN_FORMAT = 1  # of run.json
TABLES_FORMAT = 1  # of static.json, which has it, and of the tables

# Columns of the table `ticks`
POSE = ("x_m", "y_m", "heading_rad")  # arena frame
VELOCITY = ("vx_mps", "vy_mps", "turn_radps")  # arena frame
COMMAND = ("command_forward_mps", "command_turn_radps")  # as applied
SIDEWAYS = "command_left_mps"  # as applied; only where a robot can move so
MOTION = (*POSE, *VELOCITY, *COMMAND, SIDEWAYS)  # lists with a number per robot, float32
ROBOT_COLUMNS = (*POSE, *VELOCITY, *COMMAND, "alive", "state")  # lists with an item per robot, in every record
VALUE = "value"  # a list with a number per robot, float64; only once a robot has told one
MOVABLE = ("movable_x_m", "movable_y_m", "movable_heading_rad")  # lists with a number per movable obstacle, if any
RADIO = ("sent", "received", "in_range")  # packets; receivers; receivers: since the tick before
KEYS = ("tick", "time_s", "arena", "seed")
TICK_COLUMNS = (*KEYS, *ROBOT_COLUMNS, SIDEWAYS, VALUE, *MOVABLE, *RADIO)  # names that a metric cannot have


@dataclass(frozen=True)
class CopiedFile:
    """A file that a run needs to be repeated, as it was when the run began."""

    path: str  # within the run folder
    sha256: str
    # "scenario" | "agent" | "trace" | "map" | "ground" | "body" | "custom sensor" | "custom actuator" | "metric"
    what: str


@dataclass(frozen=True)
class MetricInfo:
    """A metric that a run measured."""

    name: str
    help: str  # one line: formula and unit
    unit: str
    kind: str  # "level", "count" or "time"
    bounds: tuple[float | None, float | None]  # least and largest value of a tick; None: there is none


def metric_info(metric: Metric | type[Metric]) -> MetricInfo:
    """The information that run.json keeps of a metric."""
    least, largest = (None if bound is None or isinf(bound) else float(bound) for bound in metric.bounds)
    return MetricInfo(metric.name, metric.help, metric.unit, metric.kind, (least, largest))


def metric_infos(started: Mapping[str, Any]) -> tuple[MetricInfo, ...]:
    """The metrics that `run.json` lists; KeyError, TypeError or ValueError if it does not list them as a run does."""
    return tuple(_info(item) for item in started["metrics"])


def _info(item: Any) -> MetricInfo:
    least, largest = item["bounds"]
    return MetricInfo(item["name"], item["help"], item["unit"], item["kind"], (least, largest))


class RunLog:
    """Appends messages to `log.txt`, each with its time; every line is in the file as soon as it was said.

    A log that cannot be written never disturbs a run: `lost` counts its lines.
    """

    def __init__(self, folder: Path, clock: WallClock | None = None) -> None:
        """Open the log of this run folder, which must be there; OSError if it cannot be written."""
        self.lost = 0
        self._clock = clock or WallClock()
        self._file = (folder / LOG).open("a", encoding="utf-8", buffering=1)

    def say(self, text: str) -> None:
        """Append a text; of several lines, those after the first are indented."""
        first, *more = printable(text, keep=LINES).rstrip("\n").split("\n")
        try:
            self._file.write(
                "\n".join([f"{self._clock.utc_stamp()} {first}", *(f"    {line}" for line in more)]) + "\n"
            )
        except OSError:
            self.lost += 1

    def close(self) -> None:
        """Close the file; safe to call more than once."""
        try:
            self._file.close()
        except OSError:
            self.lost += 1
