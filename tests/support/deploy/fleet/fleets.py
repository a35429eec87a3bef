"""Small fleets."""

from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any

import asyncssh
import pytest
import tomli_w

from swarmwire.comms.base.clock import WallClock
from swarmwire.deploy.robots import packages as packages_module
from swarmwire.deploy.robots.archives import Archive, ArchiveEntry, write_archive
from swarmwire.deploy.robots.certificates.folder import begin_authority, issue
from swarmwire.deploy.robots.certificates.register import certificate_request
from swarmwire.deploy.robots.packages import RobotPlatform
from tests.support.deploy.fleet.hosts import STAND_INS, FakeHost, HostServers, host_servers, new_key, write_key
from tests.support.deploy.runs import called

AGENT = """from swarmwire.agent import Agent, Robot

class Still(Agent):
    needs = ()

    def step(self, robot: Robot) -> None:
        robot.drive(0.0, 0.0)
"""
Robots = Callable[..., tuple[object, list[str]]]


@dataclass
class SmallPackages:
    """Packages of fake robots: a stand-in for the agent's program, and a file of some size."""

    folder: Path
    size: int = 100_000
    version: str = "1"
    requests: list[tuple[RobotPlatform, list[str], list[str]]] = field(default_factory=list)

    def archives(self, target: RobotPlatform, drivers: Iterable[str], packages: Iterable[str]) -> list[Archive]:
        self.requests.append((target, list(drivers), list(packages)))
        program = (STAND_INS / "robot_agent.py").read_bytes()
        swarmwire = [ArchiveEntry("swarmwire/agent/cli.py", program), ArchiveEntry("swarmwire/agent/__init__.py")]
        noise = b"".join(sha256(b"%d" % i).digest() for i in range(self.size // 32))  # nothing can pack it
        others = [ArchiveEntry("other/__init__.py", self.version.encode()), ArchiveEntry("other/large.bin", noise)]
        entries = {"own.tar.gz": swarmwire, "others.tar.gz": others}
        return [write_archive(files, self.folder / name) for name, files in entries.items()]


class SmallFleet:
    """A folder with `fleet.toml`, the agent, keys and known hosts, and the hosts themselves."""

    def __init__(self, folder: Path, servers: HostServers, client_key: asyncssh.SSHKey) -> None:
        self.folder, self.servers = folder, servers
        folder.mkdir()
        self.hosts: dict[str, FakeHost] = {}
        write_key(client_key, folder / "id")
        self.file = folder / "fleet.toml"
        self.agent(AGENT)
        driver = {"name": "epuck2", "address": "127.0.0.1:1"}
        defaults = {"user": "pi", "key": "id", "agent": "still.py:Still", "driver": driver}
        self.table: dict[str, Any] = {"format": 1, "swarm": "lab", "insecure": True, "defaults": defaults}
        self.table |= {"groups": {"red": {}}, "robots": {}}

    def agent(self, source: str) -> None:
        """Write the agent's source."""
        (self.folder / "still.py").write_text(source)

    def add(self, robot: str, host: FakeHost | None = None, **values: Any) -> FakeHost:
        """One more robot, on a host of its own or one that has others; its key is known."""
        if host:
            values.setdefault("driver", {"address": f"127.0.0.1:{1 + len(self.hosts)}"})
        host = host or self.servers.add(self.folder.parent / f"home-{robot}")
        self.hosts[robot] = host
        self.table["robots"][robot] = {"address": "127.0.0.1", "port": host.port, **values}
        self.write()
        self.know(*self.hosts.values())
        return host

    def change(self, robot: str, **values: Any) -> None:
        """Change values of a robot."""
        self.table["robots"][robot] |= values
        self.write()

    def write(self) -> None:
        """Write the table to its file."""
        self.file.write_text(tomli_w.dumps(self.table))

    def know(self, *hosts: FakeHost) -> None:
        """Write the known hosts: these."""
        keys = [f"[127.0.0.1]:{host.port} {host.host_key.export_public_key().decode()}" for host in hosts]
        (self.folder / "known_hosts").write_text("".join(keys))


@pytest.fixture(scope="session")
def client_key() -> asyncssh.SSHKey:
    return new_key()


@pytest.fixture
def servers(client_key) -> Generator[HostServers]:
    with host_servers(client_key) as servers:
        yield servers


@pytest.fixture
def fleet(tmp_path, servers, client_key) -> SmallFleet:
    return SmallFleet(tmp_path / "lab", servers, client_key)


@pytest.fixture
def packages(tmp_path, monkeypatch) -> SmallPackages:
    """Small packages for robots, instead of wheels from an index."""
    small = SmallPackages(tmp_path)
    monkeypatch.setattr(packages_module, "LockedEnvironments", lambda **_: small)
    return small


@pytest.fixture
def robots(monkeypatch, capsys, fleet, packages) -> Robots:
    """Calls `swarmwire robots VERB fleet.toml …`: exit code and the lines that it prints."""

    monkeypatch.setenv("COLUMNS", "250")

    def call(verb: str, *options: object) -> tuple[object, list[str]]:
        code, out, errors = called(monkeypatch, capsys, "robots", verb, fleet.file, *options)
        return code, [" ".join(line.split()) for line in (out + errors).splitlines()]

    return call


@pytest.fixture
def lab_certificates(fleet) -> Callable[..., None]:
    """Create a CA for the fleet, and certificates of these names for this machine."""

    def issue_names(*names: str) -> None:
        folder = fleet.folder / "certs"
        begin_authority(folder, WallClock())
        list(issue(folder, [certificate_request(name, ["127.0.0.1"], None) for name in names], 30, WallClock()))
        del fleet.table["insecure"]
        fleet.table["certificates"] = "certs"
        fleet.write()

    return issue_names
