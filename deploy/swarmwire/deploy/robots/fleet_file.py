"""Reader of `fleet.toml`: every key is checked, and each robot gets the values of its layers."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar, cast

from msgspec import Meta, Struct

from swarmwire.comms.base.config import check_format, check_plain, converted, did_you_mean, folder_of, read_toml
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.wire.keys import fault_of_name
from swarmwire.deploy.robots.fleet import FORMAT, NETWORK_PORT, SSH_PORT, Fleet, FleetRobot, Host, Ports, endpoint_at
from swarmwire.deploy.robots.host_side.files import RESERVED_NAMES

Name = Annotated[str, Meta(min_length=1)]
Port = Annotated[int, Meta(ge=1, le=65535)]
TableType = TypeVar("TableType", bound=Struct)


class AgentTable(Struct, frozen=True):
    """Settings of the agent, as in robot.toml, which explains them."""

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


class GroupTable(AgentTable, frozen=True):
    """Keys of a group: the connection to its robots, and their settings."""

    user: Name = ""
    port: Port = SSH_PORT
    key: str = ""
    python: Name = "python3"
    network_address: str = ""
    network_port: Port = NETWORK_PORT
    packages: list[str] = []


class DefaultsTable(GroupTable, frozen=True):
    """Keys of the defaults."""

    groups: list[str] = []


class RobotTable(DefaultsTable, frozen=True):
    """Keys of one robot."""

    address: Name = ""


class FleetTable(Struct, frozen=True):
    """Keys of the file. Robots take values from their groups and the defaults, so no key of a robot is required."""

    format: int
    swarm: Name
    robots: Annotated[dict[str, Any], Meta(min_length=1)]
    known_hosts: str = "known_hosts"
    certificates: str | None = None
    insecure: bool = False
    operator: str = "operator"
    defaults: dict[str, Any] = {}
    groups: dict[str, Any] = {}


DEFAULTS = {key: getattr(RobotTable(), key) for key in ("port", "key", "python", "network_port", "packages")}


class Layer(NamedTuple):
    """One table of a robot's settings."""

    key: str  # path of the table in the file
    table: Mapping[str, Any]


def read_fleet(file: Path) -> Fleet:
    """Read a fleet's file; BadInput names the file and the first wrong key."""
    where, folder = str(file), folder_of(file)
    table = read_toml(file)
    check_format(table, FORMAT, where)
    fleet = _checked(FleetTable, table, where, "")
    for key, value in table.items():
        check_plain(value, where, key)
    name_fault = fault_of_name(fleet.swarm)
    if name_fault:
        raise BadInput(where, "swarm", name_fault)
    if fleet.insecure and fleet.certificates is not None:
        raise BadInput(where, "insecure", "expected either certificates or insecure = true")
    if not fleet.insecure and fleet.certificates is None:
        raise BadInput(where, "certificates", "expected the folder of `swarmwire certs`, or insecure = true")
    return Fleet(
        file=file,
        swarm=fleet.swarm,
        robots=_robots(fleet, where, folder),
        known_hosts=folder / fleet.known_hosts,
        certificates=None if fleet.certificates is None else folder / fleet.certificates,
        operator=fleet.operator,
    )


def _checked(kind: type[TableType], table: object, where: str, key: str) -> TableType:
    """Return a table as an instance of its class; BadInput names the first key that does not fit."""
    if not isinstance(table, Mapping):
        raise BadInput(where, key, f"expected a table, got {table!r}")
    for name in cast("Mapping[str, Any]", table):
        if name not in kind.__struct_fields__:
            choices = did_you_mean(kind.__struct_fields__, name)
            raise BadInput(where, f"{key}.{name}".lstrip("."), f"unknown key; expected {choices}")
    try:
        return converted(kind, cast("object", table), where)
    except BadInput as error:
        raise BadInput(where, f"{key}.{error.key}".lstrip("."), error.expected) from None


def _robots(fleet: FleetTable, where: str, folder: Path) -> tuple[FleetRobot, ...]:
    """Return the robots, each with the values of the defaults, its groups and its own table."""
    _checked(DefaultsTable, fleet.defaults, where, "defaults")
    for group, table in fleet.groups.items():
        _checked(GroupTable, table, where, f"groups.{group}")
    ports, hosts = Ports(where), dict[Host, Host]()
    robots: list[FleetRobot] = []
    for name, table in fleet.robots.items():
        key = f"robots.{name}"
        name_fault = fault_of_name(name)
        if name_fault is None and name in RESERVED_NAMES:
            name_fault = f"expected another name: on hosts ~/swarmwire/{name} is not a robot's"
        if name_fault:
            raise BadInput(where, key, name_fault)
        groups = _checked(RobotTable, table, where, key).groups
        for group in groups:
            if group not in fleet.groups:
                raise BadInput(where, f"{key}.groups", f"expected {did_you_mean(fleet.groups, group)}; got {group!r}")
        group_layers = (Layer(f"groups.{group}", fleet.groups[group]) for group in groups)
        layers = [Layer("defaults", fleet.defaults), *group_layers, Layer(key, table)]
        robot = _robot(name, layers, where, folder, ports, insecure=fleet.insecure)
        host = hosts.setdefault(robot.host, robot.host)
        if (host.python, host.key) != (robot.host.python, robot.host.key):
            raise BadInput(where, key, f"expected the python and the key that others at {host} have")
        robots.append(robot)
    return tuple(robots)


def _robot(name: str, layers: Sequence[Layer], where: str, folder: Path, ports: Ports, *, insecure: bool) -> FleetRobot:
    """Return a robot with the values of its layers: later ones replace earlier ones, and tables are merged."""
    values, key_paths = dict[str, Any](DEFAULTS), dict[str, str]()
    for layer in layers:
        for key, value in layer.table.items():
            is_merged = isinstance(value, dict) and isinstance(values.get(key), dict)
            values[key] = {**values[key], **cast("dict[str, Any]", value)} if is_merged else value
            key_paths[key] = f"{layer.key}.{key}"
    for key in ("address", "user", "agent", "driver"):
        if key not in values:
            raise BadInput(where, f"robots.{name}.{key}", "is missing, here and in defaults")
    key_file = str((folder / Path(values["key"]).expanduser()).resolve()) if values["key"] else ""
    host = Host(values["user"], values["address"], values["port"], key_file, values["python"])
    network_address = values.get("network_address", values["address"])
    port = ports.assign(name, network_address, values["network_port"], fixed="network_port" in layers[-1].table)
    return FleetRobot(
        name=name,
        host=host,
        endpoint=endpoint_at("tcp" if insecure else "tls", network_address, port),
        groups=tuple(values.get("groups", [])),
        packages=tuple(values["packages"]),
        settings={key: value for key, value in values.items() if key in AgentTable.__struct_fields__},
        key_paths=key_paths,
    )
