"""What an emergency stop needs of `fleet.toml`: names, endpoints and hosts, as far as they can be read.

No fault of the file holds up a stop: a value that does not fit counts as missing, and a line that is no TOML is left
out. `fleet_file.read_fleet` names the faults afterwards. Light to import: a stop waits for it.
"""

import re
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, cast

from swarmwire.comms.config import did_you_mean, from_toml
from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.access_control import OPERATOR
from swarmwire.comms.wire.keys import fault_of_name
from swarmwire.deploy.certificates.register import revoked_in
from swarmwire.deploy.fleet.fleet import NETWORK_PORT, SSH_PORT, Host, endpoint_at

MAX_LINES = 50  # of one value; a line that does not end within so many is left out
# The beginning of the line above a robot's table, which may be cut off; not that of a table within it.
HEADER = re.compile(r"""\s*\[\s*robots\s*\.\s*["']?([\w-]+)(?![\w-])(?!["']?\s*\.)""", re.ASCII)
REACH = ("address", "user", "port", "key", "network_address", "network_port", "groups")  # all that a stop needs
Table = dict[str, Any]
T = TypeVar("T")


@dataclass(frozen=True)
class Target:
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
    robots: tuple[Target, ...]
    known_hosts: Path
    certificates: Path | None
    insecure: bool
    operator: str
    revoked: tuple[str, ...]
    spare_endpoints: tuple[str, ...]
    faults: tuple[BadInput, ...]

    def chosen(self, names: Sequence[str], groups: Sequence[str]) -> tuple[tuple[Target, ...], list[BadInput]]:
        """The robots of these names and groups, all without either, and a fault for each name that is unknown."""
        if not names and not groups:
            return self.robots, []
        unknown = _unknown("--robots", names, [target.robot for target in self.robots])
        unknown += _unknown("--group", groups, {group: 0 for target in self.robots for group in target.groups})
        chosen = (target for target in self.robots if target.robot in names or set(target.groups) & set(groups))
        return tuple(chosen), unknown

    def endpoints(self, robots: Iterable[Target]) -> tuple[str, ...]:
        """Where these robots listen: all endpoints of the file if one is unsure, since each robot has its own key."""
        asked = (*self.robots, *robots) if self.spare_endpoints else robots
        return tuple(dict.fromkeys(filter(None, (*(target.endpoint for target in asked), *self.spare_endpoints))))


def _unknown(option: str, names: Iterable[str], expected: Iterable[str]) -> list[BadInput]:
    choices = list(expected)
    wrong = (name for name in names if name not in choices)
    return [BadInput(option, "", f"expected {did_you_mean(choices, name)}; got {name!r}") for name in wrong]


def read_targets(file: Path) -> StopTargets:
    """All that can be read of a fleet's file; BadInput if nothing can."""
    try:
        text = file.read_bytes().decode("utf-8-sig", errors="replace")
    except OSError as error:
        raise BadInput(str(file), "", f"expected a readable file: {error.strerror}") from None
    table, robot_tables = _merged(_fragments(text))
    certificates, insecure = _value([table], "certificates", str), table.get("insecure") is True
    folder = None if certificates is None else file.parent / certificates
    revoked, faults = _revoked(folder)
    protocol = "tls" if folder is not None else "tcp"
    robots = _targets(table, robot_tables, file.parent, protocol)
    return StopTargets(
        file=file,
        swarm=_value([table], "swarm", str) or "",
        robots=robots,
        known_hosts=file.parent / (_value([table], "known_hosts", str) or "known_hosts"),
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


def _fragments(text: str) -> Iterator[Table]:
    """The tables of a TOML text; where it is none, one for each line, or lines of one value, that can be read."""
    try:
        yield from_toml(text)
        return
    except tomllib.TOMLDecodeError:
        pass
    lines = text.splitlines()
    header: str | None = ""
    while lines:
        size, fragment = _first_value(lines)
        if lines[0].lstrip().startswith("["):
            # The lines below belong to it, whatever is wrong with it; below an unknown one they belong to nobody.
            half = HEADER.match(lines[0])
            header = lines[0] if fragment is not None else f"[robots.{half[1]}]" if half else None
            if header is not None:
                yield from_toml(header)
        elif fragment is not None and header is not None:
            yield from_toml("\n".join([header, *lines[:size]]))
        del lines[:size]


def _first_value(lines: Sequence[str]) -> tuple[int, Table | None]:
    """How many lines the first value has, and its table; None for a line that is no TOML."""
    for size in range(1, min(len(lines), MAX_LINES) + 1):
        try:
            return size, from_toml("\n".join(lines[:size]))
        except tomllib.TOMLDecodeError:
            continue
    return 1, None


def _merged(fragments: Iterable[Table]) -> tuple[Table, list[tuple[str, Table]]]:
    """The tables as one, without `robots`, and these by name; a name has several where their values differ."""
    table, robots = Table(), list[tuple[str, Table]]()
    for fragment in fragments:
        for name, value in _table(fragment.pop("robots", None)).items():
            found = next((other for other_name, other in reversed(robots) if other_name == name), None)
            values = {key: item for key, item in _table(value).items() if key in REACH}
            if found is None or any(found.get(key, item) != item for key, item in values.items()):
                robots.append((name, values))
            else:
                found.update(values)
        _merge(table, fragment)
    return table, robots


def _merge(table: Table, more: Table) -> None:
    """Add the keys of `more`, and those of its tables."""
    for key, value in more.items():
        if isinstance(value, dict) and isinstance(table.setdefault(key, {}), dict):
            _merge(table[key], cast("Table", value))
        else:
            table.setdefault(key, value)


def _targets(table: Table, robots: Iterable[tuple[str, Table]], folder: Path, protocol: str) -> tuple[Target, ...]:
    targets, taken = list[Target](), set[str]()
    for name, values in robots:
        if fault_of_name(name):  # no robot can have it, and no shell may get it
            continue
        listed = cast("list[object]", _value([values], "groups", list) or [])
        groups = tuple(group for group in listed if isinstance(group, str))
        of_groups = (_table(_table(table.get("groups")).get(group)) for group in groups)
        layers = [_table(table.get("defaults")), *of_groups, values]
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
        targets.append(Target(name, endpoint, _host(layers, address, folder), groups))
    return tuple(targets)


def _host(layers: Sequence[Table], address: str | None, folder: Path) -> Host | None:
    user, key = _value(layers, "user", str), _value(layers, "key", str)
    if not address or not user:
        return None
    key_file = str((folder / Path(key).expanduser()).resolve()) if key else ""
    return Host(user, address, _value(layers, "port", int) or SSH_PORT, key_file, python="")


def _spare(robots: Sequence[Target]) -> tuple[str, ...]:
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


def _table(value: object) -> Table:
    """The value if it is a table; else an empty one."""
    return cast("Table", value) if isinstance(value, dict) else {}
