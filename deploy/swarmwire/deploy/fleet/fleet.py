"""A fleet: robots, where each is reached, and what runs on it; `fleet.toml`, read and checked key by key."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import Annotated, Any, cast

from pydantic import BaseModel, Field, ValidationError

from swarmwire.comms.config import check_format, did_you_mean, read_toml
from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.access_control import TRACKER
from swarmwire.comms.wire.keys import fault_of_name
from swarmwire.deploy.certificates.register import CertificateRequest, Issued, Register, certificate_request, revoked_in
from swarmwire.deploy.fleet.host_side.files import TAKEN
from swarmwire.world.scenario.schema import TABLE
from swarmwire.world.validation import fault


@dataclass(frozen=True)
class Host:
    """An account on a machine that is reached by SSH; several robots may share one."""

    user: str
    address: str
    port: int
    key: str = field(compare=False)  # file of the private key; "": those of the user's agent and of ~/.ssh
    python: str = field(compare=False)  # as it is called there

    def __str__(self) -> str:
        """As people write it."""
        return f"{self.user}@{self.address}" + (f":{self.port}" if self.port != 22 else "")


@dataclass(frozen=True)
class Robot:
    """One robot of a fleet: its settings are those of `robot.toml`, but for what concerns the whole swarm."""

    name: str
    host: Host
    endpoint: str  # of the robots' network, as others call it: tls/192.168.1.31:7447
    groups: tuple[str, ...]
    packages: tuple[str, ...]  # beyond what agent and driver need, as they are installed here
    settings: dict[str, Any]
    places: dict[str, str]  # where each setting is said: rate_hz -> defaults.rate_hz

    @property
    def network_host(self) -> str:
        """Where others call it: the address in `endpoint`, which its certificate must have."""
        return self.endpoint.partition("/")[2].rpartition(":")[0].strip("[]")


@dataclass(frozen=True)
class Fleet:
    """All robots of a swarm, in the order of their index."""

    file: Path
    swarm: str
    robots: tuple[Robot, ...]
    known_hosts: Path
    certificates: Path | None  # None: an insecure network
    operator: str  # name of the certificate with which robots are stopped

    def revoked(self) -> list[str]:
        """Names whose certificates count no more; BadInput if the register of certificates cannot be read."""
        return revoked_in(self.certificates) if self.certificates is not None else []

    def lacking_certificates(self, register: Register, now: datetime) -> list[CertificateRequest]:
        """Requests for the certificates of robots, tracker and operator that are missing or end soon.

        A robot's certificate must have the address where others call it. BadInput for a revoked name.
        """
        members = [certificate_request(robot.name, [robot.network_host]) for robot in self.robots]
        members += [CertificateRequest(TRACKER, TRACKER), CertificateRequest(self.operator, "operator")]
        return [of for of in members if self._lacks(of, register.last(of.name), now)]

    def _lacks(self, of: CertificateRequest, last: Issued | None, now: datetime) -> bool:
        if last is None:
            return True
        if last.revoked is not None:
            raise BadInput(str(self.file), of.name, "is revoked for good: expected another name for this robot")
        return last.ends_soon(now) or not set(of.hosts) <= set(last.hosts)

    def chosen(self, robots: Iterable[str] = (), groups: Iterable[str] = ()) -> tuple[Robot, ...]:
        """The robots of these names and groups, all if none is given; BadInput for a name that there is not."""
        names, chosen_groups = list(robots), list(groups)
        _known("--robots", names, [robot.name for robot in self.robots])
        _known("--group", chosen_groups, {group: 0 for robot in self.robots for group in robot.groups})
        if not names and not chosen_groups:
            return self.robots
        return tuple(of for of in self.robots if of.name in names or set(of.groups) & set(chosen_groups))


def hosts_of(robots: Iterable[Robot]) -> dict[Host, list[Robot]]:
    """The robots by their hosts."""
    hosts: dict[Host, list[Robot]] = {}
    for robot in robots:
        hosts.setdefault(robot.host, []).append(robot)
    return hosts


def _known(option: str, given: Iterable[str], known: Iterable[str]) -> None:
    names = list(known)
    for name in given:
        if name not in names:
            raise BadInput(option, "", f"expected {did_you_mean(names, name)}; got {name!r}")


FORMAT = 1
NETWORK_PORT = 7557  # not 7447, which a zenoh router or a bridge of ROS 2 has on the same machine

Name = Annotated[str, Field(min_length=1)]
Port = Annotated[int, Field(ge=1, le=65535)]


class AgentTable(BaseModel):
    """Settings of the agent, as in robot.toml, which explains them."""

    model_config = TABLE
    agent: Name = ""
    params: dict[str, Any] = {}
    body: str = ""
    rate_hz: int = 0
    watchdog_s: float = 0.0
    max_linear_mps: float = 0.0
    max_angular_radps: float = 0.0
    driver: dict[str, Any] = {}
    radio: dict[str, Any] = {}
    tracker: bool = False
    seed: int = 0


class GroupTable(AgentTable):
    """The keys of a group: the way to its robots, and their settings."""

    user: Name = ""
    port: Port = 22
    key: str = ""
    python: Name = "python3"
    network_address: str = ""
    network_port: Port = NETWORK_PORT
    packages: list[str] = []


class DefaultsTable(GroupTable):
    """The keys of the defaults."""

    groups: list[str] = []


class RobotTable(DefaultsTable):
    """The keys of one robot."""

    address: Name = ""


DEFAULTS = {key: RobotTable.model_fields[key].default for key in ("port", "key", "python", "network_port", "packages")}


class FleetTable(BaseModel):
    """The keys of the file. Robots take values from their groups and the defaults, so no robot needs a key."""

    model_config = TABLE
    format: int
    swarm: Name
    robots: Annotated[dict[str, RobotTable], Field(min_length=1)]
    known_hosts: str = "known_hosts"
    certificates: str | None = None
    insecure: bool = False
    operator: str = "operator"
    defaults: DefaultsTable = DefaultsTable()
    groups: dict[str, GroupTable] = {}


def read_fleet(file: Path) -> Fleet:
    """The fleet of a file; BadInput names the file and the first key that is wrong."""
    where = str(file)
    table = read_toml(file)
    check_format(table, FORMAT, where)
    try:
        checked = FleetTable.model_validate(table)
    except ValidationError as error:
        raise fault(error, _schema(), where) from None
    name_fault = fault_of_name(checked.swarm)
    if name_fault:
        raise BadInput(where, "swarm", name_fault)
    if checked.insecure and checked.certificates is not None:
        raise BadInput(where, "insecure", "expected either certificates or insecure = true")
    if not checked.insecure and checked.certificates is None:
        raise BadInput(where, "certificates", "expected the folder of `swarmwire certs`, or insecure = true")
    return Fleet(
        file=file,
        swarm=checked.swarm,
        robots=_robots(table, where, file.parent, "tcp" if checked.insecure else "tls"),
        known_hosts=file.parent / checked.known_hosts,
        certificates=None if checked.certificates is None else file.parent / checked.certificates,
        operator=checked.operator,
    )


@cache
def _schema() -> dict[str, Any]:
    return FleetTable.model_json_schema()


def _robots(table: Mapping[str, Any], where: str, folder: Path, protocol: str) -> tuple[Robot, ...]:
    """The robots of a checked table, each of what the defaults, its groups and its own table have."""
    defaults, groups = ("defaults", table.get("defaults", {})), table.get("groups", {})
    ports, hosts = _Ports(where), dict[Host, Host]()
    robots: list[Robot] = []
    for name, own in table["robots"].items():
        key = f"robots.{name}"
        name_fault = fault_of_name(name)
        if name_fault is None and name in TAKEN:
            name_fault = f"expected another name: on hosts ~/swarmwire/{name} is not a robot's"
        if name_fault:
            raise BadInput(where, key, name_fault)
        for group in own.get("groups", []):
            if group not in groups:
                raise BadInput(where, f"{key}.groups", f"expected {did_you_mean(groups, group)}; got {group!r}")
        layers = [defaults, *((f"groups.{of}", groups[of]) for of in own.get("groups", [])), (key, own)]
        robot = _robot(name, layers, where, folder, protocol, ports)
        host = hosts.setdefault(robot.host, robot.host)
        if (host.python, host.key) != (robot.host.python, robot.host.key):
            raise BadInput(where, key, f"expected the python and the key that others at {host} have")
        robots.append(robot)
    return tuple(robots)


def _robot(
    name: str, layers: list[tuple[str, dict[str, Any]]], where: str, folder: Path, protocol: str, ports: "_Ports"
) -> Robot:
    """A robot of its layers: later ones replace earlier ones, and tables are merged."""
    whole, places = dict[str, Any](DEFAULTS), dict[str, str]()
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
        settings={key: value for key, value in whole.items() if key in AgentTable.model_fields},
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
