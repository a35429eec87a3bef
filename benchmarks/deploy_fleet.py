"""How long a deployment to twenty hosts takes: the first one, with all packages, and one of another release."""

import asyncio
import getpass
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import asyncssh

from benchmarks.lines import print_line, spread
from swarmwire.comms.base.clock import WallClock, to_s
from swarmwire.deploy.robots.deploy import deploy, release_contents
from swarmwire.deploy.robots.fleet import Fleet
from swarmwire.deploy.robots.fleet_file import read_fleet
from swarmwire.deploy.robots.host_side.messages import HostFacts
from swarmwire.deploy.robots.host_side.system import facts
from swarmwire.deploy.robots.packages import LockedEnvironments, RobotPlatform
from swarmwire.deploy.robots.result import SILENT
from tests.support.deploy.fleet.fleets import AGENT
from tests.support.deploy.fleet.hosts import SSHD, new_key, write_key

KINDS = ("asyncssh", "openssh") if SSHD else ("asyncssh",)  # the last is the one that robots are more like
FLEET = """format = 1
swarm = "lab"
insecure = true
[defaults]
user = "{user}"
key = "id"
agent = "still.py:Still"
"""


@dataclass
class Deployments:
    """Seconds of each deployment, by what it was."""

    first: list[float]
    release: list[float]
    again: list[float]


def deploy_fleet(name: str, repeats: int, *, hosts: int) -> None:
    """A line for each kind of server and deployment, with the packages of a robot for this machine's platform."""
    with tempfile.TemporaryDirectory() as cache:
        environments = LockedEnvironments(Path(cache))
        began_ns = WallClock().now_ns()
        archives = environments.archives(RobotPlatform.from_facts(facts_here()), ["epuck2"], [])
        made_s = to_s(WallClock().now_ns() - began_ns)
        config = {
            "hosts": hosts, "robots": hosts, "driver": "epuck2", "on": "loopback, all hosts on this machine",
            "cores": os.cpu_count(), "packages_mb": round(sum(archive.size for archive in archives) / 1e6, 1),
            "unpacked_mb": round(sum(archive.unpacked for archive in archives) / 1e6, 1),
            "python": sys.version.split()[0], "asyncssh": asyncssh.__version__,
        }  # fmt: skip
        print_line(f"{name}-packages", made_s, "s", {**config, "index": "pip's cache as it was"})
        for kind in KINDS:
            deployments = Deployments([], [], [])
            for _ in range(repeats):
                _measure(kind, hosts, environments, deployments)
            suffix = "" if kind == KINDS[-1] else f"-{kind}"
            for stage, values in (
                ("-first", deployments.first),
                ("", deployments.release),
                ("-again", deployments.again),
            ):
                details = {**config, "server": kind, **spread(values)}
                print_line(f"{name}{suffix}{stage}", statistics.median(values), "s", details)


def facts_here() -> HostFacts:
    """What this machine would say as a host."""
    with tempfile.TemporaryDirectory() as home:
        before = os.environ["HOME"]
        os.environ["HOME"] = home
        try:
            return facts()
        finally:
            os.environ["HOME"] = before


def _measure(kind: str, hosts: int, environments: LockedEnvironments, deployments: Deployments) -> None:
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        write_key(new_key(), folder / "id")
        with _served(kind, hosts, folder) as endpoints:
            (folder / "known_hosts").write_text("".join(f"[127.0.0.1]:{port} {line}" for port, line in endpoints))
            robots = "".join(
                f'[robots.flock-{index}]\naddress = "127.0.0.1"\nport = {port}\n'
                f'driver = {{ name = "epuck2", address = "192.168.1.{index + 1}" }}\n'
                for index, (port, _) in enumerate(endpoints)
            )
            (folder / "fleet.toml").write_text(FLEET.format(user=getpass.getuser()) + robots)
            for source, times in (
                (AGENT, deployments.first),
                (f"{AGENT}\n", deployments.release),
                (f"{AGENT}\n", deployments.again),
            ):
                (folder / "still.py").write_text(source)
                times.append(_deployed(read_fleet(folder / "fleet.toml"), environments))


def _deployed(fleet: Fleet, environments: LockedEnvironments) -> float:
    began_ns = WallClock().now_ns()
    contents = release_contents(fleet, fleet.robots)
    results = asyncio.run(deploy(fleet, fleet.robots, contents.entries, environments, SILENT))
    took_s = to_s(WallClock().now_ns() - began_ns)
    bad = [
        *map(str, contents.faults.values()),
        *(f"{result.robot}: {result.text}" for result in results if not result.ok),
    ]
    if bad:
        sys.exit("\n".join(bad))
    return took_s


@contextmanager
def _served(kind: str, hosts: int, folder: Path) -> Generator[list[tuple[int, str]]]:
    command = [sys.executable, "-m", "benchmarks.fleet_hosts", kind, str(hosts), str(folder)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdin
    assert process.stdout
    try:
        yield json.loads(process.stdout.readline())
    finally:
        process.stdin.close()
        process.wait()
        process.stdout.close()
