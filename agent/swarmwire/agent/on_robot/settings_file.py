"""Reads the settings of a robot from its `robot.toml` and from flags, which override it; refused at the door."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from swarmwire.agent.on_robot.settings import FORMAT, RobotSettings
from swarmwire.comms.bodies.tables import built, mapping_of
from swarmwire.comms.config import check_format, check_plain, one_of, read_toml
from swarmwire.comms.errors import BadInput
from swarmwire.comms.plugins import resolve
from swarmwire.comms.wire.keys import fault_of_name
from swarmwire.comms.wire.network import Network

NO_FILE = "command line"  # where it is, in errors, when there is no file
Flags = Mapping[str, tuple[str, Any]]  # key within the settings -> the flag, and what it was given


def read_settings(file: Path | None, flags: Flags) -> RobotSettings:
    """The settings of a file, if there is one, with what the flags say in place of its own.

    BadInput names the file and the key of the first that is wrong.
    """
    where = str(file) if file else NO_FILE
    table = read_toml(file) if file else {"format": FORMAT}
    check_format(table, FORMAT, where)
    beside = (file.parent if file else Path()).resolve()
    for key, (_, value) in flags.items():
        _put(table, key, value, where)
    return _settings(table, where, beside)


def _put(table: dict[str, Any], key: str, value: Any, where: str) -> None:
    *parents, name = key.split(".")
    for parent in parents:
        table[parent] = table = mapping_of(where, parent, table.get(parent, {}))
    table[name] = value


def _settings(table: dict[str, Any], where: str, beside: Path) -> RobotSettings:
    table = dict(table)
    for key in ("params", "driver"):
        if key in table:
            table[key] = mapping_of(where, key, table[key])
            check_plain(table[key], where, key)
    if "driver" in table:
        table["driver"] = _driver(table["driver"])
    network = table.pop("network", None)
    read: RobotSettings = built(RobotSettings, table, where, "")
    _check_names(read, where)
    if network is not None:
        read = replace(read, network=Network.from_mapping(mapping_of(where, "network", network), where, beside))
    if "\0" in read.log:
        raise BadInput(where, "log", f"expected a folder, got {read.log!r}")
    if read.network is None and (read.tracker or read.radio.kind != "none"):
        raise BadInput(where, "network", "expected listen, connect or multicast = true: radio and tracker need it")
    return _absolute(replace(read, robots=read.robots or (read.name,)), beside)


def _driver(table: dict[str, Any]) -> dict[str, Any]:
    """The driver's own options apart from what all drivers have."""
    common = {key: table[key] for key in ("name", "address") if key in table}
    return {**common, "options": {key: value for key, value in table.items() if key not in common}}


def _check_names(settings: RobotSettings, where: str) -> None:
    names = {"name": settings.name, "swarm": settings.swarm}
    names |= {f"robots[{place}]": name for place, name in enumerate(settings.robots)}
    for key, name in names.items():
        fault = fault_of_name(name)
        if fault:
            raise BadInput(where, key, fault)
    twice = next((name for name in settings.robots if settings.robots.count(name) > 1), None)
    if twice:
        raise BadInput(where, "robots", f"expected each robot once, got {twice} twice")
    if settings.robots and settings.name not in settings.robots:
        raise BadInput(where, "name", f"expected {one_of(settings.robots, settings.name)}; got {settings.name!r}")


def _absolute(settings: RobotSettings, beside: Path) -> RobotSettings:
    """With the paths of files, which lie beside the settings, absolute."""

    def path(name: str) -> str:
        return str((beside / name).resolve()) if name else ""

    return replace(
        settings,
        agent=resolve(settings.agent, beside),
        body=path(settings.body) if settings.body.endswith(".toml") else settings.body,
        log=path(settings.log),
    )
