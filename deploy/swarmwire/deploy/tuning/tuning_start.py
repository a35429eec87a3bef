"""The folder of a tuning that is about to begin: its scenario with all files, and `tuning.json`."""

from dataclasses import replace
from pathlib import Path

from swarmwire.comms.clock import WallClock
from swarmwire.deploy.campaign.campaign_start import copied_overrides
from swarmwire.deploy.campaign.fresh_folder import fresh_folder
from swarmwire.deploy.campaign.plan import Plan
from swarmwire.deploy.record import machine
from swarmwire.deploy.record.modules import module_digests
from swarmwire.deploy.record.new_folder import stamped_folder
from swarmwire.deploy.record.scenario_copy import Copies, copy_scenario
from swarmwire.deploy.tuning.plan import TuningPlan
from swarmwire.deploy.tuning.search import Search
from swarmwire.deploy.tuning.tuning import Tuning


def default_tuning_folder(scenario: str) -> Path:
    """tunings/<scenario>-<UTC>, as `stamped_folder` has it."""
    return stamped_folder(Path("tunings") / scenario)


def begin_tuning(plan: TuningPlan, folder: Path, command: str) -> Tuning:
    """Make the folder, put into it all that its runs are made from, and `tuning.json` last.

    BadInput unless the folder is new or empty, and can be made.
    """
    with fresh_folder(folder, "tuning") as scenario_folder:
        tuning = _tuning_of(plan, scenario_folder, command)
        tuning.write(folder)
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
