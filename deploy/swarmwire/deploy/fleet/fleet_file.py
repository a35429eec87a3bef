"""`fleet.toml`: robots, how they are reached, and what runs on them; read and checked key by key."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from swarmwire.comms.config import check_format, did_you_mean, read_toml
from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.keys import fault_of_name
from swarmwire.deploy.fleet.fleet import Fleet, Host, Robot
from swarmwire.deploy.fleet.fleet_keys import FORMAT, HOST_KEYS, OF_FLEET, OF_ROBOT, SETTINGS, checked_table
from swarmwire.deploy.fleet.host_side.folders import TAKEN

NETWORK_PORT = 7557  # not 7447, which a zenoh router or a bridge of ROS 2 has on the same machine
DEFAULTS: dict[str, Any] = {"port": 22, "key": "", "python": "python3", "network_port": NETWORK_PORT, "packages": []}


def read_fleet(file: Path) -> Fleet:
    """The fleet of a file; BadInput names the file and the first key that is wrong."""
    where = str(file)
    table = read_toml(file)
    check_format(table, FORMAT, where)
    checked_table(table, OF_FLEET, where, "")
    for key in ("swarm", "robots"):
        if key not in table:
            raise BadInput(where, key, "is missing")
    fault = fault_of_name(table["swarm"])
    if fault:
        raise BadInput(where, "swarm", fault)
    certificates = _certificates(table, file)
    robots = _robots(table, where, file.parent, "tcp" if certificates is None else "tls")
    return Fleet(
        file=file,
        swarm=table["swarm"],
        robots=robots,
        known_hosts=file.parent / table.get("known_hosts", "known_hosts"),
        certificates=certificates,
        operator=table.get("operator", "operator"),
    )


def _certificates(table: Mapping[str, Any], file: Path) -> Path | None:
    if table.get("insecure", False):
        if "certificates" in table:
            raise BadInput(str(file), "insecure", "expected either certificates or insecure = true")
        return None
    if "certificates" not in table:
        raise BadInput(str(file), "certificates", "expected the folder of `swarmwire certs`, or insecure = true")
    return file.parent / table["certificates"]


def _robots(table: Mapping[str, Any], where: str, folder: Path, protocol: str) -> tuple[Robot, ...]:
    defaults = checked_table(table.get("defaults", {}), {**OF_ROBOT, "address": ()}, where, "defaults")
    groups = {
        name: checked_table(of, {**OF_ROBOT, "address": (), "groups": ()}, where, f"groups.{name}")
        for name, of in table.get("groups", {}).items()
    }
    if not table["robots"]:
        raise BadInput(where, "robots", "expected at least one robot, such as [robots.flock-0]")
    ports, hosts = _Ports(where), dict[Host, Host]()
    robots: list[Robot] = []
    for name, given in table["robots"].items():
        key = f"robots.{name}"
        fault = fault_of_name(name)
        if fault is None and name in TAKEN:
            fault = f"expected another name: on hosts ~/swarmwire/{name} is not a robot's"
        if fault:
            raise BadInput(where, key, fault)
        own = checked_table(given, OF_ROBOT, where, key)
        for group in own.get("groups", []):
            if group not in groups:
                raise BadInput(where, f"{key}.groups", f"expected {did_you_mean(groups, group)}; got {group!r}")
        layers = [("defaults", defaults), *((f"groups.{of}", groups[of]) for of in own.get("groups", [])), (key, own)]
        robot = _robot(name, layers, where, folder, protocol, ports)
        host = hosts.setdefault(robot.host, robot.host)
        if (host.python, host.key) != (robot.host.python, robot.host.key):
            raise BadInput(where, key, f"expected the python and the key that others at {host} have")
        robots.append(robot)
    return tuple(robots)


def _robot(
    name: str, layers: list[tuple[str, dict[str, Any]]], where: str, folder: Path, protocol: str, ports: "_Ports"
) -> Robot:
    """A robot of what the defaults, its groups and itself say, the last of them first."""
    whole, places = {**DEFAULTS}, dict[str, str]()
    for place, table in layers:
        for key, value in table.items():
            of_tables = isinstance(value, dict) and isinstance(whole.get(key), dict)
            whole[key] = {**whole[key], **cast("dict[str, Any]", value)} if of_tables else value
            places[key] = f"{place}.{key}"
    for key in ("address", "user", "agent", "driver"):
        if key not in whole:
            raise BadInput(where, f"robots.{name}.{key}", "is missing, here and in defaults")
    key_file = str((folder / Path(whole["key"]).expanduser()).resolve()) if whole["key"] else ""
    host = Host(whole["user"], whole["address"], whole["port"], key_file, whole["python"])
    reached = whole.get("network_address", whole["address"])
    port = ports.taken(name, reached, whole["network_port"], fixed="network_port" in layers[-1][1])
    return Robot(
        name=name,
        host=host,
        endpoint=f"{protocol}/{f'[{reached}]' if ':' in reached else reached}:{port}",
        groups=tuple(whole.get("groups", [])),
        packages=tuple(whole["packages"]),
        settings={key: value for key, value in whole.items() if key in SETTINGS and key not in HOST_KEYS},
        places=places,
    )


class _Ports:
    """Ports of the robots' network: robots that share an address get one after the other."""

    def __init__(self, where: str) -> None:
        self._where = where
        self._owners: dict[tuple[str, int], str] = {}

    def taken(self, robot: str, address: str, port: int, *, fixed: bool) -> int:
        """The robot's port: this one, or, unless it is `fixed`, the next that is free."""
        while not fixed and (address, port) in self._owners:
            port += 1
        owner = self._owners.setdefault((address, port), robot)
        if owner != robot:
            key = f"robots.{robot}.network_port"
            raise BadInput(self._where, key, f"expected a port that {owner}, at the same address, has not: {port}")
        return port
