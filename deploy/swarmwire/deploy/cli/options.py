"""Arguments and options that several commands share, commands whose options are a dataclass, and the exit codes."""

import inspect
import select
import sys
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, get_type_hints

import typer

from swarmwire.comms.base.errors import Interrupted

if TYPE_CHECKING:
    from swarmwire.deploy.runs.controls import Interrupt

ACCESS = "Beyond this machine"
GATEWAYS = "Robots that answer as real ones"
OptionsT = TypeVar("OptionsT")


def with_options(command: Callable[[OptionsT], None]) -> Callable[..., None]:
    """Return the typer command of a function whose only parameter is a dataclass of arguments and options.

    A field that is itself a dataclass is a group of options, which several commands can share.
    """
    kind: type[Any] = next(iter(get_type_hints(command).values()))
    parameters = list(_parameters(kind))

    @wraps(command)
    def typer_command(**values: Any) -> None:
        command(_instance(kind, values))

    signature = inspect.Signature(parameters)
    typer_command.__signature__ = signature  # pyright: ignore[reportAttributeAccessIssue] - typer reads it
    typer_command.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return typer_command


def _parameters(kind: type[Any]) -> Iterator[inspect.Parameter]:
    """Return a parameter for each option, groups in the order of their fields."""
    hints = get_type_hints(kind, include_extras=True)
    for option in fields(kind):
        hint = hints[option.name]
        if is_dataclass(hint):
            yield from _parameters(hint)  # pyright: ignore[reportArgumentType] - a class, not an instance
        else:
            default = inspect.Parameter.empty if option.default is MISSING else option.default
            keyword = inspect.Parameter.KEYWORD_ONLY
            yield inspect.Parameter(option.name, keyword, default=default, annotation=hint)


def _instance(kind: type[OptionsT], values: Mapping[str, Any]) -> OptionsT:
    hints = get_type_hints(kind)
    names = [option.name for option in fields(kind)]  # pyright: ignore[reportArgumentType] - a dataclass
    return kind(
        **{name: _instance(hints[name], values) if is_dataclass(hints[name]) else values[name] for name in names}
    )


def resolve_scenario(path: Path | None) -> Path | None:
    """Return the file of a scenario, also for a swarm's folder; None without a path."""
    if path is None:
        return None
    from swarmwire.comms.base.config import scenario_path

    return scenario_path(path)


ScenarioFile = Annotated[
    Path,
    typer.Argument(
        help="The scenario, a TOML file, or a folder with scenario.toml.", metavar="SCENARIO", callback=resolve_scenario
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


Port = Annotated[
    int | None, typer.Option(help="Port of the page for a browser. Default: a free one.", min=1, max=65535)
]
WithParent = Annotated[bool, typer.Option("--with-parent", hidden=True, help="End when standard input is closed.")]
BagPoses = Annotated[
    str | None,
    typer.Option(
        "--poses",
        help="Of a bag: topics of Odometry or PoseStamped, or topic, parent and frame of transforms, as in "
        '"/tf map {name}/base_link". Default: /{name}/odom.',
        metavar="TOPIC",
    ),
]
BagPackets = Annotated[
    str | None,
    typer.Option(
        "--packets", help="Of a bag: topics of the robots' packets. Default: /{name}/packets.", metavar="TOPIC"
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON, for programs.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]

OfRobots = Annotated[
    list[str] | None,
    typer.Option("--robots", help="Only these robots: flock-0,flock-3. Repeatable. Default: all.", metavar="NAMES"),
]
OfGroups = Annotated[
    list[str] | None, typer.Option("--group", help="Only the robots of these groups. Repeatable.", metavar="NAMES")
]


def certificate_names(option: str, right: str) -> typer.models.OptionInfo:
    """Return an option for names of certificates; `right` says what these members may do."""
    return typer.Option(
        option,
        help=f"A name on a certificate: {right}. For --certs without certs.json, which has these names. Repeatable.",
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
RunnerNames = Annotated[list[str] | None, certificate_names("--runner", "allowed to run robots' agents")]
RouterNames = Annotated[list[str] | None, certificate_names("--router", "allowed to forward permitted messages")]
WorldNames = Annotated[list[str] | None, certificate_names("--world", "accepted as the world")]
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


@dataclass(frozen=True)
class RunChoice:
    """Options that choose a live run."""

    run: str | None = None  # id or folder; None: the only run
    endpoint: str | None = None  # endpoint of a run on another machine; None: a run on this machine
    certs: Path | None = None
    name: str | None = None
    insecure: bool = False


FAILED = 1  # the run failed: an agent's error, a runner lost
DIFFERENT = 1  # a repetition differs, or there is nothing to compare it with
BAD_INPUT = 2
HUNG_UP = 129  # the terminal is gone, with a summary
INTERRUPTED = 130  # Ctrl-C, with a summary


@contextmanager
def leaving_when_hung_up(interrupt: "Interrupt") -> Generator[None]:
    """Leave the command without output after the block if SIGHUP came in it: the terminal is gone."""
    try:
        yield
    except Interrupted:  # before the first tick
        if not interrupt.hung_up:
            raise
    if interrupt.hung_up:
        raise typer.Exit(HUNG_UP)


def standard_input_closed() -> bool:
    """Return True at the end of standard input, which a run's process closes when it ends."""
    return bool(select.select([sys.stdin], [], [], 0)[0])
