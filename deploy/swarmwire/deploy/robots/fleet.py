"""A fleet: robots, and where each is reached. Light to import: an emergency stop waits for it."""

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

FORMAT = 1  # of `fleet.toml`
NETWORK_PORT = 7557  # not 7447, which a zenoh router or a bridge of ROS 2 has on the same machine
SSH_PORT = 22


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
        return f"{self.user}@{self.address}" + (f":{self.port}" if self.port != SSH_PORT else "")


@dataclass(frozen=True)
class FleetRobot:
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
    robots: tuple[FleetRobot, ...]
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

    def chosen(self, robots: Iterable[str] = (), groups: Iterable[str] = ()) -> tuple[FleetRobot, ...]:
        """The robots of these names and groups, all if none is given; BadInput for a name that there is not."""
        names, chosen_groups = list(robots), list(groups)
        _known("--robots", names, [robot.name for robot in self.robots])
        _known("--group", chosen_groups, {group: 0 for robot in self.robots for group in robot.groups})
        if not names and not chosen_groups:
            return self.robots
        return tuple(of for of in self.robots if of.name in names or set(of.groups) & set(chosen_groups))


def hosts_of(robots: Iterable[FleetRobot]) -> dict[Host, list[FleetRobot]]:
    """The robots by their hosts."""
    hosts: dict[Host, list[FleetRobot]] = {}
    for robot in robots:
        hosts.setdefault(robot.host, []).append(robot)
    return hosts


def names_in(texts: Iterable[str]) -> list[str]:
    """The names in texts of the command line, such as "a,b"."""
    return [name.strip() for text in texts for name in text.split(",") if name.strip()]


def _known(option: str, given: Iterable[str], known: Iterable[str]) -> None:
    names = list(known)
    for name in given:
        if name not in names:
            raise BadInput(option, "", f"expected {did_you_mean(names, name)}; got {name!r}")


def endpoint_at(protocol: str, address: str, port: int) -> str:
    """The endpoint of a robot's network.

    >>> endpoint_at("tls", "10.0.0.31", 7557), endpoint_at("tcp", "fe80::1", 7557)
    ('tls/10.0.0.31:7557', 'tcp/[fe80::1]:7557')
    """
    return f"{protocol}/{f'[{address}]' if ':' in address else address}:{port}"


class Ports:
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
