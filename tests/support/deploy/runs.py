"""The command line in a process of its own, and runs: recorded, watched, in a thread, in several layouts."""

import re
import subprocess
import sys
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import psutil
import pytest

from swarmwire.comms.observe.interfaces import Observer
from swarmwire.deploy import Recording, Result, run
from swarmwire.deploy.cli.app import main
from swarmwire.deploy.live.remote_control import RemoteControl, controlling
from swarmwire.deploy.runs import backends
from swarmwire.deploy.runs.live_address import Live, read_live
from swarmwire.deploy.runs.simulation import Simulation, run_to_end
from swarmwire.metrics.pictures.viewer.recording import RerunRecording
from swarmwire.metrics.records.run_folder import writer
from swarmwire.metrics.records.run_folder.writer import join_parts
from tests.support.clocks import until
from tests.support.world.locksteps import EncodedBackend

ROOT = Path(__file__).parents[3]
LOSSY = ROOT / "scenarios" / "flocking-lossy.toml"
DISRUPTED = ROOT / "scenarios" / "flocking-disrupted.toml"
# All that the scenario has happen in a minute, within four seconds.
TIMES = {"0": (0.3, 1.5), "1": (0.6, 0.9), "2": (1.1, None), "3": (1.3, 1.2), "4": (2.7, None)}
DISRUPTED_SHORT = [
    "duration_s=4",
    *(f"events.{i}.at_s={at_s}" for i, (at_s, _) in TIMES.items()),
    *(f"events.{i}.for_s={for_s}" for i, (_, for_s) in TIMES.items() if for_s),
]
WATCHER = """
import sys
from pathlib import Path
from swarmwire.comms.base.clock import WallClock
from swarmwire.deploy.live.subscription import subscribe
from swarmwire.deploy.runs.live_address import read_live

clock, seen = WallClock(), 0
with subscribe(read_live(Path(sys.argv[1]))) as run:
    print("looking", flush=True)
    while not run.over:
        if run.next() is None:
            clock.sleep_until(clock.now_ns() + 1_000_000)
        else:
            seen += 1
print(seen, run.lost, run.bad)
"""
PER_ROBOT = 1000  # more runners than robots


def swarmwire(*arguments: str | Path, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """A finished call."""
    command = [sys.executable, "-m", "swarmwire.deploy", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=100, cwd=cwd, check=False)


def called(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *arguments: str | Path
) -> tuple[object, str, str]:
    """Exit code, output and errors of a call in this process: many times as quick as a process of its own."""
    monkeypatch.setattr(sys, "argv", ["swarmwire", *map(str, arguments)])
    with pytest.raises(SystemExit) as ended:
        main()
    out, errors = capsys.readouterr()
    return ended.value.code, out, errors


def refused_command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *arguments: str | Path, match: str = ""
) -> None:
    """Require that a call ends with exit code 2 and prints one line alone, whose begin matches."""
    code, out, errors = called(monkeypatch, capsys, *arguments)
    assert (code, out, errors.count("\n")) == (2, "", 1), (code, out, errors)
    assert re.match(f"error: {match}", errors), errors


def started(*arguments: str | Path) -> subprocess.Popen[str]:
    """A run that has begun to tick."""
    command = [sys.executable, "-m", "swarmwire.deploy", "run", *map(str, arguments)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    first = process.stdout.readline()
    if first.startswith("compiling"):
        first = process.stdout.readline()
    assert "robots" in first, (first, process.stderr.read() if process.stderr and not first else "")
    return process


def family(process: subprocess.Popen[str]) -> list[psutil.Process]:
    """All processes of a run but the first."""
    return psutil.Process(process.pid).children(recursive=True)


def runners_of(process: subprocess.Popen[str]) -> list[psutil.Process]:
    """The runners' processes of a run."""
    return processes_of(psutil.Process(process.pid))


def processes_of(world: psutil.Process) -> list[psutil.Process]:
    """The agent processes of a world: those that the fork server of its agent host has forked."""
    servers = [server for agent_host in world.children() for server in agent_host.children()]
    return [process for server in servers for process in server.children()]


@contextmanager
def hastily() -> Generator[None]:
    """A recorder's two seconds pass in 40 ms, and it says when it joins the parts of a table.

    The viewer's recording is due by time alone, however much it is.
    """

    def say_and_join(folder: Path, name: str) -> None:
        print("ends", flush=True)
        join_parts(folder, name)

    with (
        patch.object(writer, "MAX_CHUNK_S", writer.MAX_CHUNK_S / 50),
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


def started_in_haste(folder: Path, *overrides: str, rrd: bool = False) -> "subprocess.Popen[str]":
    """Such a run in a process of its own, in haste; it prints a line per tick."""
    program = (
        "import sys; from pathlib import Path; from tests.support.deploy.runs import Saying, hastily, record_run\n"
        f"with hastily(): record_run(Path(sys.argv[1]), rrd={rrd}, observers=[Saying()], overrides=sys.argv[2:])"
    )
    command = [sys.executable, "-c", program, str(folder), *overrides]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT)


@contextmanager
def watcher(folder: Path) -> Generator[subprocess.Popen[str]]:
    """A process that looks on at the run in this folder, and prints what it saw when that is over."""
    with subprocess.Popen([sys.executable, "-c", WATCHER, str(folder)], stdout=subprocess.PIPE, text=True) as process:
        try:
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


@contextmanager
def going(folder: Path, *overrides: str, **keys: Any) -> Generator[tuple[Simulation, RemoteControl]]:
    """The run and control over it; it goes to its end with the block."""
    keys = {"record": Recording(rrd=False, tables=False), **keys}
    simulation = Simulation(LOSSY, overrides=overrides, out=folder, **keys)
    simulation.controls.pause()
    thread = threading.Thread(target=run_to_end, args=(simulation,))
    thread.start()
    try:
        live = until(lambda: read_live(folder))
        assert isinstance(live, Live)
        with controlling(live.endpoint, live.run) as control:
            at_tick(control, 0)
            yield simulation, control
    except BaseException:
        simulation.controls.quit()
        raise
    finally:
        if not simulation.controls.real_time:
            simulation.controls.set_speed(None)
        simulation.controls.resume()
        thread.join()


def at_tick(control: RemoteControl, tick: int) -> dict[str, Any]:
    """The status, once the run stands still there."""
    return until(control.status, lambda status: (status["state"], status["tick"]) == ("paused", tick))


def run_spread(scenario: Path, runners: int | None, **options: Any) -> Result:
    """A run with its robots in so many parts; None: agents get what they sense as it is."""
    with pytest.MonkeyPatch.context() as patched:
        if runners is not None:
            patched.setattr(backends, "LocalBackend", partial(EncodedBackend, runners=runners))
        return run(scenario, **options)
