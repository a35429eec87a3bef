"""`fleet.toml`, read and checked key by key."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any, cast

from pydantic import BaseModel, Field, ValidationError

from swarmwire.comms.base.config import check_format, did_you_mean, folder_of, read_toml
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.wire.keys import fault_of_name
from swarmwire.deploy.robots.fleet import FORMAT, NETWORK_PORT, SSH_PORT, Fleet, FleetRobot, Host, Ports, endpoint_at
from swarmwire.deploy.robots.host_side.files import TAKEN
from swarmwire.world.scenario.faults import fault
from swarmwire.world.scenario.schema import TABLE

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
    port: Port = SSH_PORT
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
        robots=_robots(table, where, folder_of(file), "tcp" if checked.insecure else "tls"),
        known_hosts=folder_of(file) / checked.known_hosts,
        certificates=None if checked.certificates is None else folder_of(file) / checked.certificates,
        operator=checked.operator,
    )


@cache
def _schema() -> dict[str, Any]:
    return FleetTable.model_json_schema()


def _robots(table: Mapping[str, Any], where: str, folder: Path, protocol: str) -> tuple[FleetRobot, ...]:
    """The robots of a checked table, each of what the defaults, its groups and its own table have."""
    defaults, groups = ("defaults", table.get("defaults", {})), table.get("groups", {})
    ports, hosts = Ports(where), dict[Host, Host]()
    robots: list[FleetRobot] = []
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
    name: str, layers: list[tuple[str, dict[str, Any]]], where: str, folder: Path, protocol: str, ports: Ports
) -> FleetRobot:
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
    return FleetRobot(
        name=name,
        host=host,
        endpoint=endpoint_at(protocol, reached, port),
        groups=tuple(whole.get("groups", [])),
        packages=tuple(whole["packages"]),
        settings={key: value for key, value in whole.items() if key in AgentTable.model_fields},
        places=places,
    )
