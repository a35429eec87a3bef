"""A campaign: what is run, at which points, with which seeds, as `campaign.json` says before the first run."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from swarmwire.comms.config import from_json
from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.columns import Columns
from swarmwire.deploy.campaign.design import Point
from swarmwire.deploy.record.known_fields import known_fields
from swarmwire.deploy.record.scenario_copy import CopiedFile
from swarmwire.metrics.atomic import write_text
from swarmwire.metrics.campaign.about import read_about
from swarmwire.metrics.campaign.formats import ABOUT, CAMPAIGN_FORMAT
from swarmwire.metrics.campaign.response import Response

SCENARIO_FOLDER = "scenario"


@dataclass(frozen=True)
class Campaign:
    """All that a campaign is made from. Run number = point * number of seeds + place of the seed."""

    name: str
    scenario: str  # its name
    command: str  # that began it
    began_utc: str
    versions: Mapping[str, str]
    cpu: str
    modules: Mapping[str, str]  # sha256 of the installed code, by module
    files: tuple[CopiedFile, ...]  # in the folder of the scenario
    design: str  # "grid" | "list" | "random" | "latin"
    seeds: tuple[int, ...]  # the same at every point
    vary: Mapping[str, Any]  # by path: the list of values, or {"from", "to"}
    points: tuple[Point, ...]
    overrides: tuple[str, ...]  # of all points, which the scenario in the folder has in it
    point_overrides: tuple[tuple[str, ...], ...]  # of each point, for the scenario in the folder
    duration_s: float
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

    def columns(self) -> Columns:
        """The columns of its rows."""
        varied = {path: [point[path] for point in self.points] for path in self.vary}
        return Columns(varied, [response.column for response in self.responses])

    def write(self, folder: Path) -> None:
        """Write `campaign.json`; OSError if the disk will not."""
        write_text(folder / ABOUT, json.dumps({"format": CAMPAIGN_FORMAT, **asdict(self)}, indent=1) + "\n")


def read_campaign(folder: Path) -> Campaign:
    """The campaign of this folder; BadInput if there is none."""
    path = folder / ABOUT
    try:
        found: Any = from_json(path.read_text(encoding="utf-8"))
    except OSError as error:
        expected = f"expected a campaign's folder, with its {ABOUT}: {error.strerror}"
        if (folder / SCENARIO_FOLDER).is_dir():
            expected += "; if it was ended before its first run, take the folder away and begin again"
        raise BadInput(str(folder), "", expected) from None
    except ValueError:  # no JSON, or no UTF-8
        found = None
    read_about(path)  # refuses another format, and names the key of what is wrong in all that reports read
    try:
        campaign = _campaign(found)
    except (KeyError, TypeError, ValueError):
        raise BadInput(str(path), "", "expected what swarmwire writes at the start of a campaign") from None
    _check(campaign, str(path))
    return campaign


def _check(campaign: Campaign, where: str) -> None:
    """BadInput for what only those who run a campaign need of it."""
    overrides, batch = campaign.point_overrides, campaign.batch
    texts: Any = [text for of_point in overrides for text in of_point]
    good = {
        "point_overrides": len(overrides) == len(campaign.points) and all(isinstance(text, str) for text in texts),
        "robots": _is_count(campaign.robots),
        "batch": batch is None or _is_count(batch),
        "record_seeds": set(campaign.record_seeds) <= set(campaign.seeds),
    }
    for key, is_good in good.items():
        if not is_good:
            raise BadInput(where, key, "expected what swarmwire writes at the start of a campaign")


def _is_count(value: object) -> bool:
    return type(value) is int and value >= 1


def _campaign(found: dict[str, Any]) -> Campaign:
    tuples: dict[str, Any] = {name: tuple(found[name]) for name in ("seeds", "points", "overrides", "record_seeds")}
    objects: dict[str, Any] = {
        "files": tuple(CopiedFile(**known_fields(CopiedFile, file)) for file in found["files"]),
        "responses": tuple(Response(**known_fields(Response, response)) for response in found["responses"]),
        "point_overrides": tuple(tuple(texts) for texts in found["point_overrides"]),
    }
    return Campaign(**{**known_fields(Campaign, found), **tuples, **objects})
