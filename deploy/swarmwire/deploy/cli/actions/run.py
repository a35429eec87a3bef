"""`swarmwire run`: a run in the terminal, with its views."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import typer
from rich.console import Console

from swarmwire.comms.base.errors import BadInput, RecordFailed
from swarmwire.comms.base.extras import UI
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.deploy.cli.actions.gateway_options import gateway_network, parse_gateways
from swarmwire.deploy.cli.display.progress import GatewayAddresses, run_progress
from swarmwire.deploy.cli.display.report import print_result
from swarmwire.deploy.cli.options import INTERRUPTED, leaving_when_hung_up
from swarmwire.deploy.cli.run_options import GatewayOptions, OpenViews, PacketOptions, RunCommandOptions, StartOptions
from swarmwire.deploy.live.live_view import LiveView, PageBeside
from swarmwire.deploy.live.remote_control import Announced
from swarmwire.deploy.machine import program, report_compiling
from swarmwire.deploy.runs.config import Recording, RunConfig, choose_seeds, packet_share
from swarmwire.deploy.runs.gateways.gateways import Gateways
from swarmwire.deploy.runs.interfaces import enter_user_namespace
from swarmwire.deploy.runs.record.folder import default_folder
from swarmwire.deploy.runs.result import Result
from swarmwire.deploy.runs.simulation import Simulation, run_to_end
from swarmwire.deploy.terminal.console import TerminalConsole
from swarmwire.world.placement.maps import map_hint
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario_file import load_scenario


def run_scenario(options: RunCommandOptions) -> None:
    """Run a scenario into its folder."""
    if options.views.ui:
        UI.need("--ui")
    scenario = load_scenario(options.scenario, options.start.overrides or ())
    if scenario.radio and scenario.radio.interface and options.start.realtime is not None:
        enter_user_namespace()
    config = run_config(
        scenario,
        options.start,
        options.recording,
        threads=options.threads,
        gateways=_gateways(options.gateway, scenario),
        **asdict(options.agents),
    )
    show_run(config, TerminalConsole(quiet=options.quiet), options.views)


def run_config(scenario: Scenario, start: StartOptions, recording: PacketOptions, **settings: Any) -> RunConfig:
    """Return the config of a run from options; `settings` are further fields of `RunConfig`."""
    seeds = choose_seeds(scenario, start.seed, start.seeds)
    return RunConfig(
        scenario,
        seeds=seeds,
        out=start.out or default_folder(Path(scenario.source).stem, seeds),
        realtime=start.realtime,
        subtick=start.subtick,
        record=record_settings(recording),
        **settings,
    )


def record_settings(recording: PacketOptions) -> Recording:
    """Return what to record, from options."""
    return replace(Recording(), **{**asdict(recording), "packets": packet_share(recording.packets)})


def _gateways(options: GatewayOptions, scenario: Scenario) -> Gateways | None:
    robots, revoked = scenario.robot_names(), options.revoked or []
    for name in revoked:
        if name not in robots:
            raise BadInput("--revoked", name, "expected a robot of the scenario")
    network = gateway_network(options.network, options.certs, revoked, insecure=options.insecure)
    return parse_gateways(options.gateways or [], options.options or [], options.swarm, network)


def show_run(config: RunConfig, console: Console, views: OpenViews, observers: Sequence[Observer] = ()) -> None:
    """Run a scenario into its folder, and print its progress and its summary; the views stay open afterwards."""
    folder = Path(config.out or "")
    with report_compiling(console):
        simulation = Simulation(config)
        if hint := map_hint(simulation.plan.scenario.arena, simulation.plan.scenario.source):
            console.print(f"hint: {hint}", soft_wrap=True)
        with ExitStack() as stack:
            open_views: dict[str, LiveView] = {}
            if views.view:
                open_views["view"] = stack.enter_context(LiveView(folder))
            if views.ui:
                open_views["page"] = stack.enter_context(PageBeside(simulation, folder, console))
            progress = [Announced(folder), GatewayAddresses(simulation, console), run_progress(simulation, console)]
            for observer in (*observers, *progress, *open_views.values()):
                simulation.watch(observer)
            result = _finish(simulation, console)
            _print_next_steps(result, folder, console)
            for name, view in open_views.items():
                if view.pid is not None:
                    console.print(f"the {name} stays open: close it, or press Ctrl-C, to end it")
            for view in open_views.values():
                view.wait()
    if result.ended == "interrupted":
        raise typer.Exit(INTERRUPTED)


def _finish(simulation: Simulation, console: Console) -> Result:
    """Run to the end, and print the summary, also of a run whose folder could not be written."""
    try:
        with leaving_when_hung_up(simulation.interrupt):
            result = run_to_end(simulation)
    except RecordFailed as error:
        if error.result is not None:
            print_result(error.result, simulation.metrics.metrics, console)
        raise
    print_result(result, simulation.metrics.metrics, console)
    return result


def _print_next_steps(result: Result, folder: Path, console: Console) -> None:
    recorded = f" (the pictures of seed {result.arenas[0].seed})" if len(result.arenas) > 1 else ""
    console.print(f"written: {folder}{recorded}", soft_wrap=True)
    console.print(f"look at it: {program()} view {folder}", soft_wrap=True)
    console.print(f"as a film: {program()} export {folder} --to film.gif", soft_wrap=True)
