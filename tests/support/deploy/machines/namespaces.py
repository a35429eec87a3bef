"""Machines that are network namespaces of this one, in a line: each sees its neighbours and nobody else."""

import os
import subprocess
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from itertools import count, pairwise

import pytest

_NUMBERS = count()


class Machine:
    """One of them: programs that are started in it see its addresses alone."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.addresses = list[str]()
        self.devices = list[str]()  # of its links, with these addresses

    def command(self, *words: object) -> list[str]:
        """What to start instead of these words, for them to run on this machine."""
        return ["ip", "netns", "exec", self.name, *map(str, words)]

    def link(self, state: str) -> None:
        """Take its first link "down", or "up" again: nothing of the other end is told."""
        subprocess.run(["ip", "-n", self.name, "link", "set", self.devices[0], state], check=True)


@contextmanager
def machines(several: int) -> Generator[list[Machine]]:
    """So many machines in a line, gone afterwards; the test is skipped where that is not permitted.

    The link between machine i and i + 1 has the addresses 10.77.i.1 and 10.77.i.2, and none passes anything on.
    """
    prefix = f"sw{os.getpid() % 100_000}-{next(_NUMBERS)}-"
    made = [Machine(f"{prefix}{i}") for i in range(several)]
    with ExitStack() as stack:
        for machine in made:
            _permitted("ip", "netns", "add", machine.name)
            stack.callback(_ip, "netns", "del", machine.name)
            _permitted("ip", "-n", machine.name, "link", "set", "lo", "up")
        for i, (left, right) in enumerate(pairwise(made)):
            one, other = f"v{prefix[2:]}{i}a"[-15:], f"v{prefix[2:]}{i}b"[-15:]
            ends = [(left, one), (right, other)]
            _permitted(
                *("ip", "link", "add", one, "netns", left.name),
                *("type", "veth", "peer", "name", other, "netns", right.name),
            )
            for place, (machine, device) in enumerate(ends, 1):
                machine.addresses.append(f"10.77.{i}.{place}")
                machine.devices.append(device)
                _permitted("ip", "-n", machine.name, "address", "add", f"{machine.addresses[-1]}/24", "dev", device)
                _permitted("ip", "-n", machine.name, "link", "set", device, "up")
        yield made


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], capture_output=True, check=False)


def _permitted(*command: str) -> None:
    """Run it; the test is skipped if it cannot be run here."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError as error:
        pytest.skip(f"network namespaces: {error}")
    if done.returncode:
        pytest.skip(f"network namespaces: {' '.join(command[:4])}: {done.stderr.strip()}")
