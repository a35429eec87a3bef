"""`swarmwire sweep`."""

import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.cli.options import Overrides, Quiet
from swarmwire.deploy.cli.process import INTERRUPTED, leaving_when_hung_up, program

if TYPE_CHECKING:
    from swarmwire.deploy.campaign.spec import Plan

Vary = Annotated[
    list[str] | None,
    typer.Option(
        help="What varies: PATH=FIRST:LAST:COUNT (radio.loss=0:0.8:9; :log behind it for equal ratios), or a list of "
        "values (robots.flock.count=5,10,20); for random and latin designs PATH=FIRST:LAST. Repeatable.",
        metavar="PATH=VALUES",
    ),
]


def sweep_command(
    source: Annotated[
        Path | None, typer.Argument(help="The scenario, or a campaign: a TOML file.", metavar="SCENARIO|CAMPAIGN")
    ] = None,
    vary: Vary = None,
    seeds: Annotated[
        str | None,
        typer.Option(help='At each point: 9 (1 to 9), 4:10 (4 to 9) or 1,5,7; "9," is 9 alone.', metavar="SEEDS"),
    ] = None,
    design: Annotated[
        str | None, typer.Option(help="grid (default), list (values one to one), random or latin.", metavar="DESIGN")
    ] = None,
    points: Annotated[int | None, typer.Option(help="How many points a random or latin design draws.")] = None,
    design_seed: Annotated[int | None, typer.Option(help="Seed of these points. Default: 1.")] = None,
    overrides: Overrides = None,
    out: Annotated[
        Path | None, typer.Option(help="The campaign's folder, new or empty. Default: campaigns/<scenario>-<UTC>.")
    ] = None,
    name: Annotated[str | None, typer.Option(help="What the campaign is called. Default: as the scenario.")] = None,
    executor: Annotated[
        str, typer.Option(help="Who works: local, or a cluster, such as dask://host:8786.", metavar="EXECUTOR")
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
        str | None, typer.Option(help="Whose runs get full run folders; as for --seeds.", metavar="SEEDS")
    ] = None,
    resume: Annotated[
        Path | None, typer.Option(help="Do only what is missing of the campaign in this folder.", metavar="DIR")
    ] = None,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="With --resume: also run again what failed.")
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="With --resume: also by another version of the code, or on another CPU.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Run a scenario at many points with many seeds, on all cores: a campaign, with a table of all runs.

    Seeds are the same at every point. A run that fails is a row with its error. Ctrl-C, or a kill, loses what is under
    way alone: --resume DIR does what is missing.

    Exit code 0: all runs have rows; 1: the folder cannot be written, no worker can start, or the cluster is gone; 2:
    refused before anything was run; 130: interrupted.
    """
    # Imported here: numba and zenoh take a second, which --help and typing errors should not.
    from swarmwire.deploy.campaign.start import default_folder
    from swarmwire.deploy.campaign.sweep import ExecutionOptions, begin_sweep, resume_sweep
    from swarmwire.deploy.config import seed_list
    from swarmwire.deploy.controls import Interrupt
    from swarmwire.deploy.terminal.sweep_progress import sweep_progress
    from swarmwire.deploy.terminal.sweep_report import print_sweep

    given = {
        "design": design,
        "points": points,
        "design_seed": design_seed,
        "name": name,
        "batch": batch,
        "record_seeds": None if record_seeds is None else seed_list(record_seeds, "--record-seeds"),
        "series": None if series else False,
    }
    plan = _plan(source, vary or [], seeds, overrides or [], {key: of for key, of in given.items() if of is not None})
    console, interrupt = Console(quiet=quiet, highlight=False), Interrupt()
    options = ExecutionOptions(executor, workers, batch, sweep_progress(console), interrupt)
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


def _plan(
    source: Path | None, vary: Sequence[str], seeds: str | None, overrides: Sequence[str], given: Mapping[str, Any]
) -> "Plan | None":
    """The campaign that options and file describe, checked; options override the file. None: neither is there."""
    from swarmwire.deploy.campaign.design import vary_of
    from swarmwire.deploy.campaign.spec import SweepSpec, campaign_file, plan_of, spec_in
    from swarmwire.deploy.config import SEEDS, seed_list

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
