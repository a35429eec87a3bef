"""Targets of an emergency stop: the names, endpoints and hosts in `fleet.toml`, as far as they can be read.

No fault of the file delays a stop: a value that does not fit counts as missing, and a line that is not TOML is
skipped. `fleet_file.read_fleet` names the faults afterwards. Light to import: a stop waits for it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar, cast

from swarmwire.comms.base.config import did_you_mean, folder_of
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.partial_toml import Table, merge, read_fragments, table_in
from swarmwire.comms.wire.access_control import OPERATOR
from swarmwire.comms.wire.keys import fault_of_name
from swarmwire.deploy.robots.certificates.register import revoked_in
from swarmwire.deploy.robots.fleet import NETWORK_PORT, SSH_PORT, Host, endpoint_at

ADDRESS_KEYS = ("address", "user", "port", "key", "network_address", "network_port", "groups")
Value = TypeVar("Value")


@dataclass(frozen=True)
class StopTarget:
    """One robot and its addresses; two robots of the same name are two targets."""

    robot: str
    endpoint: str  # endpoint in the robots' network; "": unknown
    host: Host | None  # None: unknown
    groups: tuple[str, ...]


@dataclass(frozen=True)
class StopTargets:
    """All robots in the file, and the routes to them.

    Attributes:
        swarm: root of the network's keys; "": unknown.
        certificates: folder of certificates; None: unknown or unused.
        revoked: names whose certificates are revoked.
        spare_endpoints: possible endpoints of robots whose ports depend on a robot without an address.
        faults: faults of files other than `fleet.toml`.
    """

    file: Path
    swarm: str
    robots: tuple[StopTarget, ...]
    known_hosts: Path
    certificates: Path | None
    insecure: bool
    operator: str
    revoked: tuple[str, ...]
    spare_endpoints: tuple[str, ...]
    faults: tuple[BadInput, ...]

    def select(self, names: Sequence[str], groups: Sequence[str]) -> tuple[tuple[StopTarget, ...], list[BadInput]]:
        """Return the robots of these names and groups, all without either, and a fault for each unknown name."""
        if not names and not groups:
            return self.robots, []
        unknown = _unknown("--robots", names, [target.robot for target in self.robots])
        unknown += _unknown("--group", groups, {group: 0 for target in self.robots for group in target.groups})
        selected = (target for target in self.robots if target.robot in names or set(target.groups) & set(groups))
        return tuple(selected), unknown

    def endpoints(self, robots: Iterable[StopTarget]) -> tuple[str, ...]:
        """Return the endpoints of these robots; if one of the file is uncertain, all, since each robot has a key."""
        targets = (*self.robots, *robots) if self.spare_endpoints else robots
        return tuple(dict.fromkeys(filter(None, (*(target.endpoint for target in targets), *self.spare_endpoints))))


def _unknown(option: str, names: Iterable[str], expected: Iterable[str]) -> list[BadInput]:
    choices = list(expected)
    wrong = (name for name in names if name not in choices)
    return [BadInput(option, "", f"expected {did_you_mean(choices, name)}; got {name!r}") for name in wrong]


def read_targets(file: Path) -> StopTargets:
    """Read as much as possible of a fleet's file; BadInput if nothing can be read."""
    table, robot_tables = _merged(read_fragments(file))
    certificates, insecure = _value([table], "certificates", str), table.get("insecure") is True
    folder = None if certificates is None else folder_of(file) / certificates
    revoked, faults = _revoked(folder)
    protocol = "tls" if folder is not None else "tcp"
    robots = _targets(table, robot_tables, folder_of(file), protocol)
    return StopTargets(
        file=file,
        swarm=_value([table], "swarm", str) or "",
        robots=robots,
        known_hosts=folder_of(file) / (_value([table], "known_hosts", str) or "known_hosts"),
        certificates=folder,
        insecure=insecure,
        operator=_value([table], "operator", str) or OPERATOR,
        revoked=revoked,
        spare_endpoints=_spare(robots),
        faults=faults,
    )


def _revoked(folder: Path | None) -> tuple[tuple[str, ...], tuple[BadInput, ...]]:
    """Return the revoked names; none and the fault if the register cannot be read."""
    try:
        return tuple(revoked_in(folder)) if folder is not None else (), ()
    except BadInput as error:
        return (), (error,)


def _merged(fragments: Iterable[Table]) -> tuple[Table, list[tuple[str, Table]]]:
    """Return the merged table, and the robots' tables by name; a name has several if their values differ."""
    table, robots = Table(), list[tuple[str, Table]]()
    for fragment in fragments:
        tables = table_in(fragment, "robots")
        for name in tables:
            last = next((other for other_name, other in reversed(robots) if other_name == name), None)
            values = {key: item for key, item in table_in(tables, name).items() if key in ADDRESS_KEYS}
            if last is None or any(last.get(key, item) != item for key, item in values.items()):
                robots.append((name, values))
            else:
                last.update(values)
        merge(table, fragment)
    return table, robots


def _targets(table: Table, robots: Iterable[tuple[str, Table]], folder: Path, protocol: str) -> tuple[StopTarget, ...]:
    targets, endpoints = list[StopTarget](), set[str]()
    for name, values in robots:
        if fault_of_name(name):  # no robot can have this name, and it must not reach a shell
            continue
        listed = cast("list[object]", _value([values], "groups", list) or [])
        groups = tuple(group for group in listed if isinstance(group, str))
        group_tables = (table_in(table_in(table, "groups"), group) for group in groups)
        layers = [table_in(table, "defaults"), *group_tables, values]
        address = _value(layers, "address", str)
        network_address = _value(layers, "network_address", str) or address
        endpoint = ""
        if network_address:
            port = _value(layers, "network_port", int) or NETWORK_PORT
            endpoint = endpoint_at(protocol, network_address, port)
            while endpoint in endpoints and "network_port" not in values:
                port += 1
                endpoint = endpoint_at(protocol, network_address, port)
            endpoints.add(endpoint)
        targets.append(StopTarget(name, endpoint, _host(layers, address, folder), groups))
    return tuple(targets)


def _host(layers: Sequence[Table], address: str | None, folder: Path) -> Host | None:
    user, key = _value(layers, "user", str), _value(layers, "key", str)
    if not address or not user:
        return None
    key_file = str((folder / Path(key).expanduser()).resolve()) if key else ""
    return Host(user, address, _value(layers, "port", int) or SSH_PORT, key_file, python="")


def _spare(robots: Sequence[StopTarget]) -> tuple[str, ...]:
    """Return the next ports of each address, one per robot without an endpoint, whose ports these may be."""
    endpoints = [target.endpoint for target in robots if target.endpoint]
    spare = dict[str, None]()
    for endpoint in endpoints:
        start, _, port = endpoint.rpartition(":")
        spare |= dict.fromkeys(f"{start}:{int(port) + 1 + i}" for i in range(len(robots) - len(endpoints)))
    return tuple(endpoint for endpoint in spare if endpoint not in endpoints)


def _value(layers: Sequence[Table], key: str, kind: type[Value]) -> Value | None:
    """Return the last value of this type; None without one."""
    fitting = (table[key] for table in reversed(layers) if type(table.get(key)) is kind)
    return next(fitting, None)
