"""`swarmwire run`: a run in the terminal, with its views, and robots that answer as real ones."""

import tomllib
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import typer
from rich.console import Console

from swarmwire.comms.base.config import from_toml
from swarmwire.comms.base.errors import BadInput, RecordFailed
from swarmwire.comms.base.extras import UI, VIEW
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.wire.access_control import TRACKER
from swarmwire.comms.wire.network import Network, as_options
from swarmwire.deploy.cli.display.progress import GatewayAddresses, run_progress
from swarmwire.deploy.cli.display.report import print_result
from swarmwire.deploy.cli.options import INTERRUPTED, leaving_when_hung_up
from swarmwire.deploy.cli.run_options import GatewayOptions, OpenViews, PacketOptions, RunCommandOptions, StartOptions
from swarmwire.deploy.live.live_view import LiveView, PageBeside
from swarmwire.deploy.machine import command_path
from swarmwire.deploy.robots.certificates.member import member
from swarmwire.deploy.runs.compiling import report_compiling
from swarmwire.deploy.runs.config import Recording, RunConfig, choose_seeds, packet_share
from swarmwire.deploy.runs.gateways.gateways import LOOPBACK, Gateways
from swarmwire.deploy.runs.interfaces import enter_user_namespace
from swarmwire.deploy.runs.live_address import Announcement
from swarmwire.deploy.runs.record.folder import default_folder
from swarmwire.deploy.runs.result import Result
from swarmwire.deploy.runs.simulation import Simulation, run_to_end
from swarmwire.deploy.terminal.console import TerminalConsole
from swarmwire.metrics.records.run_folder.layout import RECORDING
from swarmwire.world.placement.maps import layout_hints
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
        out=start.out or default_folder(Path(scenario.source), seeds),
        realtime=start.realtime,
        subtick=start.subtick,
        record=record_settings(recording),
        **settings,
    )


def record_settings(recording: PacketOptions) -> Recording:
    """Return what to record, from options."""
    return replace(Recording(), **{**asdict(recording), "packets": packet_share(recording.packets)})


def show_run(config: RunConfig, console: Console, views: OpenViews, observers: Sequence[Observer] = ()) -> None:
    """Run a scenario into its folder, and print its progress and its summary; the views stay open afterwards."""
    folder = Path(config.out or "")
    with report_compiling(console):
        simulation = Simulation(config)
        for hint in layout_hints(simulation.plan.scenario.arena, simulation.plan.scenario.source):
            console.print(f"hint: {hint}", soft_wrap=True)
        with ExitStack() as stack:
            open_views: dict[str, LiveView] = {}
            if views.view:
                open_views["view"] = stack.enter_context(LiveView(folder))
            if views.ui:
                open_views["page"] = stack.enter_context(PageBeside(simulation, folder, console))
            progress = [Announcement(folder), GatewayAddresses(simulation, console), run_progress(simulation, console)]
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
    pictured = f" (the pictures of seed {result.arenas[0].seed})" if len(result.arenas) > 1 else ""
    console.print(f"written: {folder}{pictured}", soft_wrap=True)
    recorded = (folder / RECORDING).exists()
    console.print(f"look at it: {command_path()} {'view' if recorded else 'export'} {folder}", soft_wrap=True)
    if VIEW.missing():
        console.print(f"no run.rrd for the viewer, which needs rerun: {VIEW.remedy()}", soft_wrap=True)
    console.print(f"as a film: {command_path()} export {folder} --to film.gif", soft_wrap=True)


def _gateways(options: GatewayOptions, scenario: Scenario) -> Gateways | None:
    if options == GatewayOptions():
        return None
    robots, revoked = scenario.robot_names(), options.revoked or []
    for name in revoked:
        if name not in robots:
            raise BadInput("--revoked", name, "expected a robot of the scenario")
    network = gateway_network(options.network, options.certs, revoked, insecure=options.insecure)
    return parse_gateways(options.gateways or [], options.options or [], options.swarm, network)


def parse_gateways(
    gateways: Sequence[str], options: Sequence[str], swarm: str | None, network: Network | None
) -> Gateways | None:
    """Parse `--gateway [GROUP=]KIND[@ADDRESS]` and its companion options; None without a gateway.

    BadInput for an invalid form, and for companion options without a gateway.
    """
    kinds: dict[str, str] = {}
    for text in gateways:
        before, at_sign, address = text.partition("@")
        group, equals, kind = before.rpartition("=")
        if not kind or (equals and not group) or (at_sign and not address):
            raise BadInput("--gateway", text, "expected KIND, KIND@ADDRESS, GROUP=KIND or GROUP=KIND@ADDRESS")
        if group in kinds:
            robots = f"the group {group!r}" if group else "all groups"
            raise BadInput("--gateway", text, f"expected one gateway for {robots}, got a second one")
        kinds[group] = f"{kind}{at_sign}{address}"
    if kinds:
        parsed = Gateways(kinds, dict(_parse_option(text) for text in options))
        parsed = parsed if swarm is None else replace(parsed, swarm=swarm)
        return parsed if network is None else replace(parsed, network=network)
    network_flag = "--network"
    if network is not None and (network.proves or network.insecure):
        network_flag = "--certs" if network.proves else "--insecure"
    for flag, value in (("--gateway-set", bool(options)), ("--swarm", swarm), (network_flag, network)):
        if value:
            raise BadInput(flag, "", "expected --gateway with it: no robot of this run answers as a real one")
    return None


def gateway_network(
    endpoint: str | None, certs: Path | None, revoked: Sequence[str] = (), *, insecure: bool
) -> Network | None:
    """Return the network of `--network` and its companion options; None without these. BadInput if it is not safe.

    The run is the tracker of its robots' network, and has its name.
    """
    name = None if certs is None else TRACKER
    credentials = member(TRACKER, certs=certs, name=name, revoked=revoked, insecure=insecure).network
    if endpoint is None and credentials == Network():
        return None
    network = replace(credentials, listen=LOOPBACK.listen if endpoint is None else (endpoint,))
    try:
        network.check("")
    except BadInput as error:
        raise BadInput("--network", "", as_options(error.expected)) from None
    return network


def _parse_option(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals or not name.strip():
        raise BadInput("--gateway-set", text, "expected OPTION=VALUE or GROUP.OPTION=VALUE")
    try:
        table = from_toml(f"value = {value}")
    except tomllib.TOMLDecodeError:
        return name.strip(), value.strip()
    return name.strip(), table["value"] if len(table) == 1 else value
