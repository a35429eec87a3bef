"""What a run needs to be repeated: `run.json`, written into the run folder before the first tick.

A run that is killed leaves no summary; what stands here is enough to run it again.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from swarmwire.comms.config import check_format, from_json
from swarmwire.comms.errors import BadInput
from swarmwire.deploy.record import machine
from swarmwire.deploy.record.known_fields import known_fields
from swarmwire.deploy.record.modules import changed_modules, module_digests
from swarmwire.deploy.record.scenario_copy import changed_files, copy_scenario
from swarmwire.metrics.atomic import write_text
from swarmwire.metrics.campaign.spec import CopiedFile
from swarmwire.metrics.metric import Metric
from swarmwire.metrics.run_folder.layout import RUN_FORMAT, RUN_JSON, MetricInfo, metric_info, metric_infos
from swarmwire.world.scenario.scenario import Scenario


@dataclass(frozen=True)
class Origin:
    """From what a run was made. Paths are within the run folder."""

    seeds: tuple[int, ...]  # of the arenas, in order
    ticks: int  # that the run was to have
    runners: int  # 0: all agents in the world's process
    realtime: float | None  # simulated s per s of wall time; None: lockstep, as fast as may be
    files: tuple[CopiedFile, ...]
    modules: Mapping[str, str]  # sha256 of the installed code, by module
    cpu: str
    versions: Mapping[str, str]
    gateways: Mapping[str, str]  # by group: of which kind it has one
    metrics: tuple[MetricInfo, ...]  # that were measured
    subtick_s: float | None  # wall time after which real time woke within ticks; None: packets wait for ticks

    def changes(self, folder: Path, code: Sequence[str]) -> list[str]:
        """What is not as it was when the run of this folder began, a line each; `code`: specs of users' classes."""
        versions = machine.versions()
        changed = [name for name in self.versions if self.versions[name] != versions.get(name)]
        return [
            *changed_files(self.files, folder),
            *changed_modules(self.modules, module_digests(code)),
            *(f"{name} is {versions.get(name, 'not there')}; it was {self.versions[name]}" for name in changed),
            *([f"the CPU is {machine.cpu()}; it was {self.cpu}"] if machine.cpu() != self.cpu else []),
        ]


def origin_of(
    scenario: Scenario,
    code: Sequence[str],
    *,
    seeds: tuple[int, ...],
    ticks: int,
    runners: int,
    realtime: float | None,
    subtick_s: float | None,
    metrics: Sequence[Metric],
    gateways: Mapping[str, str],
    folder: Path | None,
) -> Origin:
    """The origin of a run that is about to begin; put into its run folder, if it has one, with the copied files.

    `code` are the specs of users' classes.
    """
    origin = Origin(
        seeds=seeds,
        ticks=ticks,
        runners=runners,
        realtime=realtime,
        files=copy_scenario(scenario, seeds, folder) if folder else (),
        modules=module_digests(code),
        cpu=machine.cpu(),
        versions=machine.versions(),
        gateways=gateways,
        metrics=tuple(metric_info(metric) for metric in metrics),
        subtick_s=subtick_s,
    )
    if folder:
        write_text(folder / RUN_JSON, json.dumps({"format": RUN_FORMAT, **asdict(origin)}, indent=2) + "\n")
    return origin


def read_origin(folder: Path) -> Origin:
    """The origin of the run of this folder; BadInput if there is none."""
    path = folder / RUN_JSON
    if not folder.is_dir():
        raise BadInput(str(folder), "", "expected a run folder: there is none")
    try:
        found: Any = from_json(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadInput(str(folder), "", f"expected a run folder, with its {RUN_JSON}: {error.strerror}") from None
    except ValueError:  # no JSON, or no UTF-8
        found = None
    try:
        check_format(found, RUN_FORMAT, str(path))
        return _origin(found)
    except (KeyError, TypeError, ValueError, OverflowError):
        raise BadInput(str(path), "", "expected what swarmwire writes at the start of a run") from None


def _origin(found: dict[str, Any]) -> Origin:
    seeds, ticks, runners = tuple(int(seed) for seed in found["seeds"]), int(found["ticks"]), int(found["runners"])
    if not seeds or len(set(seeds)) < len(seeds) or min(*seeds, ticks, runners) < 0:
        raise ValueError(seeds)
    return Origin(
        seeds=seeds,
        ticks=ticks,
        runners=runners,
        realtime=None if found["realtime"] is None else float(found["realtime"]),
        files=tuple(CopiedFile(**known_fields(CopiedFile, file)) for file in found["files"]),
        modules=dict(found["modules"]),
        cpu=str(found["cpu"]),
        versions=dict(found["versions"]),
        gateways=dict(found["gateways"]),
        metrics=metric_infos(found),
        subtick_s=None if found["subtick_s"] is None else float(found["subtick_s"]),
    )
