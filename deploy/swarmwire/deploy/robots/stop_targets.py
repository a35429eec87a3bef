"""What an emergency stop needs of `fleet.toml`: names, endpoints and hosts, as far as they can be read.

No fault of the file holds up a stop: a value that does not fit counts as missing, and a line that is no TOML is left
out. `fleet_file.read_fleet` names the faults afterwards. Light to import: a stop waits for it.
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

REACH = ("address", "user", "port", "key", "network_address", "network_port", "groups")  # all that a stop needs
T = TypeVar("T")


@dataclass(frozen=True)
class StopTarget:
    """One robot, and where it is reached; two robots of the same name are two targets."""

    robot: str
    endpoint: str  # of the robots' network; "": unknown
    host: Host | None  # None: unknown
    groups: tuple[str, ...]


@dataclass(frozen=True)
class StopTargets:
    """All robots that the file names, and the ways to them.

    Attributes:
        swarm: root of the network's keys; "": unknown.
        certificates: their folder; None: not known, or not used.
        revoked: names whose certificates count no more.
        spare_endpoints: where robots may listen whose ports depend on a robot without an address.
        faults: those of files beside `fleet.toml`.
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

    def chosen(self, names: Sequence[str], groups: Sequence[str]) -> tuple[tuple[StopTarget, ...], list[BadInput]]:
        """The robots of these names and groups, all without either, and a fault for each name that is unknown."""
        if not names and not groups:
            return self.robots, []
        unknown = _unknown("--robots", names, [target.robot for target in self.robots])
        unknown += _unknown("--group", groups, {group: 0 for target in self.robots for group in target.groups})
        chosen = (target for target in self.robots if target.robot in names or set(target.groups) & set(groups))
        return tuple(chosen), unknown

    def endpoints(self, robots: Iterable[StopTarget]) -> tuple[str, ...]:
        """Where these robots listen: all endpoints of the file if one is unsure, since each robot has its own key."""
        asked = (*self.robots, *robots) if self.spare_endpoints else robots
        return tuple(dict.fromkeys(filter(None, (*(target.endpoint for target in asked), *self.spare_endpoints))))


def _unknown(option: str, names: Iterable[str], expected: Iterable[str]) -> list[BadInput]:
    choices = list(expected)
    wrong = (name for name in names if name not in choices)
    return [BadInput(option, "", f"expected {did_you_mean(choices, name)}; got {name!r}") for name in wrong]


def read_targets(file: Path) -> StopTargets:
    """All that can be read of a fleet's file; BadInput if nothing can."""
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
    """Names that count no more; none, and the fault, where the register cannot be read."""
    try:
        return tuple(revoked_in(folder)) if folder is not None else (), ()
    except BadInput as error:
        return (), (error,)


def _merged(fragments: Iterable[Table]) -> tuple[Table, list[tuple[str, Table]]]:
    """The tables as one, and those of robots by name; a name has several where their values differ."""
    table, robots = Table(), list[tuple[str, Table]]()
    for fragment in fragments:
        tables = table_in(fragment, "robots")
        for name in tables:
            found = next((other for other_name, other in reversed(robots) if other_name == name), None)
            values = {key: item for key, item in table_in(tables, name).items() if key in REACH}
            if found is None or any(found.get(key, item) != item for key, item in values.items()):
                robots.append((name, values))
            else:
                found.update(values)
        merge(table, fragment)
    return table, robots


def _targets(table: Table, robots: Iterable[tuple[str, Table]], folder: Path, protocol: str) -> tuple[StopTarget, ...]:
    targets, taken = list[StopTarget](), set[str]()
    for name, values in robots:
        if fault_of_name(name):  # no robot can have it, and no shell may get it
            continue
        listed = cast("list[object]", _value([values], "groups", list) or [])
        groups = tuple(group for group in listed if isinstance(group, str))
        of_groups = (table_in(table_in(table, "groups"), group) for group in groups)
        layers = [table_in(table, "defaults"), *of_groups, values]
        address = _value(layers, "address", str)
        reached = _value(layers, "network_address", str) or address
        endpoint = ""
        if reached:
            port = _value(layers, "network_port", int) or NETWORK_PORT
            endpoint = endpoint_at(protocol, reached, port)
            while endpoint in taken and "network_port" not in values:
                port += 1
                endpoint = endpoint_at(protocol, reached, port)
            taken.add(endpoint)
        targets.append(StopTarget(name, endpoint, _host(layers, address, folder), groups))
    return tuple(targets)


def _host(layers: Sequence[Table], address: str | None, folder: Path) -> Host | None:
    user, key = _value(layers, "user", str), _value(layers, "key", str)
    if not address or not user:
        return None
    key_file = str((folder / Path(key).expanduser()).resolve()) if key else ""
    return Host(user, address, _value(layers, "port", int) or SSH_PORT, key_file, python="")


def _spare(robots: Sequence[StopTarget]) -> tuple[str, ...]:
    """The next ports of each address, as many as there are robots without one, whose own ports these may be."""
    endpoints = [target.endpoint for target in robots if target.endpoint]
    spare = dict[str, None]()
    for endpoint in endpoints:
        start, _, port = endpoint.rpartition(":")
        spare |= dict.fromkeys(f"{start}:{int(port) + 1 + more}" for more in range(len(robots) - len(endpoints)))
    return tuple(endpoint for endpoint in spare if endpoint not in endpoints)


def _value(layers: Sequence[Table], key: str, kind: type[T]) -> T | None:
    """The last value of this type; None if there is none."""
    fitting = (table[key] for table in reversed(layers) if type(table.get(key)) is kind)
    return next(fitting, None)
