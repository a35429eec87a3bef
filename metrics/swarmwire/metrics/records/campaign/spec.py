"""A campaign as `campaign.json` says it before the first run: what is run, at which points, with which seeds.

Reports read it, and sweeps write it and resume from it, by the same model.
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

CAMPAIGN_FORMAT = 1  # of campaign.json and of the tables beside it; another is refused
ABOUT = "campaign.json"  # the campaign, written first
SUMMARY = "summary.parquet"  # a row per run, once all have ended
PARTS = "parts"  # the same rows before that, a file for each task
FAILED, STOPPED = "failed", "stopped"  # in the column `ended`
STOP_TIME = "stop_time_s"  # the column of the time of stopping
SERIES = "series"  # what the metrics were in every tick
SCENARIO_FOLDER = "scenario"  # from what the runs are made
FINAL = ".final"  # how columns end that hold the last value of a metric, which its bare name means
LINK_PDR = "radio.link_pdr"  # the column of received / receivers in range
ROUNDING = 1e-9  # relative: 0.1 + 0.2 is 0.3
WRITTEN = "expected the content that swarmwire writes at the start of a campaign"

Design = Literal["grid", "list", "random", "latin"]
Value = bool | int | float | str | list[Any] | Mapping[str, Any] | None  # of a parameter; a map is a TOML table
Point = Mapping[str, Value]  # path of each parameter that is varied -> its value there
Stat = Literal["q25", "q50", "q75", "mean", "censored"]  # quartiles, mean, and the share that was cut off
STATS: tuple[Stat, ...] = get_args(Stat)
USUAL: Stat = "q50"


@dataclass(frozen=True)
class Response:
    """One column. A `number` is what it is; a `time` may lack, since the run ended before it: right-censored."""

    column: str  # in summary.parquet, e.g. order.final
    unit: str  # "" if it has none
    kind: Kind
    help: str  # one line
    listed: bool = False  # of a metric that the scenario asks for, beside those of every run
    hold_s: float = 0.0  # of a time that is known only once something has held so long since
    label: str = ""  # in reports, in place of the title that its column gives

    def watched_s(self, end_s: FloatArray) -> FloatArray:
        """The censoring time of runs that ended at `end_s`: a state that began later had no time left to hold."""
        return np.maximum(end_s - self.hold_s, 0.0)

    @property
    def is_usual(self) -> bool:
        """Whether reports show it by default: a time, the last value of a metric, or the link PDR."""
        return self.kind == "time" or self.column.endswith(FINAL) or self.column == LINK_PDR


@dataclass(frozen=True)
class Provenance:
    """From what a campaign or a tuning was made: its scenario's files, the code and the machine."""

    scenario: str  # its name
    command: str  # that began it
    began_utc: str  # ISO 8601
    versions: Mapping[str, str]  # of Python and packages
    cpu: str
    modules: Mapping[str, str]  # sha256 of the installed code, by module
    files: tuple[CopiedFile, ...]  # in the folder of the scenario


@dataclass(frozen=True)
class Campaign(Provenance):
    """campaign.json. A run is a point with a seed; its number is point * number of seeds + place of the seed."""

    name: str
    design: Design
    seeds: tuple[int, ...]  # the same at every point
    vary: Mapping[str, list[Value] | Mapping[str, Value]]  # path -> values in order, or {"from", "to"}
    points: tuple[Point, ...]
    overrides: tuple[str, ...]  # of all points, which the scenario in the folder has in it
    point_overrides: tuple[tuple[str, ...], ...]  # of each point, for the scenario in the folder
    duration_s: float  # of a run that nothing stops
    robots: int  # in an arena, at the point that has most
    responses: tuple[Response, ...]
    series: bool  # whether each tick's metrics are kept
    record_seeds: tuple[int, ...]  # whose runs have run folders
    batch: int | None  # arenas in a world at most; None: as many as make sense

    @property
    def runs(self) -> int:
        """How many there are."""
        return len(self.points) * len(self.seeds)

    def point_of(self, run: int) -> int:
        """The number of a run's design point."""
        return run // len(self.seeds)

    def seed_of(self, run: int) -> int:
        """A run's seed."""
        return self.seeds[run % len(self.seeds)]


def read_campaign(folder: Path) -> Campaign:
    """The campaign of this folder; BadInput if there is none, if it is damaged, or of another format."""
    path = folder / ABOUT
    if (folder / SCENARIO_FOLDER).is_dir() and not path.exists():
        expected = "is missing: the campaign ended before its first run; remove the folder and begin again"
        raise BadInput(str(folder), ABOUT, expected)
    if (folder / STATIC).exists() and not path.exists():
        raise BadInput(str(folder), "", "expected the folder of a campaign, which `swarmwire sweep` makes; got a run's")
    campaign = read_json(Campaign, path, CAMPAIGN_FORMAT)
    varied = set(campaign.vary)
    good = {
        "seeds": 0 < len(campaign.seeds) == len(set(campaign.seeds)),
        "points": bool(campaign.points),
        **{f"points[{place}]": set(point) == varied for place, point in enumerate(campaign.points)},
        "point_overrides": len(campaign.point_overrides) == len(campaign.points),
        "robots": campaign.robots >= 1,
        "batch": campaign.batch is None or campaign.batch >= 1,
        "record_seeds": set(campaign.record_seeds) <= set(campaign.seeds),
    }
    for key, is_good in good.items():
        if not is_good:
            raise BadInput(str(path), key, WRITTEN)
    return campaign


def write_campaign(campaign: Campaign, folder: Path) -> None:
    """Write `campaign.json`; OSError if the disk will not."""
    write_text(folder / ABOUT, json.dumps({"format": CAMPAIGN_FORMAT, **asdict(campaign)}, indent=1) + "\n")


class Statistic(NamedTuple):
    """One number of the runs of a point: which response, and what of its values."""

    response: Response
    stat: Stat

    @property
    def name(self) -> str:
        """As `statistic` reads it."""
        return f"{self.response.column}.{self.stat}"


def find_response(name: str, responses: Iterable[Response], where: str = "--response") -> Response:
    """The response of this column; the bare name of a metric means its last value. BadInput if there is none."""
    known = {response.column: response for response in responses}
    found = known.get(name) or known.get(name + FINAL)
    if found is None:
        names = known if name.endswith(FINAL) else dict.fromkeys(column.removesuffix(FINAL) for column in known)
        raise BadInput(where, name, f"expected {did_you_mean(names, name)}")
    return found


def find_statistic(name: str, responses: Iterable[Response], where: str = "--response") -> Statistic:
    """The statistic that `COLUMN.STAT` names; the median if it names a column alone.

    Where a column itself ends like a statistic (order.mean) it is that column. BadInput for what there is not, and for
    the censored share of what is no time.
    """
    known = {response.column: response for response in responses}
    column, _, last = name.rpartition(".")
    stat: Stat | None = STATS[STATS.index(last)] if last in STATS else None
    if name in known or stat is None or not column:
        return Statistic(find_response(name, known.values(), where), USUAL)
    found = find_response(column, known.values(), where)
    if stat == "censored" and found.kind != "time":
        raise BadInput(where, name, "expected a time: of a number nothing is censored")
    return Statistic(found, stat)


def same_value(one: Value, other: Value) -> bool:
    """Whether they are equal, numbers but for rounding."""
    numbers = (int, float)
    if isinstance(one, bool) or isinstance(other, bool):
        return one is other
    if isinstance(one, numbers) and isinstance(other, numbers):
        return math.isclose(one, other, rel_tol=ROUNDING)
    return one == other


def value_from(text: str) -> Value:
    """What a person writes: a TOML value, else a text.

    >>> value_from("0.4"), value_from("true"), value_from("discs")
    (0.4, True, 'discs')
    """
    try:
        found = from_toml(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text.strip()
    return found["value"] if len(found) == 1 else text


def value_text(value: Value, digits: int = 9) -> str:
    """A value as a person reads it: so many digits of a number that need not be whole.

    >>> value_text(0.30000000000000004), value_text("discs"), value_text([1, 2])
    ('0.3', 'discs', '[1, 2]')
    """
    if isinstance(value, float):
        return f"{value:.{digits}g}"
    return value if isinstance(value, str) else json.dumps(value)


def point_text(point: Point, paths: Iterable[str] | None = None) -> str:
    """The values of a point, or of these paths in it.

    >>> point_text({"radio.loss": 0.2, "physics.engine": "discs"})
    'radio.loss=0.2, physics.engine=discs'
    """
    chosen = list(point) if paths is None else [path for path in paths if path in point]
    return ", ".join(f"{path}={value_text(point[path])}" for path in chosen)
