"""Model of `campaign.json`, which is written before the first run: scenario, design points, seeds and responses.

Sweeps write it and resume from it, and reports read it, by the same classes.
"""

import json
import math
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.atomic import write_text
from swarmwire.comms.base.config import did_you_mean, from_toml, read_json
from swarmwire.comms.base.errors import BadInput
from swarmwire.metrics.records.run_folder.layout import STATIC, CopiedFile
from swarmwire.metrics.statistics.sample import Kind

CAMPAIGN_FORMAT = 1  # format of campaign.json and of the tables of the folder; others are refused
CAMPAIGN_FILE = "campaign.json"  # the campaign, written first
SUMMARY = "summary.parquet"  # a row per run, once all have ended
PARTS = "parts"  # the same rows before that, a file for each task
FAILED, STOPPED = "failed", "stopped"  # values of the column `ended`
STOP_TIME = "stop_time_s"  # column of the stop time
SERIES = "series"  # the metrics of every tick
SCENARIO_FOLDER = "scenario"  # the scenario's files
FINAL = ".final"  # suffix of the columns of a metric's last value
LINK_PDR = "radio.link_pdr"  # column of received / receivers in range
ROUNDING = 1e-9  # relative: 0.1 + 0.2 is 0.3
EXPECTED_CONTENT = "expected the content that swarmwire writes at the start of a campaign"

Design = Literal["grid", "list", "random", "latin"]
Value = bool | int | float | str | list[Any] | Mapping[str, Any] | None  # a parameter's value; a map is a TOML table
Point = Mapping[str, Value]  # path of each varied parameter -> its value at the point
Stat = Literal["q25", "q50", "q75", "mean", "censored"]  # quartiles, mean, and the censored share
STATS: tuple[Stat, ...] = get_args(Stat)
DEFAULT_STAT: Stat = "q50"


@dataclass(frozen=True)
class Response:
    """A measured variable of the runs, one column. A `time` may be missing: the run ended first, right-censored."""

    column: str  #: name in summary.parquet, e.g. order.final
    unit: str  #: "" without a unit
    kind: Kind
    help: str  #: one line
    listed: bool = False  #: True for a metric that the scenario lists, in addition to the standard ones
    hold_s: float = 0.0  #: hold time after which the time is known
    label: str = ""  #: title for reports; "": derived from the column

    def watched_s(self, end_s: FloatArray) -> FloatArray:
        """Return the censoring times of runs that ended at `end_s`: a later start leaves less than the hold time."""
        return np.maximum(end_s - self.hold_s, 0.0)

    @property
    def is_usual(self) -> bool:
        """True if reports show it by default: a time, the last value of a metric, or the link PDR."""
        return self.kind == "time" or self.column.endswith(FINAL) or self.column == LINK_PDR


@dataclass(frozen=True)
class Provenance:
    """Origin of a campaign or a tuning: the scenario's files, the code and the machine."""

    scenario: str  #: name
    command: str  #: command that began it
    began_utc: str  #: ISO 8601
    versions: Mapping[str, str]  #: versions of Python and packages
    cpu: str
    modules: Mapping[str, str]  #: sha256 of the installed code, by module
    files: tuple[CopiedFile, ...]  #: files in the folder of the scenario


@dataclass(frozen=True)
class Campaign(Provenance):
    """Content of campaign.json. A run is a point with a seed; its number is point * seeds + index of the seed."""

    name: str
    design: Design
    seeds: tuple[int, ...]  #: the same at every point
    vary: Mapping[str, list[Value] | Mapping[str, Value]]  #: path -> values in order, or {"from", "to"}
    points: tuple[Point, ...]
    overrides: tuple[str, ...]  #: overrides of all points; the scenario in the folder includes them
    point_overrides: tuple[tuple[str, ...], ...]  #: overrides of each point, for the scenario in the folder
    duration_s: float  #: duration of a run without stop conditions
    robots: int  #: robots of an arena, at the point with the most
    responses: tuple[Response, ...]
    series: bool  #: True if each tick's metrics are recorded
    record_seeds: tuple[int, ...]  #: seeds whose runs have run folders
    batch: int | None  #: largest number of arenas in a world; None: chosen by the schedule
    realtime: float | None  #: simulated s per s of wall time; None: as fast as the machine allows
    max_late: float  #: in real time: a run with a larger share of late frames, or late ticks, has failed

    @property
    def runs(self) -> int:
        """Number of runs."""
        return len(self.points) * len(self.seeds)

    def point_of(self, run: int) -> int:
        """Return the number of a run's design point."""
        return run // len(self.seeds)

    def seed_of(self, run: int) -> int:
        """Return a run's seed."""
        return self.seeds[run % len(self.seeds)]


def read_campaign(folder: Path) -> Campaign:
    """Read the campaign of this folder; BadInput if there is none, if it is damaged, or of another format."""
    path = folder / CAMPAIGN_FILE
    if (folder / SCENARIO_FOLDER).is_dir() and not path.exists():
        expected = "is missing: the campaign ended before its first run; remove the folder and begin again"
        raise BadInput(str(folder), CAMPAIGN_FILE, expected)
    if (folder / STATIC).exists() and not path.exists():
        raise BadInput(str(folder), "", "expected the folder of a campaign, which `swarmwire sweep` makes; got a run's")
    campaign = read_json(Campaign, path, CAMPAIGN_FORMAT)
    varied = set(campaign.vary)
    checks = {
        "seeds": 0 < len(campaign.seeds) == len(set(campaign.seeds)),
        "points": bool(campaign.points),
        **{f"points[{index}]": set(point) == varied for index, point in enumerate(campaign.points)},
        "point_overrides": len(campaign.point_overrides) == len(campaign.points),
        "robots": campaign.robots >= 1,
        "max_late": 0.0 <= campaign.max_late <= 1.0,
        "realtime": campaign.realtime is None or campaign.realtime > 0.0,
        "batch": campaign.batch is None or campaign.batch >= 1,
        "record_seeds": set(campaign.record_seeds) <= set(campaign.seeds),
    }
    for key, is_valid in checks.items():
        if not is_valid:
            raise BadInput(str(path), key, EXPECTED_CONTENT)
    return campaign


def write_campaign(campaign: Campaign, folder: Path) -> None:
    """Write `campaign.json`; OSError if it cannot be written."""
    write_text(folder / CAMPAIGN_FILE, json.dumps({"format": CAMPAIGN_FORMAT, **asdict(campaign)}, indent=1) + "\n")


class Statistic(NamedTuple):
    """A statistic of a response over the runs of a point."""

    response: Response
    stat: Stat

    @property
    def name(self) -> str:
        """The name that `find_statistic` parses."""
        return f"{self.response.column}.{self.stat}"


def find_response(name: str, responses: Iterable[Response], where: str = "--response") -> Response:
    """Return the response of this column; a metric's name stands for its last value. BadInput if there is none."""
    by_column = {response.column: response for response in responses}
    response = by_column.get(name) or by_column.get(name + FINAL)
    if response is None:
        names = by_column if name.endswith(FINAL) else dict.fromkeys(c.removesuffix(FINAL) for c in by_column)
        raise BadInput(where, name, f"expected {did_you_mean(names, name)}")
    return response


def find_statistic(name: str, responses: Iterable[Response], where: str = "--response") -> Statistic:
    """Return the statistic of `COLUMN.STAT`, or the median of `COLUMN`.

    A column that ends like a statistic (order.mean) has precedence. BadInput for an unknown name, and for the censored
    share of a response that is no time.
    """
    by_column = {response.column: response for response in responses}
    column, _, last = name.rpartition(".")
    stat: Stat | None = STATS[STATS.index(last)] if last in STATS else None
    if name in by_column or stat is None or not column:
        return Statistic(find_response(name, by_column.values(), where), DEFAULT_STAT)
    response = find_response(column, by_column.values(), where)
    if stat == "censored" and response.kind != "time":
        raise BadInput(where, name, "expected a time: numbers are never censored")
    return Statistic(response, stat)


def same_value(first: Value, second: Value) -> bool:
    """Return True if two values are equal, numbers up to rounding."""
    numbers = (int, float)
    if isinstance(first, bool) or isinstance(second, bool):
        return first is second
    if isinstance(first, numbers) and isinstance(second, numbers):
        return math.isclose(first, second, rel_tol=ROUNDING)
    return first == second


def parse_value(text: str) -> Value:
    """Parse a TOML value; any other text stands for itself.

    >>> parse_value("0.4"), parse_value("true"), parse_value("discs")
    (0.4, True, 'discs')
    """
    try:
        table = from_toml(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text.strip()
    return table["value"] if len(table) == 1 else text


def value_text(value: Value, digits: int = 9) -> str:
    """Format a value for people, floats with `digits` digits.

    >>> value_text(0.30000000000000004), value_text("discs"), value_text([1, 2])
    ('0.3', 'discs', '[1, 2]')
    """
    if isinstance(value, float):
        return f"{value:.{digits}g}"
    return value if isinstance(value, str) else json.dumps(value)


def point_text(point: Point, paths: Iterable[str] | None = None) -> str:
    """Format the values of a point, or of these paths in it.

    >>> point_text({"radio.loss": 0.2, "physics.engine": "discs"})
    'radio.loss=0.2, physics.engine=discs'
    """
    chosen = list(point) if paths is None else [path for path in paths if path in point]
    return ", ".join(f"{path}={value_text(point[path])}" for path in chosen)
