"""A tuning: what is searched, for which goal, with which seeds, as `tuning.json` says before the first trial."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from swarmwire.comms.config import check_format, from_json
from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.campaign import SCENARIO_FOLDER
from swarmwire.deploy.record.known_fields import known_fields
from swarmwire.deploy.record.scenario_copy import CopiedFile
from swarmwire.deploy.tuning.goal import Goal
from swarmwire.deploy.tuning.search import Parameter, Search
from swarmwire.metrics.atomic import write_text
from swarmwire.metrics.campaign.response import Response
from swarmwire.metrics.run_folder.layout import SCENARIO

ABOUT = "tuning.json"
FORMAT = 1


@dataclass(frozen=True)
class Tuning:
    """All that a tuning is made from."""

    scenario: str  # its name
    command: str  # that began it
    began_utc: str
    versions: Mapping[str, str]
    cpu: str
    modules: Mapping[str, str]  # sha256 of the installed code, by module
    files: tuple[CopiedFile, ...]  # in the folder of the scenario
    overrides: tuple[str, ...]  # of all trials, which the scenario in the folder has in it
    searches: tuple[Search, ...]
    goal: Goal
    robots: int  # in an arena, at most, at either end of any range
    seeds: tuple[int, ...]  # the same in every trial
    check_seeds: tuple[int, ...]
    trials: int
    batch: int
    sampler: str
    sampler_seed: int

    def overrides_of(self, parameters: Mapping[str, Parameter]) -> tuple[str, ...]:
        """A trial's parameters as for `--set`, of the scenario in the folder."""
        return tuple(search.override(parameters[search.path]) for search in self.searches)

    def write(self, folder: Path) -> None:
        """Write `tuning.json`; OSError if the disk will not."""
        write_text(folder / ABOUT, json.dumps({"format": FORMAT, **asdict(self)}, indent=1) + "\n")


def scenario_file(folder: Path) -> Path:
    """The scenario in a tuning's folder, as tasks name it."""
    return (folder / SCENARIO_FOLDER / SCENARIO).absolute()


def read_tuning(folder: Path) -> Tuning:
    """The tuning of this folder; BadInput if there is none."""
    path = folder / ABOUT
    try:
        found: Any = from_json(path.read_text(encoding="utf-8"))
    except OSError as error:
        expected = f"expected a tuning's folder, with its {ABOUT}: {error.strerror}"
        raise BadInput(str(folder), "", expected) from None
    except ValueError:  # no JSON, or no UTF-8
        found = None
    try:
        check_format(found, FORMAT, str(path))
        return _tuning(found)
    except (KeyError, TypeError, ValueError):
        raise BadInput(str(path), "", "expected what swarmwire writes at the start of a tuning") from None


def _tuning(found: dict[str, Any]) -> Tuning:
    tuples: dict[str, Any] = {name: tuple(found[name]) for name in ("seeds", "check_seeds", "overrides")}
    goal: dict[str, Any] = {**found["goal"], "response": Response(**known_fields(Response, found["goal"]["response"]))}
    objects: dict[str, Any] = {
        "files": tuple(CopiedFile(**known_fields(CopiedFile, file)) for file in found["files"]),
        "searches": tuple(_search(of) for of in found["searches"]),
        "goal": Goal(**known_fields(Goal, goal)),
    }
    return Tuning(**{**known_fields(Tuning, found), **tuples, **objects})


def _search(found: dict[str, Any]) -> Search:
    tuples: dict[str, Any] = {name: tuple(found[name]) for name in ("choices", "overrides")}
    return Search(**known_fields(Search, {**found, **tuples}))
