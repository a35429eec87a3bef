"""`swarmwire tune`."""

import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from swarmwire.comms.errors import BadInput
from swarmwire.comms.extras import TUNE
from swarmwire.deploy.cli.options import Overrides, Quiet
from swarmwire.deploy.cli.process import INTERRUPTED, leaving_when_hung_up, program

if TYPE_CHECKING:
    from swarmwire.deploy.tuning.spec import TuningPlan

TRIALS, SEEDS, CHECK_SEEDS = 100, "20", "50"
PARALLEL_TRIALS, SAMPLER, SAMPLER_SEED = 4, "tpe", 1


def tune_command(
    scenario: Annotated[Path | None, typer.Argument(help="The scenario, a TOML file.", metavar="SCENARIO")] = None,
    search: Annotated[
        list[str] | None,
        typer.Option(
            help="What is searched: PATH=LOW:HIGH (robots.flock.params.separation_m=0.02:0.2; :log behind it for equal "
            "ratios), or choices, PATH=a,b,c. Repeatable.",
            metavar="PATH=VALUES",
        ),
    ] = None,
    goal: Annotated[
        str | None,
        typer.Option(
            help='"min RESPONSE.STAT" or "max RESPONSE.STAT" over the seeds; STAT: q25, q50 (default), q75, mean or, '
            "of times, censored.",
            metavar="GOAL",
        ),
    ] = None,
    trials: Annotated[int | None, typer.Option(help=f"How many are tried. Default: {TRIALS}.")] = None,
    seeds: Annotated[
        str | None,
        typer.Option(help=f"Of each trial: 9 (1 to 9), 4:10 (4 to 9) or 1,5,7. Default: {SEEDS}.", metavar="SEEDS"),
    ] = None,
    check_seeds: Annotated[
        str | None,
        typer.Option(
            help="On which the best is checked at the end: how many after those, or as for --seeds. "
            f"Default: {CHECK_SEEDS}.",
            metavar="SEEDS",
        ),
    ] = None,
    overrides: Overrides = None,
    sampler: Annotated[
        str | None, typer.Option(help=f"What proposes parameters: tpe or random. Default: {SAMPLER}.")
    ] = None,
    sampler_seed: Annotated[int | None, typer.Option(help=f"Seed of the sampler. Default: {SAMPLER_SEED}.")] = None,
    parallel_trials: Annotated[
        int | None,
        typer.Option(help=f"Trials that are proposed together, and run at the same time. Default: {PARALLEL_TRIALS}."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="The tuning's folder, new or empty. Default: tunings/<scenario>-<UTC>.")
    ] = None,
    workers: Annotated[int | None, typer.Option(help="Worker processes. Default: one for each core.")] = None,
    resume: Annotated[
        Path | None,
        typer.Option(help="Go on with the tuning in this folder; with --trials up to so many.", metavar="DIR"),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="With --resume: also by another version of the code, or on another CPU.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Search the parameters of a scenario with which a response over many seeds is best.

    Each trial runs all seeds with the parameters that Optuna proposes. The best is then checked against the scenario's
    own parameters on seeds that no trial had. Ctrl-C, or a kill, loses the trials under way alone: --resume DIR goes
    on. For example:

      swarmwire tune flock.toml --search robots.flock.params.separation_m=0.2:2 --goal "max order.q50"

    Exit code 0: done; 1: all trials failed, or the folder cannot be written; 2: refused before anything was run;
    130: interrupted.
    """
    given = {
        "SCENARIO": scenario, "--search": search, "--goal": goal, "--seeds": seeds, "--check-seeds": check_seeds,
        "--set": overrides, "--sampler": sampler, "--sampler-seed": sampler_seed, "--parallel-trials": parallel_trials,
        "--out": out,
    }  # fmt: skip
    TUNE.need("tune")
    # Imported here: numba, zenoh and Optuna take seconds, which --help and typing errors should not.
    from swarmwire.deploy.controls import Interrupt
    from swarmwire.deploy.terminal.sweep_progress import sweep_progress
    from swarmwire.deploy.terminal.tune_progress import tune_progress
    from swarmwire.deploy.terminal.tune_report import print_tuned
    from swarmwire.deploy.tuning.run import TuneObservers, begin_tune, default_tuning_folder, resume_tune

    console, interrupt = Console(quiet=quiet, highlight=False), Interrupt()
    observers = TuneObservers(tune_progress(console), sweep_progress(console), interrupt)
    with leaving_when_hung_up(interrupt):
        if resume is None:
            numbers = {"trials": trials, "parallel_trials": parallel_trials, "sampler_seed": sampler_seed}
            plan = _plan(scenario, search or [], goal, (seeds, check_seeds), overrides or [], sampler, numbers)
            folder = out or default_tuning_folder(plan.spec.scenario.stem)
            tuned = begin_tune(plan, folder, shlex.join(["swarmwire", *sys.argv[1:]]), workers, observers)
        else:
            _refuse_with_resume(given)
            tuned = resume_tune(resume, workers, observers, trials=trials, force=force)
    print_tuned(tuned, console, program())
    if not tuned.is_over:
        raise typer.Exit(INTERRUPTED)


def _refuse_with_resume(given: Mapping[str, object]) -> None:
    """BadInput for options that the folder of a tuning answers."""
    for option, value in given.items():
        if value:
            raise BadInput(option, "", "expected --resume without it: the folder says what was asked")


def _plan(
    scenario: Path | None,
    search: Sequence[str],
    goal: str | None,
    seeds: tuple[str | None, str | None],
    overrides: Sequence[str],
    sampler: str | None,
    numbers: Mapping[str, int | None],
) -> "TuningPlan":
    """The tuning that options describe, checked; `seeds` are those of the trials and the fresh ones."""
    from swarmwire.deploy.config import seed_list
    from swarmwire.deploy.tuning.spec import TuningSpec, fresh_seeds, search_of, tuning_plan

    if scenario is None:
        raise BadInput("SCENARIO", "", "is missing: expected a scenario, or --resume with a folder")
    if goal is None:
        raise BadInput("--goal", "", 'is missing: expected one such as "min aggregation_time_s.q50"')
    trial_seeds = seed_list(seeds[0] or SEEDS)
    given = {name: value for name, value in numbers.items() if value is not None}
    spec = TuningSpec(
        scenario=scenario,
        searched=tuple(map(search_of, search)),
        goal=goal,
        seeds=trial_seeds,
        check_seeds=fresh_seeds(seeds[1] or CHECK_SEEDS, trial_seeds),
        sampler=sampler or SAMPLER,
        overrides=tuple(overrides),
        **{"trials": TRIALS, "parallel_trials": PARALLEL_TRIALS, "sampler_seed": SAMPLER_SEED, **given},
    )
    return tuning_plan(spec)
