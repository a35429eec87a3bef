"""Network namespaces that exist before a run: a named one, one of a process; and a stand-in of docker."""

import os
import subprocess
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

import pytest

from tests.support.clocks import until

DEVICE, ADDRESS = "own0", "192.0.2.1/24"  # what a namespace has before a run
STATE = ("address", "show"), ("route", "show", "table", "all"), ("-6", "route", "show", "table", "all")
ENGINE = """#!/bin/sh
for name; do :; done
case $name in
{cases}
*) echo "Error: No such container: $name" >&2; exit 1;;
esac
"""


class ExistingNamespace:
    """A network namespace with a device, an address and routes of its own.

    Attributes:
        command: the words that run a command in it.
        pid: a process in it; 0: none.
    """

    def __init__(self, *command: str, pid: int = 0) -> None:
        self.command, self.pid = command, pid
        self.ip("tuntap", "add", DEVICE, "mode", "tap")
        self.ip("address", "add", ADDRESS, "dev", DEVICE)
        self.ip("link", "set", DEVICE, "up")

    def on(self, *command: str) -> subprocess.CompletedProcess[str]:
        """A command that has ended in it."""
        return subprocess.run([*self.command, *command], capture_output=True, text=True, timeout=60, check=False)

    def ip(self, *words: str) -> str:
        """The output of `ip` in it."""
        done = self.on("ip", *words)
        assert done.returncode == 0, done.stderr
        return done.stdout

    def state(self) -> list[str]:
        """Its devices, addresses and routes."""
        return [self.ip(*words) for words in STATE]


@contextmanager
def named_namespace() -> Generator[tuple[str, ExistingNamespace]]:
    """A namespace of `ip netns`, with its name; skips the test where it cannot be made."""
    name = f"swarm-{uuid4().hex[:8]}"
    _skip_unless("ip", "netns", "add", name)
    try:
        yield name, ExistingNamespace("ip", "netns", "exec", name)
    finally:
        subprocess.run(["ip", "netns", "del", name], check=True)


@contextmanager
def process_namespace() -> Generator[ExistingNamespace]:
    """The namespace of a process; skips the test where it cannot be made."""
    _skip_unless("unshare", "--net", "true")
    process = subprocess.Popen(["unshare", "--net", "sleep", "1000"])
    try:
        own, its = Path("/proc/self/ns/net"), Path(f"/proc/{process.pid}/ns/net")
        until(lambda: its.readlink() != own.readlink())
        yield ExistingNamespace("nsenter", "--net", f"--target={process.pid}", "--", pid=process.pid)
    finally:
        process.kill()
        process.wait()


def _skip_unless(*command: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(done.stderr.strip().replace("\n", " "))


def container_engine(folder: Path, pids: Mapping[str, int], engine: str = "docker") -> str:
    """Make a stand-in of docker or podman that knows these containers; the PATH on which it is the only one."""
    folder.mkdir()
    for word in ("docker", "podman"):
        _program(folder / word, {} if word != engine else pids)
    return f"{folder}{os.pathsep}{os.environ['PATH']}"


def _program(path: Path, pids: Mapping[str, int]) -> None:
    cases = "\n".join(f"{name}) echo {pid};;" for name, pid in pids.items())
    path.write_text(ENGINE.format(cases=cases))
    path.chmod(0o755)
