"""`swarmwire repeat`: a run again, compared with its record."""

import typer

from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.campaigns.repetition import CampaignRun, RepeatedRun, Repetition
from swarmwire.deploy.cli.actions.run import record_settings
from swarmwire.deploy.cli.display.progress import run_progress
from swarmwire.deploy.cli.options import DIFFERENT, INTERRUPTED, leaving_when_hung_up
from swarmwire.deploy.cli.run_options import RepeatOptions
from swarmwire.deploy.runs.compiling import report_compiling
from swarmwire.deploy.terminal.console import TerminalConsole
from swarmwire.metrics.records.campaign.campaign_json import CAMPAIGN_FILE


def repeat_run(options: RepeatOptions) -> None:
    """Repeat a run of a run folder or a campaign, and print the comparison."""
    console = TerminalConsole(quiet=options.quiet, soft_wrap=True)
    repeated = _repeated_run(options)
    simulation = repeated.simulation
    simulation.watch(run_progress(simulation, console))
    with leaving_when_hung_up(simulation.interrupt), report_compiling(console):
        repetition = repeated.run()
    for arena in repetition.result.arenas:
        console.print(f"seed {arena.seed}: trajectory {arena.trajectory_sha256[:16]}…")
    console.print(_verdict(repetition), markup=False)
    if repetition.changes:
        console.print(f"changed since the {'run' if options.run is None else 'campaign began'}:")
    elif repetition.same is False and options.run is None:
        console.print("files, modules, versions and CPU match: does an agent use other random numbers or the clock?")
    for change in repetition.changes:
        console.print(f"  {change}", markup=False)
    if options.out is not None:
        console.print(f"written: {options.out}")
    if repetition.result.ended == "interrupted":
        raise typer.Exit(INTERRUPTED)
    if not repetition.same:
        raise typer.Exit(DIFFERENT)


def _repeated_run(options: RepeatOptions) -> CampaignRun | RepeatedRun:
    record = record_settings(options.recording)
    for name, requested in (("packets", record.packets), ("links", record.links)):
        if requested and options.out is None:
            raise BadInput(name, "", "expected `out` with it: a folder in which to record them")
    if options.run is not None:
        return CampaignRun(options.folder, options.run, runners=options.runners, out=options.out, record=record)
    if (options.folder / CAMPAIGN_FILE).exists():
        raise BadInput(str(options.folder), "", "expected --run NUMBER with it: this is a campaign's folder")
    return RepeatedRun(options.folder, runners=options.runners, out=options.out, record=record)


def _verdict(repetition: Repetition) -> str:
    why_not_all = repetition.why_not_all
    if repetition.same is None:
        return f"nothing to compare with: {why_not_all}"
    if not repetition.same:
        tick = repetition.first_difference
        return "a different run" + ("" if tick is None else f" from tick {tick} on")
    if why_not_all:
        return f"the same, bit for bit, in the {repetition.compared} ticks that can be compared: {why_not_all}"
    if repetition.ended is None:
        return "the same run, bit for bit"
    early = "" if repetition.ended in ("duration", "stopped") else f", where it ended early: {repetition.ended}"
    return f"the same run, bit for bit: {repetition.result.ticks} ticks{early}"
