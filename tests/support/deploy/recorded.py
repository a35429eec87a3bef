"""Runs that are recorded in haste, in this process and in one that a test may kill."""

import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

from swarmwire.comms.interfaces import Observer
from swarmwire.deploy import Recording, run
from swarmwire.metrics.run_folder import writer
from swarmwire.metrics.run_folder.writer import join_parts
from swarmwire.metrics.viewer.recording import RerunRecording
from tests.support.deploy.commands import LOSSY, ROOT


@contextmanager
def hastily() -> Generator[None]:
    """A recorder's two seconds pass in 40 ms, and it says when it joins the parts of a table.

    The viewer's recording is due by time alone, however much it is.
    """

    def say_and_join(folder: Path, name: str) -> None:
        print("ends", flush=True)
        join_parts(folder, name)

    with (
        patch.object(writer, "MAX_S", writer.MAX_S / 50),
        patch.object(writer, "join_parts", say_and_join),
        patch.object(RerunRecording, "_send_bytes", sys.maxsize),
    ):
        yield


class Saying(Observer):
    """An observer that prints a line per tick."""

    def begin(self, static) -> None:
        print("begins", flush=True)

    def see(self, truth) -> None:
        print(truth.tick, flush=True)


def record_run(folder: Path, scenario=LOSSY, packets=1.0, *, rrd=False, **options):
    """A run with all its tables in this folder, which must be new or empty."""
    return run(scenario, out=folder, record=Recording(packets=packets, rrd=rrd), **options)


def started(folder: Path, *overrides: str, rrd: bool = False) -> "subprocess.Popen[str]":
    """Such a run in a process of its own, in haste; it prints a line per tick."""
    program = (
        "import sys; from pathlib import Path; from tests.support.deploy.recorded import Saying, hastily, record_run\n"
        f"with hastily(): record_run(Path(sys.argv[1]), rrd={rrd}, observers=[Saying()], overrides=sys.argv[2:])"
    )
    command = [sys.executable, "-c", program, str(folder), *overrides]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT)
