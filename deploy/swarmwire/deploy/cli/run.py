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
    from swarmwire.deploy.result import Result
    from swarmwire.deploy.simulation import Simulation


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
    from swarmwire.deploy.arguments import choose_seeds
    from swarmwire.deploy.compiling import compiling_told
    from swarmwire.deploy.gateways.gateways import gateways_of_options, network_of
    from swarmwire.deploy.record.new_folder import default_folder
    from swarmwire.deploy.record.recording import Recording, packet_share
    from swarmwire.deploy.simulation import Simulation
    from swarmwire.world.scenario_file import load_scenario

    if ui:
        UI.need("--ui")
    checked = load_scenario(scenario, overrides or [])
    for name in revoked or []:
        if name not in checked.robot_names():
            raise BadInput("--revoked", name, "expected a robot of the scenario")
    member = network_of(network, ca, certificate, key, revoked or [], insecure=insecure)
    gateways = gateways_of_options(gateway or [], gateway_set or [], swarm, member)
    chosen = choose_seeds(checked, seed, seeds)
    folder = out or default_folder(scenario.stem, chosen)
    console = Console(quiet=quiet, highlight=False)
    with compiling_told(console):
        simulation = Simulation(
            checked,
            seeds=chosen,
            runners=runners,
            out=folder,
            socket=socket,
            realtime=realtime,
            subtick=subtick,
            gateways=gateways,
            record=Recording(packets=packet_share(packets), links=links, rrd=rrd, select=select),
        )
        result = run_shown(simulation, folder, console, view=view, ui=ui)
    if result.ended == "interrupted":
        raise typer.Exit(INTERRUPTED)


def run_shown(
    simulation: "Simulation", folder: Path, console: Console, *, view: bool = False, ui: bool = False
) -> "Result":
    """The result of the run, told and shown while it goes on and afterwards."""
    from swarmwire.deploy.control.run_finder import Announced
    from swarmwire.deploy.live.live_view import LiveView
    from swarmwire.deploy.page.beside import PageBeside
    from swarmwire.deploy.running import finished
    from swarmwire.deploy.terminal.progress import RobotsTold, run_progress
    from swarmwire.deploy.terminal.report import print_result

    simulation.watch(Announced(folder))
    simulation.watch(RobotsTold(simulation, console))
    simulation.watch(run_progress(simulation, console))
    with LiveView(folder) as live, PageBeside(simulation, folder, console) as page:
        for wanted, beside in ((view, live), (ui, page)):
            if wanted:
                simulation.watch(beside)
        with leaving_when_hung_up(simulation.interrupt):
            result = finished(simulation)
        print_result(result, simulation.metrics.metrics, console)
        if simulation.record_failed:
            raise simulation.record_failed
        _say_where(result, folder, console)
        for beside, name in ((live, "view"), (page, "page")):
            if beside.pid is not None:
                console.print(f"the {name} stays open: close it, or press Ctrl-C, to end it")
        live.wait()
        page.wait()
    return result


def _say_where(result: "Result", folder: Path, console: Console) -> None:
    recorded = f" (the pictures of seed {result.arenas[0].seed})" if len(result.arenas) > 1 else ""
    console.print(f"written: {folder}{recorded}", soft_wrap=True)
    console.print(f"look at it: {program()} view {folder}", soft_wrap=True)
    console.print(f"as a film: {program()} export {folder} --to film.gif", soft_wrap=True)
