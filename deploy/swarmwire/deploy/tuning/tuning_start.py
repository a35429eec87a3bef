"""The folder of a tuning that is about to begin: its scenario with all files, and `tuning.json`."""

from dataclasses import replace
from itertools import chain, count
from pathlib import Path

from swarmwire.comms.clock import WallClock
from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.campaign import SCENARIO_FOLDER
from swarmwire.deploy.campaign.campaign_start import copied_overrides
from swarmwire.deploy.campaign.plan import Plan
from swarmwire.deploy.record import machine
from swarmwire.deploy.record.modules import module_digests
from swarmwire.deploy.record.scenario_copy import Copies, copy_scenario
from swarmwire.deploy.tuning.plan import TuningPlan
from swarmwire.deploy.tuning.search import Search
from swarmwire.deploy.tuning.tuning import Tuning


def default_tuning_folder(scenario: str) -> Path:
    """tunings/<scenario>-<UTC>, with a number behind it if another has taken that in the same second."""
    wanted = Path("tunings") / f"{scenario}-{WallClock().utc_stamp()}"
    numbered = (wanted.with_name(f"{wanted.name}-{number}") for number in count(2))
    return next(folder for folder in chain([wanted], numbered) if not folder.exists())


def begin_tuning(plan: TuningPlan, folder: Path, command: str) -> Tuning:
    """Make the folder, put into it all that its runs are made from, and `tuning.json` last.

    BadInput unless the folder is new or empty, and can be made.
    """
    scenario_folder = folder / SCENARIO_FOLDER
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise BadInput("--out", str(folder), "expected a new or empty folder; to go on with a tuning: --resume")
        scenario_folder.mkdir()  # of several that found it empty, the system lets one alone make it
        tuning = _tuning_of(plan, scenario_folder, command)
        tuning.write(folder)
    except OSError as error:
        raise BadInput("--out", str(folder), f"expected a folder that can be written: {error.strerror}") from error
    return tuning


def _tuning_of(plan: TuningPlan, scenario_folder: Path, command: str) -> Tuning:
    asked, copies = plan.asked, Copies(scenario_folder)
    searches = [_copied(search, ends, copies) for search, ends in zip(plan.searches, plan.ends, strict=True)]
    return Tuning(
        scenario=plan.scenario.name,
        command=command,
        began_utc=WallClock().utc_stamp(),
        versions=machine.versions(),
        cpu=machine.cpu(),
        modules=module_digests(plan.code),
        files=copy_scenario(plan.scenario, (plan.scenario.seed,), scenario_folder, copies),
        overrides=asked.overrides,
        searches=tuple(searches),
        goal=plan.goal,
        robots=max(ends.robots for ends in plan.ends),
        seeds=asked.seeds,
        check_seeds=asked.check_seeds,
        trials=asked.trials,
        batch=asked.batch,
        sampler=asked.sampler,
        sampler_seed=asked.sampler_seed,
    )


def _copied(search: Search, ends: Plan, copies: Copies) -> Search:
    """A search whose choices name copies of the files that they named."""
    if not search.choices:
        return search
    return replace(search, overrides=tuple(copied_overrides(ends, point, copies)[0] for point in ends.points))
