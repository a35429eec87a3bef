"""`swarmwire run`, `repeat` and `exec`."""

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadInput, RecordFailed
from swarmwire.comms.base.extras import UI
from swarmwire.deploy.cli.options import (
    DIFFERENT,
    INTERRUPTED,
    AgentNetwork,
    Certs,
    Gateway,
    GatewaySet,
    Insecure,
    Isolate,
    Links,
    NetworkEndpoint,
    Out,
    Overrides,
    Packets,
    Quiet,
    RealTime,
    Revoked,
    Rrd,
    Runners,
    ScenarioFile,
    Seed,
    Seeds,
    Select,
    Subtick,
    Swarm,
    Threads,
    Ui,
    View,
    leaving_when_hung_up,
)
from swarmwire.deploy.machine import program
from swarmwire.deploy.terminal.console import TerminalConsole
from swarmwire.world.interfaces.entering import INTERFACES, RobotNamespace, command_line

if TYPE_CHECKING:
    from collections.abc import Sequence

    from swarmwire.comms.observe.interfaces import Observer
    from swarmwire.deploy.campaigns.repetition import Repetition
    from swarmwire.deploy.runs.config import RunConfig
    from swarmwire.deploy.runs.result import Result


def run_command(
    scenario: ScenarioFile,
    runners: Runners = "none",
    agent_network: AgentNetwork = False,
    isolate: Isolate = False,
    threads: Threads = 1,
    out: Out = None,
    seed: Seed = None,
    seeds: Seeds = None,
    overrides: Overrides = None,
    realtime: RealTime = None,
    subtick: Subtick = None,
    packets: Packets = "off",
    links: Links = False,
    rrd: Rrd = True,
    select: Select = None,
    view: View = False,
    ui: Ui = False,
    gateway: Gateway = None,
    gateway_set: GatewaySet = None,
    network: NetworkEndpoint = None,
    swarm: Swarm = None,
    certs: Certs = None,
    revoked: Revoked = None,
    insecure: Insecure = False,
    quiet: Quiet = False,
) -> None:
    """Run a scenario, show its progress, and write a run folder: summary, tables, recording, log.

    Without --realtime the same scenario and seed give the same run bit for bit, for all --runners and --threads.

    With --gateway robots act as real ones, in real time, for programs that drive them: swarmwire-agent, whose
    settings for each robot are written into the run folder, or any other that speaks the robot's protocol. For example:
    --gateway epuck2, or --gateway flock=ros2@tcp/127.0.0.1:7447.
    """
    # Imported here: numba and zenoh take a second, which --help and typing errors should not.
    from swarmwire.deploy.cli.gateway_options import gateway_network, parse_gateways
    from swarmwire.deploy.runs.config import Recording, RunConfig, choose_seeds, packet_share
    from swarmwire.deploy.runs.interfaces import enter_user_namespace
    from swarmwire.deploy.runs.record.folder import default_folder
    from swarmwire.world.scenario_file import load_scenario

    if ui:
        UI.need("--ui")
    checked = load_scenario(scenario, overrides or [])
    if checked.radio and checked.radio.interface and realtime is not None:
        enter_user_namespace()
    for name in revoked or []:
        if name not in checked.robot_names():
            raise BadInput("--revoked", name, "expected a robot of the scenario")
    member = gateway_network(network, certs, revoked or [], insecure=insecure)
    chosen = choose_seeds(checked, seed, seeds)
    config = RunConfig(
        checked,
        seeds=chosen,
        runners=runners,
        agent_network=agent_network,
        isolate=isolate,
        threads=threads,
        out=out or default_folder(scenario.stem, chosen),
        realtime=realtime,
        subtick=subtick,
        gateways=parse_gateways(gateway or [], gateway_set or [], swarm, member),
        record=Recording(packets=packet_share(packets), links=links, rrd=rrd, select=select),
    )
    run_shown(config, TerminalConsole(quiet=quiet), view=view, ui=ui)


def run_shown(
    config: "RunConfig", console: Console, observers: "Sequence[Observer]" = (), *, view: bool, ui: bool
) -> None:
    """Run a scenario into its folder, shown live and afterwards."""
    from swarmwire.deploy.cli.display.progress import RobotsTold, run_progress
    from swarmwire.deploy.cli.display.report import print_result
    from swarmwire.deploy.live.live_view import LiveView, PageBeside
    from swarmwire.deploy.live.remote_control import Announced
    from swarmwire.deploy.machine import report_compiling
    from swarmwire.deploy.runs.simulation import Simulation, finished
    from swarmwire.world.placement.maps import map_hint

    folder = Path(config.out or "")
    with report_compiling(console):
        simulation = Simulation(config)
        if hint := map_hint(simulation.plan.scenario.arena, simulation.plan.scenario.source):
            console.print(f"hint: {hint}", soft_wrap=True)
        with LiveView(folder) as live, PageBeside(simulation, folder, console) as page:
            beside = [(live, "view")] * view + [(page, "page")] * ui
            shown = [Announced(folder), RobotsTold(simulation, console), run_progress(simulation, console)]
            for observer in (*observers, *shown, *(opened for opened, _ in beside)):
                simulation.watch(observer)
            try:
                with leaving_when_hung_up(simulation.interrupt):
                    result = finished(simulation)
            except RecordFailed as lost:
                if lost.result is not None:
                    print_result(lost.result, simulation.metrics.metrics, console)
                raise
            print_result(result, simulation.metrics.metrics, console)
            _say_where(result, folder, console)
            for opened, name in beside:
                if opened.pid is not None:
                    console.print(f"the {name} stays open: close it, or press Ctrl-C, to end it")
            live.wait()
            page.wait()
    if result.ended == "interrupted":
        raise typer.Exit(INTERRUPTED)


def _say_where(result: "Result", folder: Path, console: Console) -> None:
    recorded = f" (the pictures of seed {result.arenas[0].seed})" if len(result.arenas) > 1 else ""
    console.print(f"written: {folder}{recorded}", soft_wrap=True)
    console.print(f"look at it: {program()} view {folder}", soft_wrap=True)
    console.print(f"as a film: {program()} export {folder} --to film.gif", soft_wrap=True)


def repeat_command(
    folder: Annotated[Path, typer.Argument(help="The run folder, or a campaign's folder.", metavar="RUN")],
    run: Annotated[int | None, typer.Option(help="Number of the run in a campaign.", metavar="NUMBER")] = None,
    runners: Runners = "none",
    out: Annotated[
        Path | None, typer.Option(help="A run folder for the repetition, new or empty. Default: nothing is written.")
    ] = None,
    packets: Packets = "off",
    links: Links = False,
    quiet: Quiet = False,
) -> None:
    """Repeat a run from its folder alone, and check whether the result is the same, bit for bit.

    For a campaign's folder, --run selects the run.

    Exit code 0: the same, as far as recorded; 1: different, or there is nothing to compare with; 2: the folder
    holds no run that can be repeated.
    """
    # Imported here: numba and zenoh take a second, which --help and typing errors should not.
    from swarmwire.deploy.campaigns.repetition import CampaignRun, RepeatedRun
    from swarmwire.deploy.cli.display.progress import run_progress
    from swarmwire.deploy.machine import report_compiling
    from swarmwire.deploy.runs.config import Recording, packet_share
    from swarmwire.metrics.records.campaign.campaign_json import CAMPAIGN_FILE

    console = TerminalConsole(quiet=quiet, soft_wrap=True)
    record = Recording(packets=packet_share(packets), links=links)
    if record.packets and out is None:
        raise BadInput("--packets", "", "expected --out with it: a folder in which to record them")
    if record.links and out is None:
        raise BadInput("--links", "", "expected --out with it: a folder in which to record them")
    if run is not None:
        repeated = CampaignRun(folder, run, runners=runners, out=out, record=record)
    elif (folder / CAMPAIGN_FILE).exists():
        raise BadInput(str(folder), "", "expected --run NUMBER with it: this is a campaign's folder")
    else:
        repeated = RepeatedRun(folder, runners=runners, out=out, record=record)
    simulation = repeated.simulation
    simulation.watch(run_progress(simulation, console))
    with leaving_when_hung_up(simulation.interrupt), report_compiling(console):
        repetition = repeated.run()
    for arena in repetition.result.arenas:
        console.print(f"seed {arena.seed}: trajectory {arena.trajectory_sha256[:16]}…")
    console.print(_verdict(repetition), markup=False)
    if repetition.changes:
        console.print(f"changed since the {'run' if run is None else 'campaign began'}:")
    elif repetition.same is False and run is None:
        console.print("files, modules, versions and CPU match: does an agent use other random numbers or the clock?")
    for change in repetition.changes:
        console.print(f"  {change}", markup=False)
    if out is not None:
        console.print(f"written: {out}")
    if repetition.result.ended == "interrupted":
        raise typer.Exit(INTERRUPTED)
    if not repetition.same:
        raise typer.Exit(DIFFERENT)


def _verdict(repetition: "Repetition") -> str:
    why_not_all = repetition.why_not_all
    if repetition.same is None:
        return f"nothing to compare with: {why_not_all}"
    if not repetition.same:
        at = repetition.first_difference
        return "a different run" + ("" if at is None else f" from tick {at} on")
    if why_not_all:
        return f"the same, bit for bit, in the {repetition.compared} ticks that can be compared: {why_not_all}"
    if repetition.ended is None:
        return "the same run, bit for bit"
    early = "" if repetition.ended in ("duration", "stopped") else f", where it ended early: {repetition.ended}"
    return f"the same run, bit for bit: {repetition.result.ticks} ticks{early}"


def exec_command(
    run: Annotated[Path, typer.Argument(help="The folder of a run with network interfaces.", metavar="RUN")],
    robot: Annotated[str, typer.Argument(help="A robot of the run.", metavar="ROBOT")],
    command: Annotated[
        list[str] | None, typer.Argument(help="The command. Default: the user's shell.", metavar="COMMAND")
    ] = None,
) -> None:
    """Run a command on a robot of a running simulation: in its network namespace, for no longer than the run.

    For example: swarmwire exec RUN flock-0 -- ping flock-1. The robots' names are host names there.
    """
    try:
        robots = json.loads((run / INTERFACES).read_text())
    except (OSError, ValueError):
        raise BadInput(str(run), "", "expected the folder of a running simulation with network interfaces") from None
    if robot not in robots:
        raise BadInput(str(run), robot, f"expected {did_you_mean(robots, robot)}")
    line = command_line(RobotNamespace(**robots[robot]["place"]), command or [os.environ.get("SHELL", "/bin/sh")])
    os.execv(line[0], line)
