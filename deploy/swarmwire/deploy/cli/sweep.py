"""`swarmwire sweep`."""

import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.cli.options import Overrides, Quiet
from swarmwire.deploy.cli.process import INTERRUPTED, leaving_when_hung_up, program

if TYPE_CHECKING:
    from swarmwire.deploy.campaign.plan import Plan
    from swarmwire.deploy.campaign.sweeping import Means, Sweep
    from swarmwire.deploy.campaign.watcher import Watcher
    from swarmwire.deploy.interrupt import Interrupt

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
    on: Annotated[
        str, typer.Option(help="Who works: local, or another executor, such as dask://host:8786.", metavar="EXECUTOR")
    ] = "local",
    workers: Annotated[
        int | None,
        typer.Option(help="Worker processes, or threads of a cluster at most. Default: one for each core; all."),
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
    anyway: Annotated[
        bool, typer.Option("--anyway", help="With --resume: also by another version of the code, or on another CPU.")
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
    from swarmwire.deploy.arguments import seed_list
    from swarmwire.deploy.campaign.sweeping import Means
    from swarmwire.deploy.interrupt import Interrupt
    from swarmwire.deploy.terminal.sweep_progress import sweep_progress
    from swarmwire.deploy.terminal.sweep_report import print_sweep

    said = {
        "design": design,
        "points": points,
        "design_seed": design_seed,
        "name": name,
        "batch": batch,
        "record_seeds": None if record_seeds is None else seed_list(record_seeds, "--record-seeds"),
        "series": None if series else False,
    }
    plan = _plan(source, vary or [], seeds, overrides or [], {key: of for key, of in said.items() if of is not None})
    console, interrupt = Console(quiet=quiet, highlight=False), Interrupt()
    work = Work(Means(on, workers, batch), sweep_progress(console), interrupt)
    with leaving_when_hung_up(interrupt):
        if resume is None:
            done = _begun(plan, source, out, work)
        else:
            done = _resumed(resume, plan, work, retry_failed=retry_failed, anyway=anyway)
    print_sweep(done, console, program())
    if not done.is_over:
        raise typer.Exit(INTERRUPTED)


@dataclass(frozen=True)
class Work:
    """With what a campaign is run, and who looks on."""

    means: "Means"
    watcher: "Watcher"
    interrupt: "Interrupt"


def _plan(
    source: Path | None, vary: Sequence[str], seeds: str | None, overrides: Sequence[str], said: Mapping[str, Any]
) -> "Plan | None":
    """The campaign that is asked for, checked; options go before what a campaign's file says. None: none is."""
    from swarmwire.deploy.arguments import SEEDS, seed_list
    from swarmwire.deploy.campaign.campaign_file import asked_in, campaign_table
    from swarmwire.deploy.campaign.plan import Asked, planned
    from swarmwire.deploy.campaign.vary import vary_of

    if source is None:
        if vary or seeds or overrides:
            raise BadInput(
                "SCENARIO", "", "expected the scenario of --vary, --seeds and --set; a --resume takes none of these"
            )
        return None
    table = campaign_table(source)
    varied = tuple(vary_of(text) for text in vary)
    if table is None:
        if seeds is None:
            raise BadInput("--seeds", "", f"is missing: expected {SEEDS}")
        return planned(replace(Asked(source, seed_list(seeds), varied, overrides=tuple(overrides)), **said))
    of_file = asked_in(source, table if seeds is None else {**table, "seeds": seeds})
    new = {of.path for of in varied}
    kept = tuple(of for of in of_file.varied if of.path not in new)
    return planned(replace(of_file, varied=(*kept, *varied), overrides=(*of_file.overrides, *overrides), **said))


def _begun(plan: "Plan | None", source: Path | None, out: Path | None, work: Work) -> "Sweep":
    from swarmwire.deploy.campaign.campaign_start import default_folder
    from swarmwire.deploy.campaign.sweeping import begin_sweep

    if plan is None or source is None:
        raise BadInput("SCENARIO", "", "is missing: expected a scenario or a campaign, or --resume with a folder")
    command = shlex.join(["swarmwire", *sys.argv[1:]])
    folder = out or default_folder(source.stem)
    return begin_sweep(plan, folder, command, work.means, work.watcher, work.interrupt)


def _resumed(folder: Path, plan: "Plan | None", work: Work, *, retry_failed: bool, anyway: bool) -> "Sweep":
    from swarmwire.deploy.campaign.sweeping import resume_sweep

    return resume_sweep(
        folder,
        work.means,
        retry_failed=retry_failed,
        anyway=anyway,
        plan=plan,
        watcher=work.watcher,
        interrupt=work.interrupt,
    )
