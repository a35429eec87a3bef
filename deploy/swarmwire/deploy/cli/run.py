"""`swarmwire run`."""

from pathlib import Path
from typing import TYPE_CHECKING

import typer
from rich.console import Console

from swarmwire.comms.errors import BadInput
from swarmwire.comms.extras import UI
from swarmwire.deploy.cli.options import (
    Ca,
    Certificate,
    Gateway,
    GatewaySet,
    Insecure,
    Key,
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
    Socket,
    Subtick,
    Swarm,
    Ui,
    View,
)
from swarmwire.deploy.cli.process import INTERRUPTED, leaving_when_hung_up, program

if TYPE_CHECKING:
    from collections.abc import Sequence

    from swarmwire.comms.interfaces import Observer
    from swarmwire.deploy.config import RunConfig
    from swarmwire.deploy.result import Result


def run_command(
    scenario: ScenarioFile,
    runners: Runners = "none",
    out: Out = None,
    seed: Seed = None,
    seeds: Seeds = None,
    overrides: Overrides = None,
    socket: Socket = None,
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
    ca: Ca = None,
    certificate: Certificate = None,
    key: Key = None,
    revoked: Revoked = None,
    insecure: Insecure = False,
    quiet: Quiet = False,
) -> None:
    """Run a scenario, show how it goes, and leave a run folder: summary, tables, recording, log.

    Without --realtime the same scenario and seed give the same run bit for bit, whatever --runners says.

    With --gateway robots answer as real ones would, in real time, to programs that drive them: swarmwire-agent, whose
    settings for each robot are written into the run folder, or any other that speaks the robot's protocol. For example:
    --gateway epuck2, or --gateway flock=ros2@tcp/127.0.0.1:7447.
    """
    # Imported here: numba and zenoh take a second, which --help and typing errors should not.
    from swarmwire.deploy.config import Recording, RunConfig, choose_seeds, packet_share
    from swarmwire.deploy.gateways.gateways import gateways_of_options, network_of
    from swarmwire.deploy.record.folder import default_folder
    from swarmwire.world.scenario_file import load_scenario

    if ui:
        UI.need("--ui")
    checked = load_scenario(scenario, overrides or [])
    for name in revoked or []:
        if name not in checked.robot_names():
            raise BadInput("--revoked", name, "expected a robot of the scenario")
    member = network_of(network, ca, certificate, key, revoked or [], insecure=insecure)
    chosen = choose_seeds(checked, seed, seeds)
    config = RunConfig(
        checked,
        seeds=chosen,
        runners=runners,
        out=out or default_folder(scenario.stem, chosen),
        socket=socket,
        realtime=realtime,
        subtick=subtick,
        gateways=gateways_of_options(gateway or [], gateway_set or [], swarm, member),
        record=Recording(packets=packet_share(packets), links=links, rrd=rrd, select=select),
    )
    run_shown(config, Console(quiet=quiet, highlight=False), view=view, ui=ui)


def run_shown(
    config: "RunConfig", console: Console, observers: "Sequence[Observer]" = (), *, view: bool, ui: bool
) -> None:
    """Run a scenario into its folder, shown while it goes on and afterwards."""
    from swarmwire.deploy.control.run_finder import Announced
    from swarmwire.deploy.host import compiling_told
    from swarmwire.deploy.live.live_view import LiveView
    from swarmwire.deploy.page.beside import PageBeside
    from swarmwire.deploy.simulation import Simulation, finished
    from swarmwire.deploy.terminal.progress import RobotsTold, run_progress
    from swarmwire.deploy.terminal.report import print_result

    folder = Path(config.out or "")
    with compiling_told(console):
        simulation = Simulation(config)
        with LiveView(folder) as live, PageBeside(simulation, folder, console) as page:
            beside = [(live, "view")] * view + [(page, "page")] * ui
            shown = [Announced(folder), RobotsTold(simulation, console), run_progress(simulation, console)]
            for observer in (*observers, *shown, *(opened for opened, _ in beside)):
                simulation.watch(observer)
            with leaving_when_hung_up(simulation.interrupt):
                result = finished(simulation)
            print_result(result, simulation.metrics.metrics, console)
            if simulation.record_failed:
                raise simulation.record_failed
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
