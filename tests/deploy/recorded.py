"""Runs whose tables are recorded, in this process and in one that a test may kill."""

import json
import subprocess
import sys
from pathlib import Path

from swarmwire.comms.clock import WallClock
from swarmwire.deploy import run
from swarmwire.metrics.metrics import Metrics
from swarmwire.metrics.record.recorders import record_summary, recorders
from swarmwire.metrics.record.run_log import RunLog
from tests.deploy.commands import LOSSY, ROOT

HASTE = 50  # a recorder's two seconds pass in 40 ms


class HastyClock:
    """The wall clock, faster."""

    def now_ns(self) -> int:
        return HASTE * WallClock().now_ns()

    def sleep_until(self, at_ns: int) -> None:
        raise AssertionError("nothing that records waits for the time")


class Told:
    """An observer that passes on what another adds to the summary."""

    def __init__(self, observer, parts) -> None:
        self.begin, self.see = observer.begin, observer.see
        self._observer, self._parts = observer, parts

    def end(self, last):
        self._parts.update(self._observer.end(last))
        return {}


class Saying:
    """An observer that prints a line per tick."""

    def begin(self, static) -> None:
        print("begins", flush=True)

    def see(self, truth) -> None:
        print(truth.tick, flush=True)

    def end(self, last):
        print("ends", flush=True)
        return {}


def record_run(folder: Path, scenario=LOSSY, observers=(), clock=None, packets=1.0, **options):
    """A run with all its tables, its summary and its log in this folder, which must be there."""
    metrics, parts = Metrics(), {}
    log = RunLog(folder)
    log.say("begins")
    log.close()
    tables = recorders(folder, metrics, clock or WallClock(), packets=packets)
    told = [Told(observer, parts) for observer in tables]
    result = run(scenario, observers=[metrics, *observers, *told], **options)
    summary = {**result.summary(), "record": record_summary(parts)}
    (folder / "summary.json").write_text(json.dumps(summary))
    return result


def started(folder: Path, *overrides: str) -> "subprocess.Popen[str]":
    """Such a run in a process of its own, in haste; it prints a line per tick."""
    program = (
        "import sys; from pathlib import Path; from tests.deploy.recorded import HastyClock, Saying, record_run;"
        "record_run(Path(sys.argv[1]), observers=[Saying()], clock=HastyClock(), overrides=sys.argv[2:])"
    )
    command = [sys.executable, "-c", program, str(folder), *overrides]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT)
