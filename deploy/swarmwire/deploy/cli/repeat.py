"""`swarmwire repeat`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.cli.options import Links, Packets, Quiet, Runners
from swarmwire.deploy.cli.process import DIFFERENT, INTERRUPTED, leaving_when_hung_up

if TYPE_CHECKING:
    from swarmwire.deploy.campaign.repeat import CampaignRun
    from swarmwire.deploy.repetition import Repetition


def repeat_command(
    folder: Annotated[Path, typer.Argument(help="The run folder, or a campaign's folder.", metavar="RUN")],
    run: Annotated[int | None, typer.Option(help="Which run of a campaign, by its number.", metavar="NUMBER")] = None,
    runners: Runners = "none",
    out: Annotated[
        Path | None, typer.Option(help="A run folder for the repetition, new or empty. Default: nothing is written.")
    ] = None,
    packets: Packets = "off",
    links: Links = False,
    quiet: Quiet = False,
) -> None:
    """Run a run again from its folder alone, and tell whether it came out the same, bit for bit.

    Of a campaign's folder it is the run that --run names.

    Exit code 0: the same, as far as can be compared; 1: different, or there is nothing to compare with; 2: the folder
    holds no run that can be repeated.
    """
    # Imported here: numba and zenoh take a second, which --help and typing errors should not.
    from swarmwire.deploy.campaign.repeat import CampaignRun
    from swarmwire.deploy.config import Recording, packet_share
    from swarmwire.deploy.host import compiling_told
    from swarmwire.deploy.repetition import RepeatedRun
    from swarmwire.deploy.terminal.progress import run_progress
    from swarmwire.metrics.campaign.spec import ABOUT

    console = Console(quiet=quiet, highlight=False, soft_wrap=True)
    record = Recording(packets=packet_share(packets), links=links)
    if record.packets and out is None:
        raise BadInput("--packets", "", "expected --out with it: a folder in which to record them")
    if record.links and out is None:
        raise BadInput("--links", "", "expected --out with it: a folder in which to record them")
    if run is not None:
        _repeat_of_campaign(CampaignRun(folder, run, runners=runners, out=out, record=record), out, console)
        return
    if (folder / ABOUT).exists():
        raise BadInput(str(folder), "", "expected --run NUMBER with it: this is a campaign's folder")
    repeated = RepeatedRun(folder, runners=runners, out=out, record=record)
    repeated.simulation.watch(run_progress(repeated.simulation, console))
    with leaving_when_hung_up(repeated.simulation.interrupt), compiling_told(console):
        repetition = repeated.run()
    _print(repetition, console)
    if out is not None:
        console.print(f"written: {out}")
    if repetition.result.ended == "interrupted":
        raise typer.Exit(INTERRUPTED)
    if not repetition.same:
        raise typer.Exit(DIFFERENT)


def _repeat_of_campaign(repeated: "CampaignRun", out: Path | None, console: Console) -> None:
    """Run it again, tell how it came out, and leave with the exit code that says so."""
    from swarmwire.deploy.host import compiling_told
    from swarmwire.deploy.terminal.progress import run_progress

    simulation = repeated.simulation
    simulation.watch(run_progress(simulation, console))
    with leaving_when_hung_up(simulation.interrupt), compiling_told(console):
        again = repeated.again()
    arena = again.result.arenas[0]
    console.print(f"seed {arena.seed}: trajectory {arena.trajectory_sha256[:16]}…")
    if again.same is None:
        console.print(f"nothing to compare with: {again.why_not}", markup=False)
    else:
        console.print("the same run, bit for bit" if again.same else "a different run")
    if again.changes:
        console.print("changed since the campaign began:")
    for change in again.changes:
        console.print(f"  {change}", markup=False)
    if out is not None:
        console.print(f"written: {out}")
    if again.result.ended == "interrupted":
        raise typer.Exit(INTERRUPTED)
    if not again.same:
        raise typer.Exit(DIFFERENT)


def _print(repetition: "Repetition", console: Console) -> None:
    for arena in repetition.result.arenas:
        console.print(f"seed {arena.seed}: trajectory {arena.trajectory_sha256[:16]}…")
    console.print(_verdict(repetition))
    if repetition.changes:
        console.print("changed since the run:")
    elif repetition.same is False:
        console.print("files, modules, versions and CPU are the same: does an agent draw or read the time by itself?")
    for change in repetition.changes:
        console.print(f"  {change}", markup=False)


def _verdict(repetition: "Repetition") -> str:
    why_not_all = repetition.why_not_all
    if repetition.same is None:
        return f"nothing to compare with: {why_not_all}"
    if not repetition.same:
        at = repetition.first_difference
        return "a different run" + ("" if at is None else f" from tick {at} on")
    if why_not_all:
        return f"the same, bit for bit, in the {repetition.compared} ticks that can be compared: {why_not_all}"
    early = "" if repetition.ended in ("duration", "stopped") else f", where it ended early: {repetition.ended}"
    return f"the same run, bit for bit: {repetition.result.ticks} ticks{early}"
