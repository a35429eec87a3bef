"""The commands `sweep` and `tune`: campaigns of many runs."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from swarmwire.comms.base.extras import TUNE
from swarmwire.deploy.cli.options import Overrides, Quiet, resolve_scenario, with_options

TRIALS, TRIAL_SEEDS, CHECK_SEEDS = 100, "20", "50"
PARALLEL_TRIALS, SAMPLER_SEED = 4, 1

Force = Annotated[
    bool, typer.Option("--force", help="With --resume: also by another version of the code, or on another CPU.")
]


@dataclass(frozen=True, kw_only=True)
class SweepOptions:
    """Options of `swarmwire sweep`."""

    source: Annotated[
        Path | None,
        typer.Argument(
            help="The scenario, or a campaign: a TOML file.", metavar="SCENARIO|CAMPAIGN", callback=resolve_scenario
        ),
    ] = None
    vary: Annotated[
        list[str] | None,
        typer.Option(
            help="Parameter: PATH=FIRST:LAST:COUNT (radio.loss=0:0.8:9; :log behind it for equal ratios), or a list of "
            "values (robots.flock.count=5,10,20); for random and latin designs PATH=FIRST:LAST. Repeatable.",
            metavar="PATH=VALUES",
        ),
    ] = None
    seeds: Annotated[
        str | None,
        typer.Option(help='At each point: 9 (1 to 9), 4:10 (4 to 9) or 1,5,7; "9," is 9 alone.', metavar="SEEDS"),
    ] = None
    design: Annotated[
        str | None, typer.Option(help="grid (default), list (values one to one), random or latin.", metavar="DESIGN")
    ] = None
    points: Annotated[int | None, typer.Option(help="Number of points of a random or latin design.")] = None
    design_seed: Annotated[int | None, typer.Option(help="Seed of these points. Default: 1.")] = None
    overrides: Overrides = None
    out: Annotated[
        Path | None, typer.Option(help="The campaign's folder, new or empty. Default: campaigns/<scenario>-<UTC>.")
    ] = None
    executor: Annotated[
        str, typer.Option(help="Workers: local, or a cluster, such as dask://host:8786.", metavar="EXECUTOR")
    ] = "local"
    workers: Annotated[
        int | None,
        typer.Option(help="Worker processes, of a cluster at most. Default: one for each core; all."),
    ] = None
    batch: Annotated[
        int | None,
        typer.Option(help="Arenas in one world at most; 1: none together. Default: up to 250, fewer of long runs."),
    ] = None
    series: Annotated[bool, typer.Option(help="Keep the metrics of each tick.")] = True
    record_seeds: Annotated[
        str | None, typer.Option(help="Seeds whose runs get full run folders; as for --seeds.", metavar="SEEDS")
    ] = None
    realtime: Annotated[
        str | None,
        typer.Option(
            help="Run at this many simulated seconds per second, with programs on network interfaces if the scenario "
            "has them.",
            metavar="FACTOR",
        ),
    ] = None
    max_late: Annotated[
        float | None,
        typer.Option(
            help="In real time, largest share of late frames or ticks of a run that does not fail. Default: 0.01.",
            metavar="SHARE",
        ),
    ] = None
    resume: Annotated[
        Path | None, typer.Option(help="Run only the missing runs of the campaign in this folder.", metavar="DIR")
    ] = None
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="With --resume: also repeat failed runs.")] = (
        False
    )
    force: Force = False
    quiet: Quiet = False


@with_options
def sweep_command(options: SweepOptions) -> None:
    """Run a scenario at many points with many seeds, on all cores: a campaign, with a table of all runs.

    Seeds are the same at every point. A failed run is a row with its error. Ctrl-C, or a kill, loses only the running
    tasks: --resume DIR runs the missing ones.

    Exit code 0: all runs have rows; 1: the folder cannot be written, no worker can start, or the cluster is gone; 2:
    refused before anything was run; 130: interrupted.
    """
    from swarmwire.deploy.cli.actions.sweep import run_sweep

    run_sweep(options)


@dataclass(frozen=True, kw_only=True)
class TuneOptions:
    """Options of `swarmwire tune`."""

    scenario: Annotated[
        Path | None, typer.Argument(help="The scenario, a TOML file.", metavar="SCENARIO", callback=resolve_scenario)
    ] = None
    search: Annotated[
        list[str] | None,
        typer.Option(
            help="Parameter: PATH=LOW:HIGH (robots.flock.params.separation_m=0.02:0.2; :log behind it for equal "
            "ratios), or choices, PATH=a,b,c. Repeatable.",
            metavar="PATH=VALUES",
        ),
    ] = None
    goal: Annotated[
        str | None,
        typer.Option(
            help='"min RESPONSE.STAT" or "max RESPONSE.STAT" over the seeds; STAT: q25, q50 (default), q75, mean or, '
            "of times, censored.",
            metavar="GOAL",
        ),
    ] = None
    trials: Annotated[int | None, typer.Option(help=f"Number of trials. Default: {TRIALS}.")] = None
    seeds: Annotated[
        str | None,
        typer.Option(
            help=f"Of each trial: 9 (1 to 9), 4:10 (4 to 9) or 1,5,7. Default: {TRIAL_SEEDS}.", metavar="SEEDS"
        ),
    ] = None
    check_seeds: Annotated[
        str | None,
        typer.Option(
            help=f"Seeds of the final check: a number of further seeds, or as for --seeds. Default: {CHECK_SEEDS}.",
            metavar="SEEDS",
        ),
    ] = None
    overrides: Overrides = None
    sampler_seed: Annotated[int | None, typer.Option(help=f"Seed of the sampler. Default: {SAMPLER_SEED}.")] = None
    parallel_trials: Annotated[
        int | None,
        typer.Option(help=f"Trials proposed together, and run at the same time. Default: {PARALLEL_TRIALS}."),
    ] = None
    out: Annotated[
        Path | None, typer.Option(help="The tuning's folder, new or empty. Default: tunings/<scenario>-<UTC>.")
    ] = None
    workers: Annotated[int | None, typer.Option(help="Worker processes. Default: one for each core.")] = None
    resume: Annotated[
        Path | None,
        typer.Option(help="Continue the tuning in this folder, up to --trials trials.", metavar="DIR"),
    ] = None
    force: Force = False
    quiet: Quiet = False


@with_options
def tune_command(options: TuneOptions) -> None:
    """Search the parameters of a scenario with which a response over many seeds is best.

    Each trial runs all seeds with the parameters that Optuna proposes. The best is then checked against the scenario's
    own parameters on seeds that no trial had. Ctrl-C, or a kill, loses only the running trials: --resume DIR
    continues. For example:

      swarmwire tune flock.toml --search robots.flock.params.separation_m=0.2:2 --goal "max order.q50"

    Exit code 0: done; 1: all trials failed, or the folder cannot be written; 2: refused before anything was run;
    130: interrupted.
    """
    TUNE.need("tune")
    from swarmwire.deploy.cli.actions.tune import tune_scenario

    tune_scenario(options)
