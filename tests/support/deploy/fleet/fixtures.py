"""Fake robots for the commands of a fleet."""

from collections.abc import Callable, Generator

import asyncssh
import pytest

from swarmwire.comms.clock import WallClock
from swarmwire.deploy.certificates.folder import begin_authority, issue
from swarmwire.deploy.certificates.register import certificate_request
from swarmwire.deploy.fleet import packages as packages_module
from tests.support.deploy.commands import called
from tests.support.deploy.fleet.fake_host import HostServers, host_servers, new_key
from tests.support.deploy.fleet.small_fleet import SmallFleet, SmallPackages

Robots = Callable[..., tuple[object, list[str]]]


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
    """What robots get in the place of wheels from an index."""
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
    """Measures the fleet a CA, and certificates of these names for this machine."""

    def made(*names: str) -> None:
        folder = fleet.folder / "certs"
        begin_authority(folder, WallClock())
        list(issue(folder, [certificate_request(name, ["127.0.0.1"], None) for name in names], 30, WallClock()))
        del fleet.table["insecure"]
        fleet.table["certificates"] = "certs"
        fleet.write()

    return made
