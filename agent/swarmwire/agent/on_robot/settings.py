"""Settings of one robot: the keys of `robot.toml`, the flags of `swarmwire-agent` that override them, and exit codes.

`read_settings` reads a file and flags into a checked `RobotSettings`; BadInput names the file and the first wrong key.
`by_flag` names the flag instead of the key if the value came from a flag.
"""

import argparse
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, NamedTuple, get_type_hints

from swarmwire.comms.base.config import (
    bounds_of,
    check_format,
    check_plain,
    did_you_mean,
    folder_of,
    from_toml,
    parameter,
    read_toml,
)
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.plugins import resolve
from swarmwire.comms.robot.bodies.tables import mapping_of, parse_table
from swarmwire.comms.wire.keys import fault_of_name
from swarmwire.comms.wire.network import Network

# Exit codes of `swarmwire-agent`.
ENDED = 0
FAILED = 1  # an agent's error, no driver, the guard is gone
BAD_INPUT = 2
INTERRUPTED = 130  # Ctrl-C

FORMAT = 1  # format of `robot.toml`
LOCAL_ENDPOINT = "tcp/127.0.0.1:7557"  # an endpoint that needs no certificate, in hints
NO_FILE = "command line"  # name of the file in errors of settings without one
Flags = Mapping[str, tuple[str, Any]]  # key of the settings -> the flag's name and value


@dataclass(frozen=True)
class RadioSettings:
    """The radio of the agent."""

    kind: str = parameter(
        "none",
        help="zenoh: the robots' own network; world: the emulated medium of a world; none",
        choices=("zenoh", "world", "none"),
    )
    max_payload_bytes: int = parameter(
        100,
        help="size of the largest message, tag included; larger messages are not sent",
        unit="B",
        at_least=2,
        at_most=65535,
    )


@dataclass(frozen=True)
class DriverSettings:
    """The driver, and the robot that it reaches."""

    name: str = parameter(help="expected a driver that `swarmwire-agent drivers` lists")
    address: str = parameter("", help="address of the robot, in the driver's format")
    options: dict[str, Any] = field(default_factory=dict[str, Any])  # unchecked; the driver declares its options


@dataclass(frozen=True)
class RobotSettings:
    """The settings of one robot; paths are absolute."""

    agent: str = parameter(
        help='the agent\'s class: "file.py:Class" or a policy "file.onnx" beside this file, or "package.module:Class"'
    )
    driver: DriverSettings = parameter(help='expected a table such as { name = "epuck2", address = "192.168.1.23" }')
    name: str = parameter("robot-0", help="name of this robot")
    swarm: str = parameter("swarm", help="name of the swarm, the root of its keys")
    robots: tuple[str, ...] = ()  # all robots of the swarm, by index; read settings have at least one
    params: dict[str, Any] = field(default_factory=dict[str, Any])
    body: str = parameter("", help="name of a body, or its data sheet; default: the driver's")
    rate_hz: int = parameter(10, help="steps of the agent per second", unit="Hz", at_least=1, at_most=1000)
    watchdog_s: float = parameter(
        0.5,
        help="delay of the agent that stops the motors; needs a working link",
        unit="s",
        at_least=0.01,
        at_most=10,
    )
    max_linear_mps: float | None = parameter(None, help="highest speed; default: half the body's", unit="m/s", above=0)
    max_angular_radps: float | None = parameter(
        None, help="highest turn rate; default: half the body's", unit="rad/s", above=0
    )
    radio: RadioSettings = field(default_factory=RadioSettings)
    tracker: bool = parameter(False, help="receive robots' poses over the network")
    network: Network | None = None
    log: str = parameter("", help="folder for the logs; default: none")
    pace: float = parameter(
        1.0, help="factor of the wall clock's speed, for an emulated robot", at_least=0.01, at_most=1000
    )
    seed: int = parameter(0, help="seed of the agent's random numbers, with the robot's index", at_least=0)
    format: int = FORMAT

    @property
    def index(self) -> int:
        """The robot's index in the swarm, by which other robots address it."""
        return self.robots.index(self.name)


def read_settings(file: Path | None, flags: Flags) -> RobotSettings:
    """Read the settings of a file, if there is one, and override them by flags.

    BadInput names the file and the first wrong key.
    """
    where = str(file) if file else NO_FILE
    table = read_toml(file) if file else {"format": FORMAT}
    check_format(table, FORMAT, where)
    base = (folder_of(file) if file else Path()).resolve()
    for key, (_, value) in flags.items():
        _put(table, key, value, where)
    return _settings(table, where, base)


def _put(table: dict[str, Any], key: str, value: Any, where: str) -> None:
    *parents, name = key.split(".")
    for parent in parents:
        table[parent] = table = mapping_of(where, parent, table.get(parent, {}))
    table[name] = value


def _settings(table: dict[str, Any], where: str, base: Path) -> RobotSettings:
    table = dict(table)
    for key in ("params", "driver"):
        if key in table:
            table[key] = mapping_of(where, key, table[key])
            check_plain(table[key], where, key)
    if "driver" in table:
        table["driver"] = _driver(table["driver"])
    network = table.pop("network", None)
    settings: RobotSettings = parse_table(RobotSettings, table, where, "")
    _check_names(settings, where)
    if network is not None:
        settings = replace(settings, network=Network.from_mapping(mapping_of(where, "network", network), where, base))
    if "\0" in settings.log:
        raise BadInput(where, "log", f"expected a folder, got {settings.log!r}")
    if settings.network is None and (settings.tracker or settings.radio.kind != "none"):
        hint = f'for agents on this machine alone, listen = ["{LOCAL_ENDPOINT}"]'
        expected = f"expected listen, connect or multicast = true, which radio and tracker need; {hint}"
        raise BadInput(where, "network", expected)
    return _absolute(replace(settings, robots=settings.robots or (settings.name,)), base)


def _driver(table: dict[str, Any]) -> dict[str, Any]:
    """Separate the driver's own options from the keys of all drivers."""
    common = {key: table[key] for key in ("name", "address") if key in table}
    return {**common, "options": {key: value for key, value in table.items() if key not in common}}


def _check_names(settings: RobotSettings, where: str) -> None:
    names = {"name": settings.name, "swarm": settings.swarm}
    names |= {f"robots[{index}]": name for index, name in enumerate(settings.robots)}
    for key, name in names.items():
        fault = fault_of_name(name)
        if fault:
            raise BadInput(where, key, fault)
    repeated = next((name for name in settings.robots if settings.robots.count(name) > 1), None)
    if repeated:
        raise BadInput(where, "robots", f"expected each robot once, got {repeated} twice")
    if settings.robots and settings.name not in settings.robots:
        raise BadInput(where, "name", f"expected {did_you_mean(settings.robots, settings.name)}; got {settings.name!r}")


def _absolute(settings: RobotSettings, base: Path) -> RobotSettings:
    """Return the settings with absolute paths; relative ones start at the folder `base` of the settings."""

    def path(name: str) -> str:
        return str((base / name).resolve()) if name else ""

    return replace(
        settings,
        agent=resolve(settings.agent, base),
        body=path(settings.body) if settings.body.endswith(".toml") else settings.body,
        log=path(settings.log),
    )


class Flag(NamedTuple):
    """A flag of `swarmwire-agent` that sets one key of `robot.toml`."""

    name: str
    key: str
    metavar: str = "VALUE"
    kind: str = "value"  # or "text", "path", "spec", "true", "list" (repeatable), "pairs" (K=V, repeatable)
    text: str = ""  # help; "": that of the key

    @property
    def help(self) -> str:
        """Help of the flag."""
        *tables, name = self.key.split(".")
        kind: Any = RobotSettings
        for table in tables if not self.text else ():
            kind = get_type_hints(kind)[table]
        return self.text or next(bounds_of(option).help for option in fields(kind) if option.name == name)


AGENT = "AGENT"
FLAGS = (
    Flag("--driver", "driver.name", "NAME", "text", "driver of the robot: see `swarmwire-agent drivers`"),
    Flag("--address", "driver.address", "ADDRESS", "text"),
    Flag("--option", "driver", "K=V", "pairs", "an option of the driver"),
    Flag("--radio", "radio.kind", "KIND", "text"),
    Flag("--max-payload-bytes", "radio.max_payload_bytes", "N"),
    Flag("--name", "name", "NAME", "text"),
    Flag("--swarm", "swarm", "NAME", "text"),
    Flag(
        "--robot",
        "robots",
        "NAME",
        "list",
        "a robot of the swarm, this one included: repeat for each, in the same order on all robots",
    ),
    Flag("--body", "body", "NAME", "spec"),
    Flag("--param", "params", "K=V", "pairs", "a parameter of the agent"),
    Flag("--rate-hz", "rate_hz", "N"),
    Flag("--watchdog-s", "watchdog_s", "S"),
    Flag("--max-linear-mps", "max_linear_mps", "V"),
    Flag("--max-angular-radps", "max_angular_radps", "W"),
    Flag("--tracker", "tracker", kind="true"),
    Flag("--listen", "network.listen", "ENDPOINT", "list", "endpoint for other robots: tcp/127.0.0.1:7547"),
    Flag("--connect", "network.connect", "ENDPOINT", "list", "endpoint to connect to: tcp/127.0.0.1:7548"),
    Flag("--multicast", "network.multicast", kind="true", text="discover robots in the local network"),
    Flag("--ca", "network.ca", "FILE", "path", "certificate of the authority that signed all others"),
    Flag("--certificate", "network.certificate", "FILE", "path", "the robot's certificate"),
    Flag("--key", "network.key", "FILE", "path", "private key of the certificate"),
    Flag("--insecure", "network.insecure", kind="true", text="connect beyond this machine without certificates"),
    Flag("--log", "log", "FOLDER", "path"),
    Flag("--pace", "pace", "X"),
    Flag("--seed", "seed", "N"),
)

DRIVER_FLAGS = ("--driver", "--address", "--option", "--name", "--body")  # sufficient to stop the motors
TABLE_FLAGS = {"agent": AGENT, "driver": "--driver", "network": "--listen"}  # missing table -> flag
HINTS = {  # keys in hints of errors -> flags
    "listen, connect or multicast = true": "--listen, --connect or --multicast",
    "ca, certificate and key": "--ca, --certificate and --key",
    "insecure = true": "--insecure",
    "tracker = true": "--tracker",
    'radio.kind "zenoh"': "--radio zenoh",
    'radio.kind "world"': "--radio world",
    f'listen = ["{LOCAL_ENDPOINT}"]': f"--listen {LOCAL_ENDPOINT}",
    "rate_hz": "--rate-hz",
}


def add_flags(parser: argparse.ArgumentParser, *, only_driver: bool) -> None:
    """Add the agent and all flags; `only_driver` hides the flags that do not concern the driver from the help."""
    agent_help = argparse.SUPPRESS if only_driver else '"file.py:Class", "file.onnx" or "package.module:Class"'
    parser.add_argument("agent", metavar=AGENT, nargs="?", help=agent_help)
    for flag in FLAGS:
        text = argparse.SUPPRESS if only_driver and flag.name not in DRIVER_FLAGS else flag.help
        if flag.kind == "true":
            parser.add_argument(flag.name, dest=flag.name, action="store_const", const=True, help=text)
        else:
            action = "append" if flag.kind in ("list", "pairs") else "store"
            parser.add_argument(flag.name, dest=flag.name, action=action, metavar=flag.metavar, help=text)


def flags_in(parsed: argparse.Namespace) -> Flags:
    """Return the flags of a command line by the keys that they set; BadInput for a malformed `K=V` pair."""
    flags: dict[str, tuple[str, Any]] = {}
    if parsed.agent is not None:
        flags["agent"] = AGENT, resolve(parsed.agent, Path())
    for flag in FLAGS:
        value = getattr(parsed, flag.name)
        if value is None:
            continue
        if flag.kind == "pairs":
            flags |= {f"{flag.key}.{name}": (f"{flag.name} {name}", option) for name, option in _pairs(flag, value)}
        else:
            flags[flag.key] = flag.name, _read(flag, value)
    return flags


def by_flag(error: BadInput, where: str, flags: Flags) -> BadInput:
    """Attribute an error of a key of the settings in `where` to the flag that set the key, if any.

    Without a file, hints that name keys name flags instead.
    """
    expected = in_flags(error.expected) if where == NO_FILE else error.expected
    flag = next((flag for key, (flag, _) in flags.items() if (error.where, error.key) == (where, key)), None)
    if flag or error.where != NO_FILE:
        return BadInput(flag or error.where, "" if flag else error.key, expected)
    missing = next((flag.name for flag in FLAGS if flag.key == error.key), TABLE_FLAGS.get(error.key))
    return BadInput(error.where, missing or error.key, expected)


def in_flags(text: str) -> str:
    """Replace keys of the settings in a hint by flags.

    >>> in_flags("expected listen, connect or multicast = true")
    'expected --listen, --connect or --multicast'
    >>> in_flags('expected radio.kind "zenoh" with tracker = true, or radio.kind "world"')
    'expected --radio zenoh with --tracker, or --radio world'
    """
    for keys, flags in HINTS.items():
        text = text.replace(keys, flags)
    return text


def _read(flag: Flag, value: Any) -> Any:
    """Parse the value of a flag; a path is relative to the working directory, not to the folder of the settings."""
    if flag.kind == "value":
        return _plain(value)
    is_path = flag.kind == "path" or (flag.kind == "spec" and value.endswith(".toml"))
    return str(Path(value).resolve()) if is_path else value


def _pairs(flag: Flag, texts: list[str]) -> list[tuple[str, Any]]:
    pairs = [text.partition("=") for text in texts]
    malformed = next(
        (text for text, (name, equals, _) in zip(texts, pairs, strict=True) if not (name and equals)), None
    )
    if malformed is not None:
        raise BadInput(flag.name, "", f"expected a name and its value, such as speed=0.1; got {malformed!r}")
    return [(name, _plain(text)) for name, _, text in pairs]


def _plain(text: str) -> Any:
    """Parse a value in TOML's syntax, or else return the text itself: 0.1, true, [1, 2], left."""
    try:
        return from_toml(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text
