"""`swarmwire sweep` and `tune`: campaigns of many runs."""

import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.extras import TUNE
from swarmwire.deploy.cli.options import INTERRUPTED, Overrides, Quiet, leaving_when_hung_up, scenario_file
from swarmwire.deploy.machine import program
from swarmwire.deploy.terminal.console import TerminalConsole

if TYPE_CHECKING:
    from swarmwire.deploy.campaigns.spec import Plan
    from swarmwire.deploy.campaigns.tuning.spec import TuningPlan

Vary = Annotated[
    list[str] | None,
    typer.Option(
        help="Parameter: PATH=FIRST:LAST:COUNT (radio.loss=0:0.8:9; :log behind it for equal ratios), or a list of "
        "values (robots.flock.count=5,10,20); for random and latin designs PATH=FIRST:LAST. Repeatable.",
        metavar="PATH=VALUES",
    ),
]


def sweep_command(
    source: Annotated[
        Path | None,
        typer.Argument(
            help="The scenario, or a campaign: a TOML file.", metavar="SCENARIO|CAMPAIGN", callback=scenario_file
        ),
    ] = None,
    vary: Vary = None,
    seeds: Annotated[
        str | None,
        typer.Option(help='At each point: 9 (1 to 9), 4:10 (4 to 9) or 1,5,7; "9," is 9 alone.', metavar="SEEDS"),
    ] = None,
    design: Annotated[
        str | None, typer.Option(help="grid (default), list (values one to one), random or latin.", metavar="DESIGN")
    ] = None,
    points: Annotated[int | None, typer.Option(help="Number of points of a random or latin design.")] = None,
    design_seed: Annotated[int | None, typer.Option(help="Seed of these points. Default: 1.")] = None,
    overrides: Overrides = None,
    out: Annotated[
        Path | None, typer.Option(help="The campaign's folder, new or empty. Default: campaigns/<scenario>-<UTC>.")
    ] = None,
    executor: Annotated[
        str, typer.Option(help="Workers: local, or a cluster, such as dask://host:8786.", metavar="EXECUTOR")
    ] = "local",
    workers: Annotated[
        int | None,
        typer.Option(help="Worker processes, of a cluster at most. Default: one for each core; all."),
    ] = None,
    batch: Annotated[
        int | None, typer.Option(help="Arenas in one world at most; 1: none together. Default: about 50.")
    ] = None,
    series: Annotated[bool, typer.Option(help="Keep the metrics of each tick.")] = True,
    record_seeds: Annotated[
        str | None, typer.Option(help="Seeds whose runs get full run folders; as for --seeds.", metavar="SEEDS")
    ] = None,
    resume: Annotated[
        Path | None, typer.Option(help="Run only the missing runs of the campaign in this folder.", metavar="DIR")
    ] = None,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="With --resume: also repeat failed runs.")
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="With --resume: also by another version of the code, or on another CPU.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Run a scenario at many points with many seeds, on all cores: a campaign, with a table of all runs.

    Seeds are the same at every point. A failed run is a row with its error. Ctrl-C, or a kill, loses only the running
    tasks: --resume DIR runs the missing ones.

    Exit code 0: all runs have rows; 1: the folder cannot be written, no worker can start, or the cluster is gone; 2:
    refused before anything was run; 130: interrupted.
    """
    # Imported here: numba and zenoh take a second, which --help and typing errors should not.
    from swarmwire.deploy.campaigns.sweep import ExecutionOptions, begin_sweep, default_folder, resume_sweep
    from swarmwire.deploy.cli.display.sweep import SweepProgress, print_sweep
    from swarmwire.deploy.runs.config import seed_list
    from swarmwire.deploy.runs.controls import Interrupt

    given = {
        "design": design,
        "points": points,
        "design_seed": design_seed,
        "batch": batch,
        "record_seeds": None if record_seeds is None else seed_list(record_seeds, "--record-seeds"),
        "series": None if series else False,
    }
    plan = _sweep_plan(
        source, vary or [], seeds, overrides or [], {key: of for key, of in given.items() if of is not None}
    )
    console, interrupt = TerminalConsole(quiet=quiet), Interrupt()
    options = ExecutionOptions(executor, workers, batch, SweepProgress(console), interrupt)
    with leaving_when_hung_up(interrupt):
        if resume is not None:
            done = resume_sweep(resume, options, retry_failed=retry_failed, force=force, plan=plan)
        elif plan is None or source is None:
            raise BadInput("SCENARIO", "", "is missing: expected a scenario or a campaign, or --resume with a folder")
        else:
            command = shlex.join(["swarmwire", *sys.argv[1:]])
            done = begin_sweep(plan, out or default_folder(source.stem), command, options)
    print_sweep(done, console, program())
    if not done.is_over:
        raise typer.Exit(INTERRUPTED)


def _sweep_plan(
    source: Path | None, vary: Sequence[str], seeds: str | None, overrides: Sequence[str], given: Mapping[str, Any]
) -> "Plan | None":
    """The campaign that options and file describe, checked; options override the file. None: neither is there."""
    from swarmwire.deploy.campaigns.design import vary_of
    from swarmwire.deploy.campaigns.spec import SweepSpec, campaign_file, plan_of, spec_in
    from swarmwire.deploy.runs.config import SEEDS, seed_list

    if source is None:
        if vary or seeds or overrides:
            raise BadInput(
                "SCENARIO", "", "expected the scenario of --vary, --seeds and --set; a --resume takes none of these"
            )
        return None
    file = campaign_file(source)
    varied = tuple(vary_of(text) for text in vary)
    if file is None:
        if seeds is None:
            raise BadInput("--seeds", "", f"is missing: expected {SEEDS}")
        return plan_of(replace(SweepSpec(source, seed_list(seeds), varied, overrides=tuple(overrides)), **given))
    spec = spec_in(source, file, seeds)
    new = {of.path for of in varied}
    kept = tuple(of for of in spec.varied if of.path not in new)
    return plan_of(replace(spec, varied=(*kept, *varied), overrides=(*spec.overrides, *overrides), **given))


TRIALS, TRIAL_SEEDS, CHECK_SEEDS = 100, "20", "50"
PARALLEL_TRIALS, SAMPLER_SEED = 4, 1


def tune_command(
    scenario: Annotated[
        Path | None, typer.Argument(help="The scenario, a TOML file.", metavar="SCENARIO", callback=scenario_file)
    ] = None,
    search: Annotated[
        list[str] | None,
        typer.Option(
            help="Parameter: PATH=LOW:HIGH (robots.flock.params.separation_m=0.02:0.2; :log behind it for equal "
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
    trials: Annotated[int | None, typer.Option(help=f"Number of trials. Default: {TRIALS}.")] = None,
    seeds: Annotated[
        str | None,
        typer.Option(
            help=f"Of each trial: 9 (1 to 9), 4:10 (4 to 9) or 1,5,7. Default: {TRIAL_SEEDS}.", metavar="SEEDS"
        ),
    ] = None,
    check_seeds: Annotated[
        str | None,
        typer.Option(
            help=f"Seeds of the final check: a number of further seeds, or as for --seeds. Default: {CHECK_SEEDS}.",
            metavar="SEEDS",
        ),
    ] = None,
    overrides: Overrides = None,
    sampler_seed: Annotated[int | None, typer.Option(help=f"Seed of the sampler. Default: {SAMPLER_SEED}.")] = None,
    parallel_trials: Annotated[
        int | None,
        typer.Option(help=f"Trials proposed together, and run at the same time. Default: {PARALLEL_TRIALS}."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="The tuning's folder, new or empty. Default: tunings/<scenario>-<UTC>.")
    ] = None,
    workers: Annotated[int | None, typer.Option(help="Worker processes. Default: one for each core.")] = None,
    resume: Annotated[
        Path | None,
        typer.Option(help="Continue the tuning in this folder, up to --trials trials.", metavar="DIR"),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="With --resume: also by another version of the code, or on another CPU.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Search the parameters of a scenario with which a response over many seeds is best.

    Each trial runs all seeds with the parameters that Optuna proposes. The best is then checked against the scenario's
    own parameters on seeds that no trial had. Ctrl-C, or a kill, loses only the running trials: --resume DIR
    continues. For example:

      swarmwire tune flock.toml --search robots.flock.params.separation_m=0.2:2 --goal "max order.q50"

    Exit code 0: done; 1: all trials failed, or the folder cannot be written; 2: refused before anything was run;
    130: interrupted.
    """
    given = {
        "SCENARIO": scenario, "--search": search, "--goal": goal, "--seeds": seeds, "--check-seeds": check_seeds,
        "--set": overrides, "--sampler-seed": sampler_seed, "--parallel-trials": parallel_trials,
        "--out": out,
    }  # fmt: skip
    TUNE.need("tune")
    # Imported here: numba, zenoh and Optuna take seconds, which --help and typing errors should not.
    from swarmwire.deploy.campaigns.tuning.run import TuneObservers, begin_tune, default_tuning_folder, resume_tune
    from swarmwire.deploy.cli.display.sweep import SweepProgress
    from swarmwire.deploy.cli.display.tune import TuneProgress, print_tuned
    from swarmwire.deploy.runs.controls import Interrupt

    console, interrupt = TerminalConsole(quiet=quiet), Interrupt()
    observers = TuneObservers(TuneProgress(console), SweepProgress(console), interrupt)
    with leaving_when_hung_up(interrupt):
        if resume is None:
            numbers = {"trials": trials, "parallel_trials": parallel_trials, "sampler_seed": sampler_seed}
            plan = _tuning_plan(scenario, search or [], goal, (seeds, check_seeds), overrides or [], numbers)
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
            raise BadInput(option, "", "expected --resume without it: the folder holds the campaign's settings")


def _tuning_plan(
    scenario: Path | None,
    search: Sequence[str],
    goal: str | None,
    seeds: tuple[str | None, str | None],
    overrides: Sequence[str],
    numbers: Mapping[str, int | None],
) -> "TuningPlan":
    """The tuning that options describe, checked; `seeds` are those of the trials and the fresh ones."""
    from swarmwire.deploy.campaigns.tuning.spec import TuningSpec, fresh_seeds, search_of, tuning_plan
    from swarmwire.deploy.runs.config import seed_list

    if scenario is None:
        raise BadInput("SCENARIO", "", "is missing: expected a scenario, or --resume with a folder")
    if goal is None:
        raise BadInput("--goal", "", 'is missing: expected one such as "min aggregation_time_s.q50"')
    trial_seeds = seed_list(seeds[0] or TRIAL_SEEDS)
    given = {name: value for name, value in numbers.items() if value is not None}
    spec = TuningSpec(
        scenario=scenario,
        searched=tuple(map(search_of, search)),
        goal=goal,
        seeds=trial_seeds,
        check_seeds=fresh_seeds(seeds[1] or CHECK_SEEDS, trial_seeds),
        overrides=tuple(overrides),
        **{"trials": TRIALS, "parallel_trials": PARALLEL_TRIALS, "sampler_seed": SAMPLER_SEED, **given},
    )
    return tuning_plan(spec)
