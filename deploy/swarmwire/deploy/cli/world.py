"""The commands `world` and `join`: a run whose agents join from other processes or machines."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from swarmwire.deploy.cli.options import AgentNetwork, Certs, Insecure, Isolate, with_options
from swarmwire.deploy.cli.run_options import WorldOptions
from swarmwire.deploy.machine import need_address_space


@with_options
def world_command(options: WorldOptions) -> None:
    """Run a scenario with remote agents: wait for them, and print the command that starts them.

    Each joins with swarmwire join, from another terminal or another machine, with the agent that is installed there,
    and gets robots that are free. It may join late, leave, and rejoin, if run.on_runner_loss of the scenario is
    wait, stand or coast. For example:

      swarmwire world scenarios/flocking-lossy.toml --listen tls/0.0.0.0:7447 --certs lab-certs
    """
    need_address_space()  # before libraries are loaded, which may end the process if there is too little
    from swarmwire.deploy.cli.actions.world import serve_world

    serve_world(options)


@dataclass(frozen=True, kw_only=True)
class JoinCommandOptions:
    """Options of `swarmwire join`."""

    endpoint: Annotated[str, typer.Argument(help="Endpoint of the world or of a router before it: tls/10.0.0.5:7447.")]
    robots: Annotated[
        int | None,
        typer.Option(help="Number of free robots to take. Default: all free ones."),
    ] = None
    names: Annotated[str | None, typer.Option(help="These robots: flock-0,flock-3.", metavar="NAME,…")] = None
    agents: Annotated[
        list[str] | None,
        typer.Option(
            "--agent",
            help="The agent, of all groups or of one: mine.py:Mine. Default: as the scenario names it. Repeatable.",
            metavar="[GROUP=]AGENT",
        ),
    ] = None
    processes: Annotated[
        int | None, typer.Option(help="Number of agent processes. Default: one for each robot.", metavar="NUMBER")
    ] = None
    scenario: Annotated[Path | None, typer.Option(help="Join only a run of exactly this scenario.", metavar="FILE")] = (
        None
    )
    name: Annotated[
        str | None,
        typer.Option(help="The runner's name. Default: that of its certificate, or one made up.", metavar="NAME"),
    ] = None
    run: Annotated[str | None, typer.Option(help="Id of the run, if there are several.", metavar="ID")] = None
    agent_network: AgentNetwork = False
    isolate: Isolate = False
    certs: Certs = None
    insecure: Insecure = False


@with_options
def join_command(options: JoinCommandOptions) -> None:
    """Run robots' agents for a run that `swarmwire world` serves.

    The agent is the one that is installed here; its file must be the same as the world's: code is never sent. Ctrl-C
    leaves the run. On a machine that has the agents' package alone it is swarmwire-agent join. For example:

      swarmwire join tls/10.0.0.5:7447 --robots 5 --certs lab-certs --name r1
    """
    from swarmwire.deploy.cli.actions.join import join_world

    join_world(options)
