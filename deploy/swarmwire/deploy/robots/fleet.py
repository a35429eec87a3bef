"""A fleet: its robots, and the host and network address of each. Light to import: an emergency stop waits for it."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.wire.access_control import TRACKER
from swarmwire.deploy.robots.certificates.register import (
    CertificateRequest,
    Issued,
    Register,
    certificate_request,
    revoked_in,
)

FORMAT = 1  # version of `fleet.toml`
NETWORK_PORT = 7557  # not 7447, which a zenoh router or a bridge of ROS 2 has on the same machine
SSH_PORT = 22


@dataclass(frozen=True)
class Host:
    """An account on a machine, reached by SSH; several robots may share one."""

    user: str
    address: str
    port: int
    key: str = field(compare=False)  # file of the private key; "": keys of the user's agent and of ~/.ssh
    python: str = field(compare=False)  # command that starts Python on the host

    def __str__(self) -> str:
        """Return the host as the SSH client writes it."""
        return f"{self.user}@{self.address}" + (f":{self.port}" if self.port != SSH_PORT else "")


@dataclass(frozen=True)
class FleetRobot:
    """One robot of a fleet; `settings` are the keys of `robot.toml` that do not concern the swarm."""

    name: str
    host: Host
    endpoint: str  # endpoint in the robots' network, to which others connect: tls/192.168.1.31:7447
    groups: tuple[str, ...]
    packages: tuple[str, ...]  # packages beyond those of agent and driver, at the versions of this machine
    settings: dict[str, Any]
    key_paths: dict[str, str]  # path in the file of each setting: rate_hz -> defaults.rate_hz

    @property
    def network_host(self) -> str:
        """Address in `endpoint`, which its certificate must have."""
        return self.endpoint.partition("/")[2].rpartition(":")[0].strip("[]")


@dataclass(frozen=True)
class Fleet:
    """All robots of a swarm, in the order of their index."""

    file: Path
    swarm: str
    robots: tuple[FleetRobot, ...]
    known_hosts: Path
    certificates: Path | None  # None: an insecure network
    operator: str  # name of the certificate that stops robots

    def revoked(self) -> list[str]:
        """Return the revoked names; BadInput if the register of certificates cannot be read."""
        return revoked_in(self.certificates) if self.certificates is not None else []

    def lacking_certificates(self, register: Register, now: datetime) -> list[CertificateRequest]:
        """Return requests for the certificates of robots, tracker and operator that are missing or end soon.

        A robot's certificate must have the address to which others connect. BadInput for a revoked name.
        """
        members = [certificate_request(robot.name, [robot.network_host]) for robot in self.robots]
        members += [CertificateRequest(TRACKER, TRACKER), CertificateRequest(self.operator, "operator")]
        return [request for request in members if self._lacks(request, register.last(request.name), now)]

    def _lacks(self, request: CertificateRequest, last: Issued | None, now: datetime) -> bool:
        if last is None:
            return True
        if last.revoked is not None:
            raise BadInput(str(self.file), request.name, "is revoked for good: expected another name for this robot")
        return last.ends_soon(now) or not set(request.hosts) <= set(last.hosts)

    def select(self, robots: Iterable[str] = (), groups: Iterable[str] = ()) -> tuple[FleetRobot, ...]:
        """Return the robots of these names and groups, all without either; BadInput for an unknown name."""
        names, group_names = list(robots), list(groups)
        _check_names("--robots", names, [robot.name for robot in self.robots])
        _check_names("--group", group_names, {group: 0 for robot in self.robots for group in robot.groups})
        if not names and not group_names:
            return self.robots
        return tuple(robot for robot in self.robots if robot.name in names or set(robot.groups) & set(group_names))


def hosts_of(robots: Iterable[FleetRobot]) -> dict[Host, list[FleetRobot]]:
    """Return the robots of each host."""
    hosts: dict[Host, list[FleetRobot]] = {}
    for robot in robots:
        hosts.setdefault(robot.host, []).append(robot)
    return hosts


def names_in(texts: Iterable[str]) -> list[str]:
    """Return the names in texts of the command line, such as "a,b"."""
    return [name.strip() for text in texts for name in text.split(",") if name.strip()]


def _check_names(option: str, names: Iterable[str], valid: Iterable[str]) -> None:
    choices = list(valid)
    for name in names:
        if name not in choices:
            raise BadInput(option, "", f"expected {did_you_mean(choices, name)}; got {name!r}")


def endpoint_at(protocol: str, address: str, port: int) -> str:
    """Return an endpoint of the robots' network.

    >>> endpoint_at("tls", "10.0.0.31", 7557), endpoint_at("tcp", "fe80::1", 7557)
    ('tls/10.0.0.31:7557', 'tcp/[fe80::1]:7557')
    """
    return f"{protocol}/{f'[{address}]' if ':' in address else address}:{port}"


class Ports:
    """Ports of the robots' network: robots that share an address get one after the other."""

    def __init__(self, where: str) -> None:
        self._where = where
        self._owners: dict[tuple[str, int], str] = {}

    def assign(self, robot: str, address: str, port: int, *, fixed: bool) -> int:
        """Assign the robot this port, or, unless it is `fixed`, the next free one; return it."""
        while not fixed and (address, port) in self._owners:
            port += 1
        owner = self._owners.setdefault((address, port), robot)
        if owner != robot:
            key = f"robots.{robot}.network_port"
            raise BadInput(self._where, key, f"expected a port that {owner}, at the same address, has not: {port}")
        return port
