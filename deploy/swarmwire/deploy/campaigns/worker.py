"""A task: runs of one design point, run as arenas of one world, and their rows.

If a run raises, the task is split in two until the runs that fail are alone. So a bad seed costs the others only time,
and the row of a failed run does not depend on the batches.
"""

import platform
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from io import BytesIO
from pathlib import Path
from re import sub
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swarmwire.comms.base.clock import Clock, WallClock, to_ns, to_s
from swarmwire.comms.base.errors import Interrupted, SwarmwireError
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.deploy.campaigns.columns import LATE, Row, failed_row, row_of
from swarmwire.deploy.runs.config import Recording
from swarmwire.deploy.runs.controls import Interrupt
from swarmwire.deploy.runs.record import provenance
from swarmwire.deploy.runs.result import Result
from swarmwire.deploy.runs.simulation import Simulation
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.records.run_folder.writer import PARQUET

ALIVE_INTERVAL_S = 1.0  # time between calls of `alive` during a run
MAX_SILENCE_S = 300.0  # longer than any tick, and than the start or end of a run


@dataclass(frozen=True)
class Task:
    """Runs of one design point, to be run as arenas of one world; fields are texts and numbers only."""

    scenario: str  # path of the scenario's file in the campaign's folder
    overrides: tuple[str, ...]  # overrides of the design point, in the form of `--set`
    point: int
    runs: tuple[int, ...]  # numbers in the campaign
    seeds: tuple[int, ...]  # seed of each run
    series: bool = True  # True to record each tick's metrics
    record_to: str | None = None  # path of the run folder, for a single recorded run
    realtime: float | None = None  # simulated s per s of wall time, for a single run; None: as fast as possible
    max_late: float = 1.0  # in real time: largest share of late frames or ticks of a run that counts

    def split(self) -> "tuple[Task, Task]":
        """Split two or more runs into two tasks."""
        middle = len(self.runs) // 2
        return (
            replace(self, runs=self.runs[:middle], seeds=self.seeds[:middle]),
            replace(self, runs=self.runs[middle:], seeds=self.seeds[middle:]),
        )


@dataclass(frozen=True)
class TaskResult:
    """A row for each run of a task, in their order, failed runs included."""

    rows: tuple[Row, ...]
    series: bytes | None = (
        None  #: a Parquet file: run, tick, and a column per metric; None: not recorded, or all failed
    )


def run_task(task: Task, worker: str = "", alive: Callable[[], bool] = lambda: True) -> TaskResult:
    """Execute a task in this process, whose name in the rows is `worker`.

    An exception of a run becomes its row. `alive` is called every second between ticks; if it returns False, the
    campaign no longer needs the task: it ends after the tick, and Interrupted is raised.
    """
    clock = WallClock()
    began_ns = clock.now_ns()
    rows, series, error = _try(task, alive)
    if error and len(task.runs) > 1:
        return _joined([run_task(part, worker, alive) for part in task.split()])
    if error:
        rows = [failed_row(error)]
    wall_s = to_s(clock.now_ns() - began_ns) / len(rows)
    machines = {"timing_wall_s": wall_s, **_machine(), "machine_worker": worker}
    numbered = zip(task.runs, task.seeds, rows, strict=True)
    return TaskResult(
        tuple({"run": run, "point": task.point, "seed": seed, **row, **machines} for run, seed, row in numbered), series
    )


def lost_task(task: Task, cause: str) -> TaskResult:
    """Return the result of a task of one run of which workers died."""
    run, seed = task.runs[0], task.seeds[0]
    return TaskResult(({"run": run, "point": task.point, "seed": seed, **failed_row(cause)},))


class TickSeries(Observer):
    """Observer that records the metrics' values of each tick in memory, 4 bytes per metric and arena."""

    def __init__(self, metrics: Metrics) -> None:
        """Record the values of `metrics`, which must see each tick first."""
        self._metrics = metrics
        self._ticks: list[NDArray[np.float32]] = []  # (metrics, arenas) each

    def begin(self, static: Static) -> None:
        """Start a run."""
        self._ticks = []

    def see(self, truth: Truth) -> None:
        """Record a tick."""
        self._ticks.append(self._metrics.values.astype(np.float32))

    def parquet(self, runs: Sequence[int], ticks: Sequence[int]) -> bytes:
        """Return a Parquet file: `run`, `tick`, a float32 column per metric (NaN: no value); `ticks` rows per arena.

        `runs` has the run of each arena; if they are in order, rows are sorted by run and tick.
        """
        import polars as pl

        names = [metric.name for metric in self._metrics.metrics]
        values = np.stack(self._ticks) if self._ticks else np.empty((0, len(names), len(runs)), np.float32)
        columns: dict[str, Any] = {
            "run": np.repeat(np.array(runs, np.int64), ticks),
            "tick": np.concatenate([np.arange(count, dtype=np.int32) for count in ticks]),
        }
        for index, name in enumerate(names):
            columns[name] = np.concatenate([values[:count, index, arena] for arena, count in enumerate(ticks)])
        return _parquet(pl.DataFrame(columns))


class Alive(Observer):
    """Observer that calls `alive` between ticks, and interrupts the run if it returns False."""

    def __init__(self, alive: Callable[[], bool], interrupt: Interrupt, clock: Clock | None = None) -> None:
        self._alive, self._interrupt, self._clock = alive, interrupt, clock or WallClock()
        self._due_ns = self._clock.now_ns()

    def see(self, truth: Truth) -> None:
        """Call `alive` if the interval has passed."""
        now_ns = self._clock.now_ns()
        if now_ns >= self._due_ns:
            self._due_ns = now_ns + to_ns(ALIVE_INTERVAL_S)
            self._interrupt.requested = not self._alive()


def _try(task: Task, alive: Callable[[], bool]) -> tuple[list[Row], bytes | None, str]:
    """Return rows and series of a task, and the text of an exception, or ""."""
    try:
        return *_run_batch(task, alive), ""
    except Interrupted:
        raise
    except (Exception, SystemExit) as error:  # noqa: BLE001 - an agent may raise anything; it is in the run's row
        return [], None, _error_text(error, task)


def _run_batch(task: Task, alive: Callable[[], bool]) -> tuple[list[Row], bytes | None]:
    """Run all seeds of a task in one world; return a row for each run, and their series."""
    out = None if task.record_to is None else _temporary_folder(Path(task.record_to))
    # In real time the viewer's recording, which takes a millisecond of each tick, would make frames late.
    simulation = Simulation(
        task.scenario,
        seeds=task.seeds,
        overrides=task.overrides,
        out=out,
        realtime=task.realtime,
        record=Recording(rrd=task.realtime is None),
    )
    simulation.watch(Alive(alive, simulation.interrupt))
    series = TickSeries(simulation.metrics)
    if task.series:
        simulation.watch(series)
    try:
        with simulation:
            simulation.run()
        if simulation.interrupt.requested:
            raise Interrupted("no client waits for the task any more")
    finally:
        if out is not None and out.exists():
            out.replace(str(task.record_to))
    times = {metric.name for metric in simulation.metrics.metrics if metric.kind == "time"}
    late = late_share(simulation.result)
    if late > task.max_late:
        raise RanLate(late, task.max_late)
    rows: list[Row] = [row_of(arena, times) | {LATE: late} for arena in simulation.result.arenas]
    return rows, series.parquet(task.runs, [row["ticks"] for row in rows]) if task.series else None


def late_share(result: Result) -> float:
    """Return the share of late frames of a run in real time, or that of late ticks if it is larger; else 0."""
    ticks = result.realtime.missed_ticks / max(1, result.ticks) if result.realtime else 0.0
    frames = result.interfaces.late / max(1, result.interfaces.delivered) if result.interfaces else 0.0
    return max(ticks, frames)


class RanLate(SwarmwireError):
    """A run in real time did not keep up, so its result is that of a busy machine."""

    def __init__(self, late: float, max_late: float) -> None:
        super().__init__(f"late: {late:.1%} of its frames or ticks, more than max_late = {max_late:.1%}")


def _temporary_folder(folder: Path) -> Path:
    """Return the path of an unfinished run folder, which is renamed once complete; remove earlier folders."""
    temporary = folder.with_name(f".aside-{folder.name}")
    for old in (folder, temporary):
        if old.exists():
            shutil.rmtree(old)
    return temporary


def _error_text(error: BaseException, task: Task) -> str:
    """Return an error's text, independent of the path of the campaign's folder and of the depth of the stack."""
    text = str(error) or type(error).__name__
    text = text.encode("utf-8", "replace").decode("utf-8")  # file names may have bytes that are no UTF-8
    text = sub(r"line repeated \d+ more times", "line repeated many times", text)
    return text.replace(str(Path(task.scenario).parent), "scenario")


def _joined(parts: list[TaskResult]) -> TaskResult:
    rows = tuple(row for part in parts for row in part.rows)
    series = [part.series for part in parts if part.series is not None]
    if len(series) < 2:
        return TaskResult(rows, series[0] if series else None)
    import polars as pl

    return TaskResult(rows, _parquet(pl.concat([pl.read_parquet(BytesIO(data)) for data in series])))


def _parquet(frame: Any) -> bytes:
    file = BytesIO()
    frame.write_parquet(file, **PARQUET)
    return file.getvalue()


@cache
def _machine() -> Row:
    return {"machine_cpu": provenance.cpu(), "machine_host": platform.node()}
