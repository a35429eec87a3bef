"""Arguments and options that several commands take, and how commands end: each is defined here once.

Options stand in the order in which help shows them: what is run and how, what is recorded, where it is watched, access
to a network, and robots that answer as real ones.
"""

import select
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarmwire.comms.base.errors import Interrupted

if TYPE_CHECKING:
    from swarmwire.deploy.runs.controls import Interrupt

ACCESS = "Beyond this machine"
GATEWAYS = "Robots that answer as real ones"


def scenario_file(path: Path | None) -> Path | None:
    """Return the file of a scenario, which may be in a swarm's folder; None without a path."""
    if path is None:
        return None
    from swarmwire.comms.base.config import scenario_path

    return scenario_path(path)


ScenarioFile = Annotated[
    Path,
    typer.Argument(
        help="The scenario, a TOML file, or a folder with scenario.toml.", metavar="SCENARIO", callback=scenario_file
    ),
]
FleetFile = Annotated[Path, typer.Argument(help="The fleet, a TOML file.", metavar="FLEET")]
AuthorityFolder = Annotated[Path, typer.Argument(help="The folder of the CA.", metavar="DIR")]

Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="Set a value by its path, e.g. robots.flock.params.separation_m=0.3. Repeatable.",
        metavar="PATH=VALUE",
    ),
]
Seed = Annotated[int | None, typer.Option(help="Seed instead of the scenario's.")]
Seeds = Annotated[
    str | None,
    typer.Option(help="One arena per seed, side by side: 9 (1 to 9), 4:10 (4 to 9) or 1,5,7.", metavar="SEEDS"),
]
Runners = Annotated[
    str, typer.Option(help='Processes that run the agents: "none" (all in this one), a number, or "per-robot".')
]
AgentNetwork = Annotated[
    bool, typer.Option("--agent-network", help="Let agents in processes of their own use this machine's network.")
]
Isolate = Annotated[
    bool,
    typer.Option(
        "--isolate",
        help="For agents that you do not trust: their processes see no others and no run folder, all files read-only.",
    ),
]
Threads = Annotated[
    int,
    typer.Option(
        help="Threads of this process for one tick: more change nothing but the speed, of large swarms.",
        metavar="NUMBER",
    ),
]
RealTime = Annotated[
    str | None,
    typer.Option(help="Run at this many simulated seconds per second, and wait for no runner.", metavar="FACTOR"),
]
Subtick = Annotated[
    float | None,
    typer.Option(
        help="In real time, interval in s at which packets are exchanged between ticks, 0.001 or more.",
        metavar="SECONDS",
    ),
]

Out = Annotated[Path | None, typer.Option(help="The run folder, new or empty. Default: runs/<scenario>-s<seed>-<UTC>.")]
Packets = Annotated[
    str,
    typer.Option(
        help='Packets to record in packets.parquet: "off", "all", or a share of them, such as 0.1.',
        metavar="off|all|SHARE",
    ),
]
Links = Annotated[
    bool, typer.Option("--links", help="Record radio_links.parquet: packets by sender, receiver and fate.")
]
Rrd = Annotated[bool, typer.Option(help="Record run.rrd, for rerun's viewer.")]
Select = Annotated[
    str | None,
    typer.Option(help="Robot that the views show in detail. Default: the first with rays.", metavar="ROBOT"),
]

View = Annotated[bool, typer.Option("--view", help="Show the run live, as `swarmwire view` does.")]
Ui = Annotated[
    bool,
    typer.Option("--ui", help="Control the run in a browser, as `swarmwire ui` does; it starts paused."),
]
Port = Annotated[
    int | None, typer.Option(help="Port of the page for a browser. Default: a free one.", min=1, max=65535)
]
WithParent = Annotated[bool, typer.Option("--with-parent", hidden=True, help="End when standard input is closed.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON, for programs.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]

OfRobots = Annotated[
    list[str] | None,
    typer.Option("--robots", help="Only these robots: flock-0,flock-3. Repeatable. Default: all.", metavar="NAMES"),
]
OfGroups = Annotated[
    list[str] | None, typer.Option("--group", help="Only the robots of these groups. Repeatable.", metavar="NAMES")
]


def _names(option: str, who: str) -> typer.models.OptionInfo:
    return typer.Option(
        option,
        help=f"A name on a certificate: {who}. For --certs without certs.json, which has these names. Repeatable.",
        metavar="NAME",
        rich_help_panel=ACCESS,
    )


Endpoint = Annotated[
    str | None,
    typer.Option(
        help="Of a run on another machine: its endpoint for observers.", metavar="ENDPOINT", rich_help_panel=ACCESS
    ),
]
Certs = Annotated[
    Path | None,
    typer.Option(
        "--certs",
        help="A folder with ca.pem, NAME.pem and NAME.key, and certs.json, the register of `swarmwire certs`, which "
        "lists members and revoked names.",
        metavar="DIR",
        rich_help_panel=ACCESS,
    ),
]
Name = Annotated[
    str | None,
    typer.Option(
        "--name", help="Name on the certificate, if the folder has several.", metavar="NAME", rich_help_panel=ACCESS
    ),
]
RunnerNames = Annotated[list[str] | None, _names("--runner", "allowed to run robots' agents")]
ObserverNames = Annotated[list[str] | None, _names("--observer", "allowed to observe")]
OperatorNames = Annotated[list[str] | None, _names("--operator", "allowed to observe and control")]
RouterNames = Annotated[list[str] | None, _names("--router", "allowed to forward permitted messages")]
WorldNames = Annotated[list[str] | None, _names("--world", "accepted as the world")]
Revoked = Annotated[
    list[str] | None,
    typer.Option(
        "--revoked",
        help="A name whose certificate no longer counts, beside those of certs.json. Repeatable.",
        metavar="NAME",
        rich_help_panel=ACCESS,
    ),
]
Insecure = Annotated[
    bool,
    typer.Option(
        "--insecure",
        help="Go beyond this machine without certificates: every host there can join, read packets and drive robots.",
        rich_help_panel=ACCESS,
    ),
]

Gateway = Annotated[
    list[str] | None,
    typer.Option(
        help="All robots, or those of GROUP, answer as real ones: as crazyflie, epuck2 or ros2 (swarmwire list "
        "gateways), at ADDRESS, or where the gateway chooses. Repeatable.",
        metavar="[GROUP=]KIND[@ADDRESS]",
        rich_help_panel=GATEWAYS,
    ),
]
GatewaySet = Annotated[
    list[str] | None,
    typer.Option(
        help="Set an option of the gateways that have it, or of GROUP's; swarmwire describe gateway:KIND names them. "
        "Repeatable.",
        metavar="[GROUP.]OPTION=VALUE",
        rich_help_panel=GATEWAYS,
    ),
]
NetworkEndpoint = Annotated[
    str | None,
    typer.Option(
        "--network",
        help="Endpoint at which robots' agents get poses and use the run's radio. Default: "
        "tcp/127.0.0.1:0, a free port of this machine.",
        metavar="ENDPOINT",
        rich_help_panel=GATEWAYS,
    ),
]
Swarm = Annotated[
    str | None,
    typer.Option(help="Name of the swarm in that network. Default: swarm.", metavar="NAME", rich_help_panel=GATEWAYS),
]


OPTIONS_OF_FIELDS = {
    "agent_network": "--agent-network",
    "endpoints": "--listen",
    "gateways": "--gateway",
    "gateways.network": "--network",
    "gateways.options": "--gateway-set",
    "gateways.swarm": "--swarm",
    "isolate": "--isolate",
    "links": "--links",
    "observed": "--observe",
    "out": "--out",
    "overrides": "--set",
    "packets": "--packets",
    "realtime": "--realtime",
    "runners": "--runners",
    "seed": "--seed",
    "seeds": "--seeds",
    "select": "--select",
    "start_with": "--start-with",
    "subtick": "--subtick",
    "threads": "--threads",
}  # option of each field that BadInput of the Python API names

FAILED = 1  # the run failed: an agent's error, a runner lost
DIFFERENT = 1  # a repetition came out differently, or there is nothing to compare it with
BAD_INPUT = 2
HUNG_UP = 129  # the terminal is gone, with a summary
INTERRUPTED = 130  # Ctrl-C, with a summary


@contextmanager
def leaving_when_hung_up(interrupt: "Interrupt") -> Generator[None]:
    """Leave the command after the block if SIGHUP came in it, without a word: to print would fail."""
    try:
        yield
    except Interrupted:  # before the first tick
        if not interrupt.hung_up:
            raise
    if interrupt.hung_up:
        raise typer.Exit(HUNG_UP)


def standard_input_closed() -> bool:
    """Whether standard input is at its end; a view that belongs to a run ends with the run's process."""
    return bool(select.select([sys.stdin], [], [], 0)[0])
