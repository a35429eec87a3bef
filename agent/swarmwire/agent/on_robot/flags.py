"""The flags of `swarmwire-agent` that stand for keys of `robot.toml`, and what they were given."""

import argparse
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

from swarmwire.agent.on_robot.settings_file import NO_FILE, Flags
from swarmwire.comms.config import from_toml
from swarmwire.comms.errors import BadInput
from swarmwire.comms.plugins import resolve


class Flag(NamedTuple):
    """One flag, of one key."""

    name: str
    key: str
    help: str
    metavar: str = "VALUE"
    kind: str = "value"  # or "text", "path", "spec", "true", "list" (given several times), "pairs" (K=V, several times)


AGENT = "AGENT"
FLAGS = (
    Flag("--driver", "driver.name", "how the robot is reached: see `swarmwire-agent drivers`", "NAME", "text"),
    Flag("--address", "driver.address", "where the robot is reached, as its driver says", "ADDRESS", "text"),
    Flag("--option", "driver", "an option of the driver", "K=V", "pairs"),
    Flag("--radio", "radio.kind", "zenoh: the robots' own network; air: that of a world; none", "KIND", "text"),
    Flag("--max-payload-bytes", "radio.max_payload_bytes", "largest message, tag included", "N"),
    Flag("--name", "name", "this robot", "NAME", "text"),
    Flag("--swarm", "swarm", "the swarm", "NAME", "text"),
    Flag(
        "--robot",
        "robots",
        "a robot of the swarm, this one too: once for each, in the same order everywhere",
        "NAME",
        "list",
    ),
    Flag("--body", "body", "a body's name or its sheet; else the driver's", "NAME", "spec"),
    Flag("--param", "params", "a parameter of the agent", "K=V", "pairs"),
    Flag("--rate-hz", "rate_hz", "steps of the agent per second", "N"),
    Flag("--watchdog-s", "watchdog_s", "motors stop when the agent is later", "S"),
    Flag("--max-linear-mps", "max_linear_mps", "fastest speed; else half the body's", "V"),
    Flag("--max-angular-radps", "max_angular_radps", "fastest turn; else half the body's", "W"),
    Flag("--tracker", "tracker", "poses of robots come over the network", kind="true"),
    Flag("--listen", "network.listen", "where others may call: tcp/127.0.0.1:7547", "ENDPOINT", "list"),
    Flag("--connect", "network.connect", "whom to call: tcp/127.0.0.1:7548", "ENDPOINT", "list"),
    Flag("--multicast", "network.multicast", "find one another in the local network", kind="true"),
    Flag("--ca", "network.ca", "certificate that signed all others", "FILE", "path"),
    Flag("--certificate", "network.certificate", "the robot's certificate", "FILE", "path"),
    Flag("--key", "network.key", "its private key", "FILE", "path"),
    Flag("--insecure", "network.insecure", "go without certificates beyond this machine", kind="true"),
    Flag("--log", "log", "folder for the logs; else there is none", "FOLDER", "path"),
    Flag("--pace", "pace", "times as fast as the wall clock, for an emulated robot", "X"),
    Flag("--seed", "seed", "of the agent's draws", "N"),
)

OF_DRIVER = ("--driver", "--address", "--option", "--name", "--body")  # all that stopping the motors needs
NO_FLAG = {"agent": AGENT, "driver": "--driver", "network": "--listen"}  # for keys that are missing as a whole
CURES = {  # as errors name the keys
    "listen, connect or multicast = true": "--listen, --connect or --multicast",
    "ca, certificate and key": "--ca, --certificate and --key",
    "insecure = true": "--insecure",
    "tracker = true": "--tracker",
    'radio.kind "zenoh" or "air"': "--radio zenoh or --radio air",
    "rate_hz": "--rate-hz",
}


def add_flags(parser: argparse.ArgumentParser, only_driver: bool = False) -> None:
    """The agent and all flags; the help may list those of the driver alone."""
    spec = argparse.SUPPRESS if only_driver else '"file.py:Class" or "package.module:Class"'
    parser.add_argument("agent", metavar=AGENT, nargs="?", help=spec)
    for flag in FLAGS:
        told = argparse.SUPPRESS if only_driver and flag.name not in OF_DRIVER else flag.help
        if flag.kind == "true":
            parser.add_argument(flag.name, dest=flag.name, action="store_const", const=True, help=told)
        else:
            action = "append" if flag.kind in ("list", "pairs") else "store"
            parser.add_argument(flag.name, dest=flag.name, action=action, metavar=flag.metavar, help=told)


def given_flags(parsed: argparse.Namespace) -> Flags:
    """What the flags were given, by the keys that they stand for; BadInput for a pair that is none."""
    given: dict[str, tuple[str, Any]] = {}
    if parsed.agent is not None:
        given["agent"] = AGENT, resolve(parsed.agent, Path())
    for flag in FLAGS:
        value = getattr(parsed, flag.name)
        if value is None:
            continue
        if flag.kind == "pairs":
            given |= {f"{flag.key}.{name}": (f"{flag.name} {name}", told) for name, told in _pairs(flag, value)}
        else:
            given[flag.key] = flag.name, _read(flag, value)
    return given


def by_flag(error: BadInput, where: str, flags: Flags) -> BadInput:
    """The fault of a key of the settings in `where`, told of the flag that gave it, if one did.

    Where there is no file, cures that are keys are told as flags, too.
    """
    expected = _in_flags(error.expected) if where == NO_FILE else error.expected
    flag = next((flag for key, (flag, _) in flags.items() if (error.where, error.key) == (where, key)), None)
    if flag or error.where != NO_FILE:
        return BadInput(flag or error.where, "" if flag else error.key, expected)
    missing = next((flag.name for flag in FLAGS if flag.key == error.key), NO_FLAG.get(error.key))
    return BadInput(error.where, missing or error.key, expected)


def _in_flags(text: str) -> str:
    """A cure that names keys of the settings, in flags.

    >>> _in_flags("expected listen, connect or multicast = true")
    'expected --listen, --connect or --multicast'
    >>> _in_flags('expected radio.kind "zenoh" or "air"')
    'expected --radio zenoh or --radio air'
    """
    for keys, told in CURES.items():
        text = text.replace(keys, told)
    return text


def _read(flag: Flag, value: Any) -> Any:
    """A path is meant from where the command is given, not from where the settings lie."""
    if flag.kind == "value":
        return _plain(value)
    is_path = flag.kind == "path" or (flag.kind == "spec" and value.endswith(".toml"))
    return str(Path(value).resolve()) if is_path else value


def _pairs(flag: Flag, texts: list[str]) -> list[tuple[str, Any]]:
    pairs = [text.partition("=") for text in texts]
    wrong = next((text for text, (name, equals, _) in zip(texts, pairs, strict=True) if not (name and equals)), None)
    if wrong is not None:
        raise BadInput(flag.name, "", f"expected a name and its value, such as speed=0.1; got {wrong!r}")
    return [(name, _plain(text)) for name, _, text in pairs]


def _plain(text: str) -> Any:
    """The value of a text as TOML has it, or the text itself: 0.1, true, [1, 2], left."""
    try:
        return from_toml(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text
