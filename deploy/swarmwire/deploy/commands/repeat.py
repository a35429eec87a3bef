"""`swarmwire repeat`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from swarmwire.comms.clock import WallClock
from swarmwire.deploy.commands.exit_codes import DIFFERENT, INTERRUPTED
from swarmwire.deploy.folder import make_folder

if TYPE_CHECKING:
    from swarmwire.deploy.repetition import Repetition


def repeat_command(
    folder: Annotated[Path, typer.Argument(help="The run folder.", metavar="RUN")],
    runners: Annotated[
        str, typer.Option(help='Processes that run the agents: "none" (all in this one), a number, or "per-robot".')
    ] = "none",
    out: Annotated[
        Path | None, typer.Option(help="A run folder for the repetition, new or empty. Default: nothing is written.")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")] = False,
) -> None:
    """Run a run again from its folder alone, and tell whether it came out the same, bit for bit.

    Exit code 0: the same; 1: different, or there is nothing to compare with; 2: the folder holds no run that can be
    repeated.
    """
    # Imported here: numba and zenoh take a second, which --help and typing errors should not.
    from swarmwire.deploy.progress import ProgressLine
    from swarmwire.deploy.repetition import RepeatedRun

    console = Console(quiet=quiet, highlight=False, soft_wrap=True)
    repeated = RepeatedRun(folder, runners)
    if out is not None:
        repeated.execution.folder = make_folder(out)
    ticks = repeated.execution.ticks
    repetition = repeated.run([ProgressLine(ticks, WallClock(), console)])
    _print(repetition, console)
    if out is not None:
        console.print(f"written: {out}")
    if repetition.result.ended == "interrupted":
        raise typer.Exit(INTERRUPTED)
    if not repetition.same:
        raise typer.Exit(DIFFERENT)


def _print(repetition: "Repetition", console: Console) -> None:
    for arena, before in zip(repetition.result.arenas, repetition.before or (), strict=False):
        now = arena.trajectory_sha256
        verdict = "the same" if now == before else f"different, it was {before[:16]}…"
        console.print(f"seed {arena.seed}: trajectory {now[:16]}…: {verdict}")
    if repetition.same is None:
        console.print(f"nothing to compare with: {repetition.why_not}")
    elif repetition.same:
        console.print(f"the same run, bit for bit: {repetition.result.ticks} ticks")
    else:
        console.print("a different run")
    if repetition.changes:
        console.print("changed since the run:")
    elif repetition.same is False:
        console.print("files, modules, versions and CPU are the same: does an agent draw or read the time by itself?")
    for change in repetition.changes:
        console.print(f"  {change}", markup=False)
