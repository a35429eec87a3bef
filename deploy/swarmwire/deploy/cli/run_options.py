"""Options of `run`, `world` and `repeat`, in groups that these commands share.

A field has the name of the field of `RunConfig`, `Recording`, `Listening` or `Gateways` that it sets: an error about
`threads` names the option `--threads`.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from swarmwire.deploy.cli.options import (
    GATEWAYS,
    AgentNetwork,
    Certs,
    Insecure,
    Isolate,
    Name,
    Overrides,
    Quiet,
    Revoked,
    RouterNames,
    RunnerNames,
    ScenarioFile,
    Seed,
    certificate_names,
)

RunnerProcesses = Annotated[
    str, typer.Option(help='Processes that run the agents: "none" (all in this one), a number, or "per-robot".')
]


@dataclass(frozen=True, kw_only=True)
class AgentOptions:
    """Processes of the agents, and their rights."""

    runners: RunnerProcesses = "none"
    agent_network: AgentNetwork = False
    isolate: Isolate = False


@dataclass(frozen=True, kw_only=True)
class StartOptions:
    """Changes of the scenario, the run folder, and real time."""

    out: Annotated[
        Path | None, typer.Option(help="The run folder, new or empty. Default: runs/<scenario>-s<seed>-<UTC>.")
    ] = None
    seed: Seed = None
    seeds: Annotated[
        str | None,
        typer.Option(help="One arena per seed, side by side: 9 (1 to 9), 4:10 (4 to 9) or 1,5,7.", metavar="SEEDS"),
    ] = None
    overrides: Overrides = None
    realtime: Annotated[
        str | None,
        typer.Option(help="Run at this many simulated seconds per second, and wait for no runner.", metavar="FACTOR"),
    ] = None
    subtick: Annotated[
        float | None,
        typer.Option(
            help="In real time, interval in s at which packets are exchanged between ticks, 0.001 or more.",
            metavar="SECONDS",
        ),
    ] = None


@dataclass(frozen=True, kw_only=True)
class PacketOptions:
    """Recording of packets and links."""

    packets: Annotated[
        str,
        typer.Option(
            help='Packets to record in packets.parquet: "off", "all", or a share of them, such as 0.1.',
            metavar="off|all|SHARE",
        ),
    ] = "off"
    links: Annotated[
        bool, typer.Option("--links", help="Record radio_links.parquet: packets by sender, receiver and fate.")
    ] = False


@dataclass(frozen=True, kw_only=True)
class RecordingOptions(PacketOptions):
    """Recording of packets, links and pictures."""

    rrd: Annotated[bool, typer.Option(help="Record run.rrd, for rerun's viewer, if it is installed.")] = True
    select: Annotated[
        str | None,
        typer.Option(help="Robot that the views show in detail. Default: the first with rays.", metavar="ROBOT"),
    ] = None


@dataclass(frozen=True, kw_only=True)
class OpenViews:
    """Views of the run while it runs."""

    view: Annotated[bool, typer.Option("--view", help="Show the run live, as `swarmwire view` does.")] = False
    ui: Annotated[
        bool,
        typer.Option("--ui", help="Control the run in a browser, as `swarmwire ui` does; it starts paused."),
    ] = False


@dataclass(frozen=True, kw_only=True)
class GatewayOptions:
    """Robots that answer as real ones, and their network."""

    gateways: Annotated[
        list[str] | None,
        typer.Option(
            "--gateway",
            help="All robots, or those of GROUP, answer as real ones: as crazyflie, epuck2 or ros2 (swarmwire list "
            "gateways), at ADDRESS, or where the gateway chooses. With radio-only they are elsewhere, and "
            "use the run's radio. Repeatable.",
            metavar="[GROUP=]KIND[@ADDRESS]",
            rich_help_panel=GATEWAYS,
        ),
    ] = None
    options: Annotated[
        list[str] | None,
        typer.Option(
            "--gateway-set",
            help="Set an option of the gateways that have it, or of GROUP's; swarmwire describe gateway:KIND names "
            "them. Repeatable.",
            metavar="[GROUP.]OPTION=VALUE",
            rich_help_panel=GATEWAYS,
        ),
    ] = None
    network: Annotated[
        str | None,
        typer.Option(
            help="Endpoint at which robots' agents get poses and use the run's radio. Default: "
            "tcp/127.0.0.1:0, a free port of this machine.",
            metavar="ENDPOINT",
            rich_help_panel=GATEWAYS,
        ),
    ] = None
    swarm: Annotated[
        str | None,
        typer.Option(
            help="Name of the swarm in that network. Default: swarm.", metavar="NAME", rich_help_panel=GATEWAYS
        ),
    ] = None
    certs: Certs = None
    revoked: Revoked = None
    insecure: Insecure = False


@dataclass(frozen=True, kw_only=True)
class RunCommandOptions:
    """Options of `swarmwire run`."""

    scenario: ScenarioFile
    agents: AgentOptions
    threads: Annotated[
        int,
        typer.Option(
            help="Threads of this process for one tick: more change nothing but the speed, of large swarms.",
            metavar="NUMBER",
        ),
    ] = 1
    start: StartOptions
    recording: RecordingOptions
    views: OpenViews
    gateway: GatewayOptions
    quiet: Quiet = False


@dataclass(frozen=True, kw_only=True)
class MemberOptions:
    """The certificates of a world, and names on those of others."""

    certs: Certs = None
    name: Name = None
    runners: RunnerNames = None
    observers: Annotated[list[str] | None, certificate_names("--observer", "allowed to observe")] = None
    operators: Annotated[list[str] | None, certificate_names("--operator", "allowed to observe and control")] = None
    routers: RouterNames = None
    revoked: Revoked = None
    insecure: Insecure = False


@dataclass(frozen=True, kw_only=True)
class WorldOptions:
    """Options of `swarmwire world`."""

    scenario: ScenarioFile
    endpoints: Annotated[
        list[str],
        typer.Option("--listen", help="Endpoint for runners: tls/0.0.0.0:7447. Repeatable.", metavar="ENDPOINT"),
    ]
    observed: Annotated[
        list[str] | None,
        typer.Option("--observe", help="Endpoint for observers and operators. Repeatable.", metavar="ENDPOINT"),
    ] = None
    start_with: Annotated[
        int | None,
        typer.Option(
            help="Start once this many robots have an agent; others follow run.on_runner_loss (stand or coast). "
            "Default: all.",
            metavar="N",
        ),
    ] = None
    start: StartOptions
    recording: RecordingOptions
    views: OpenViews
    members: MemberOptions
    quiet: Quiet = False


@dataclass(frozen=True, kw_only=True)
class RepeatOptions:
    """Options of `swarmwire repeat`."""

    folder: Annotated[Path, typer.Argument(help="The run folder, or a campaign's folder.", metavar="RUN")]
    run: Annotated[int | None, typer.Option(help="Number of the run in a campaign.", metavar="NUMBER")] = None
    runners: RunnerProcesses = "none"
    out: Annotated[
        Path | None, typer.Option(help="A run folder for the repetition, new or empty. Default: nothing is written.")
    ] = None
    recording: PacketOptions
    quiet: Quiet = False
