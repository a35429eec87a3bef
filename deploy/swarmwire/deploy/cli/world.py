"""`swarmwire world` and `join`: a run whose robots are played from other machines."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarmwire.comms.base.extras import UI
from swarmwire.deploy.cli.options import (
    AgentNetwork,
    Certs,
    Insecure,
    Isolate,
    Links,
    Name,
    ObserverNames,
    OperatorNames,
    Out,
    Overrides,
    Packets,
    Quiet,
    RealTime,
    Revoked,
    RouterNames,
    Rrd,
    RunnerNames,
    ScenarioFile,
    Seed,
    Seeds,
    Select,
    Subtick,
    Ui,
    View,
)
from swarmwire.deploy.cli.run import run_shown
from swarmwire.deploy.terminal.console import TerminalConsole
from swarmwire.deploy.terminal.output import echo

if TYPE_CHECKING:
    from swarmwire.deploy.robots.certificates.member import MemberCredentials


def world_command(
    scenario: ScenarioFile,
    listen: Annotated[
        list[str],
        typer.Option("--listen", help="Endpoint for runners: tls/0.0.0.0:7447. Repeatable.", metavar="ENDPOINT"),
    ],
    observe: Annotated[
        list[str] | None,
        typer.Option("--observe", help="Endpoint for observers and operators. Repeatable.", metavar="ENDPOINT"),
    ] = None,
    start_with: Annotated[
        int | None,
        typer.Option(
            help="Start once this many robots have an agent; others follow run.on_runner_loss (stand or coast). "
            "Default: all.",
            metavar="N",
        ),
    ] = None,
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
    certs: Certs = None,
    name: Name = None,
    runners: RunnerNames = None,
    observers: ObserverNames = None,
    operators: OperatorNames = None,
    routers: RouterNames = None,
    revoked: Revoked = None,
    insecure: Insecure = False,
    quiet: Quiet = False,
) -> None:
    """Run a scenario with remote agents: wait for them, and print the command that starts them.

    Each joins with swarmwire join, from another terminal or another machine, with the agent that is installed there,
    and gets robots that are free. It may join late, leave, and rejoin, if run.on_runner_loss of the scenario is
    wait, stand or coast. For example:

      swarmwire world scenarios/flocking-lossy.toml --listen tls/0.0.0.0:7447 --certs lab-certs
    """
    # Imported here: numba and zenoh take a second, which --help and typing errors should not.
    from swarmwire.comms.wire.access_control import WORLD, RunAccess
    from swarmwire.deploy.cli.display.progress import JoinProgress
    from swarmwire.deploy.robots.certificates.member import member
    from swarmwire.deploy.runs.config import Listening, Recording, RunConfig, choose_seeds, packet_share
    from swarmwire.deploy.runs.record.folder import default_folder
    from swarmwire.world.scenario_file import load_scenario

    if ui:
        UI.need("--ui")
    checked = load_scenario(scenario, overrides or [])
    of = member(
        WORLD,
        certs=certs,
        name=name,
        access=RunAccess(
            runners=tuple(runners or ()),
            observers=tuple(observers or ()),
            operators=tuple(operators or ()),
            routers=tuple(routers or ()),
        ),
        revoked=revoked or (),
        insecure=insecure,
    )
    of.check("--listen", *listen)
    of.check("--observe", *(observe or ()))
    _warn(of, [*listen, *(observe or ())])
    chosen = choose_seeds(checked, seed, seeds)
    console = TerminalConsole(quiet=quiet)
    robots = tuple(robot for _ in chosen for robot in checked.robot_names())
    at, seen_at = tuple(listen), tuple(observe or ())
    with JoinProgress(robots, start_with, of.network, console) as gathering:
        config = RunConfig(
            checked,
            seeds=chosen,
            out=out or default_folder(scenario.stem, chosen),
            realtime=realtime,
            subtick=subtick,
            record=Recording(packets=packet_share(packets), links=links, rrd=rrd, select=select),
            listening=Listening(at, seen_at, of.network, of.access, start_with, observer=gathering),
        )
        run_shown(config, console, [gathering], view=view, ui=ui)


def _warn(of: "MemberCredentials", endpoints: list[str]) -> None:
    warning = of.warning(endpoints)
    if warning is not None:
        echo(f"warning: {warning}", err=True)


def join_command(
    endpoint: Annotated[str, typer.Argument(help="Endpoint of the world or of a router before it: tls/10.0.0.5:7447.")],
    robots: Annotated[
        int | None,
        typer.Option(help="Number of free robots to take. Default: all free ones."),
    ] = None,
    names: Annotated[str | None, typer.Option(help="These robots: flock-0,flock-3.", metavar="NAME,…")] = None,
    agents: Annotated[
        list[str] | None,
        typer.Option(
            "--agent",
            help="The agent, of all groups or of one: mine.py:Mine. Default: as the scenario names it. Repeatable.",
            metavar="[GROUP=]AGENT",
        ),
    ] = None,
    processes: Annotated[
        int | None, typer.Option(help="Number of agent processes. Default: one for each robot.", metavar="NUMBER")
    ] = None,
    scenario: Annotated[
        Path | None, typer.Option(help="Join only a run of exactly this scenario.", metavar="FILE")
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(help="The runner's name. Default: that of its certificate, or one made up.", metavar="NAME"),
    ] = None,
    run: Annotated[str | None, typer.Option(help="Id of the run, if there are several.", metavar="ID")] = None,
    agent_network: AgentNetwork = False,
    isolate: Isolate = False,
    certs: Certs = None,
    insecure: Insecure = False,
) -> None:
    """Run robots' agents for a run that `swarmwire world` serves.

    The agent is the one that is installed here; its file must be the same as the world's: code is never sent. Ctrl-C
    leaves the run. On a machine that has the agents' package alone it is swarmwire-agent join. For example:

      swarmwire join tls/10.0.0.5:7447 --robots 5 --certs lab-certs --name r1
    """
    # Imported here: zenoh takes a moment, which --help and typing errors should not.
    from swarmwire.agent.join_command import join_and_report, parse_names
    from swarmwire.agent.joining import JoinSettings
    from swarmwire.deploy.robots.certificates.member import member
    from swarmwire.deploy.robots.certificates.register import RUNNER

    of = member(RUNNER, certs=certs, name=name if certs else None, insecure=insecure)
    of.check("ENDPOINT", endpoint)
    code = join_and_report(
        JoinSettings(
            endpoint=endpoint,
            robots=robots,
            names=None if names is None else parse_names(names),
            agents=tuple(agents or ()),
            scenario=scenario,
            name=name,
            run=run,
            network=of.network,
        ),
        processes,
        agent_network=agent_network,
        isolate=isolate,
    )
    if code:
        raise typer.Exit(code)
