"""`swarmwire tune`: a tuning in the terminal."""

import shlex
import sys
from pathlib import Path

import typer

from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.campaigns.tuning.run import TUNINGS, TuneObservers, begin_tune, resume_tune
from swarmwire.deploy.campaigns.tuning.spec import TuningPlan, TuningSpec, fresh_seeds, search_of, tuning_plan
from swarmwire.deploy.cli.display.sweep import SweepProgress
from swarmwire.deploy.cli.display.tune import TuneProgress, print_tuned
from swarmwire.deploy.cli.options import INTERRUPTED, leaving_when_hung_up
from swarmwire.deploy.cli.sweep import CHECK_SEEDS, PARALLEL_TRIALS, SAMPLER_SEED, TRIAL_SEEDS, TRIALS, TuneOptions
from swarmwire.deploy.machine import command_path
from swarmwire.deploy.runs.config import seed_list
from swarmwire.deploy.runs.controls import Interrupt
from swarmwire.deploy.runs.record.folder import short_name, stamped_folder
from swarmwire.deploy.terminal.console import TerminalConsole


def tune_scenario(options: TuneOptions) -> None:
    """Begin or resume a tuning, and print its progress and its result."""
    console, interrupt = TerminalConsole(quiet=options.quiet), Interrupt()
    observers = TuneObservers(TuneProgress(console), SweepProgress(console), interrupt)
    with leaving_when_hung_up(interrupt):
        if options.resume is None:
            plan = _plan(options)
            folder = options.out or stamped_folder(Path(TUNINGS, short_name(plan.spec.scenario)))
            tuned = begin_tune(plan, folder, shlex.join(["swarmwire", *sys.argv[1:]]), options.workers, observers)
        else:
            _refuse_with_resume(options)
            tuned = resume_tune(options.resume, options.workers, observers, trials=options.trials, force=options.force)
    print_tuned(tuned, console, command_path())
    if not tuned.is_over:
        raise typer.Exit(INTERRUPTED)


SETTINGS = ("scenario", "search", "goal", "seeds", "check_seeds", "overrides", "sampler_seed", "parallel_trials", "out")


def _refuse_with_resume(options: TuneOptions) -> None:
    """Raise BadInput for an option whose value is in the folder of the tuning."""
    for name in SETTINGS:
        if getattr(options, name):
            raise BadInput(name, "", "expected --resume without it: the folder holds the campaign's settings")


def _plan(options: TuneOptions) -> TuningPlan:
    """Return the checked tuning of the options."""
    if options.scenario is None:
        raise BadInput("scenario", "", "is missing: expected a scenario, or --resume with a folder")
    if options.goal is None:
        raise BadInput("goal", "", 'is missing: expected one such as "min aggregation_time_s.q50"')
    trial_seeds = seed_list(options.seeds or TRIAL_SEEDS)
    spec = TuningSpec(
        scenario=options.scenario,
        searched=tuple(map(search_of, options.search or ())),
        goal=options.goal,
        seeds=trial_seeds,
        check_seeds=fresh_seeds(options.check_seeds or CHECK_SEEDS, trial_seeds),
        overrides=tuple(options.overrides or ()),
        trials=TRIALS if options.trials is None else options.trials,
        parallel_trials=PARALLEL_TRIALS if options.parallel_trials is None else options.parallel_trials,
        sampler_seed=SAMPLER_SEED if options.sampler_seed is None else options.sampler_seed,
    )
    return tuning_plan(spec)
