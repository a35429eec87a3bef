"""A process that looks on at a run."""

import subprocess
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from swarmwire.comms.interfaces import Observer

WATCHER = """
import sys
from pathlib import Path
from swarmwire.comms.clock import WallClock
from swarmwire.deploy.live.following import following
from swarmwire.deploy.live.following import read_live

clock, seen = WallClock(), 0
with following(read_live(Path(sys.argv[1]))) as run:
    print("looking", flush=True)
    while not run.over:
        if run.next() is None:
            clock.sleep_until(clock.now_ns() + 1_000_000)
        else:
            seen += 1
print(seen, run.lost, run.bad)
"""


@contextmanager
def watcher(folder: Path) -> Generator[subprocess.Popen[str]]:
    """A process that looks on at the run in this folder, and prints what it saw when that is over."""
    with subprocess.Popen([sys.executable, "-c", WATCHER, str(folder)], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "looking\n"
            yield process
        finally:
            process.kill()


class At(Observer):
    """Observer that does something at a tick."""

    def __init__(self, tick: int, do: Callable[[], object]) -> None:
        self._tick, self._do = tick, do

    def see(self, truth: Any) -> None:
        """Do it."""
        if truth.tick == self._tick:
            self._do()
