"""A task: some runs of one design point, run as arenas of one world, and their rows.

Where something raises, the task is split in two until the runs that fail are alone. So one bad seed costs its
neighbours only time, and the row of a failed run does not depend on how runs were batched.
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
from swarmwire.comms.base.errors import Interrupted
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.deploy.campaigns.columns import Row, failed_row, row_of
from swarmwire.deploy.runs.controls import Interrupt
from swarmwire.deploy.runs.record import provenance
from swarmwire.deploy.runs.simulation import Simulation
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.records.run_folder.writer import PARQUET

ALIVE_S = 1.0  # between two calls of `alive` while the ticks of a task go on
MAX_SILENCE_S = 300.0  # between two: no tick takes so long, nor does what comes before the first and after the last


@dataclass(frozen=True)
class Task:
    """Runs of one design point, which go side by side as arenas of one world. All in it is text and numbers."""

    scenario: str  # path of the scenario's file, which a campaign keeps in its folder
    overrides: tuple[str, ...]  # of the design point, as for `--set`
    point: int
    runs: tuple[int, ...]  # their numbers in the campaign
    seeds: tuple[int, ...]  # of these runs
    series: bool = True  # whether each tick's metrics are wanted, too
    record_to: str | None = None  # path of a run folder to be made; of a single run

    def split(self) -> "tuple[Task, Task]":
        """The same runs as two tasks; of at least two runs."""
        middle = len(self.runs) // 2
        return (
            replace(self, runs=self.runs[:middle], seeds=self.seeds[:middle]),
            replace(self, runs=self.runs[middle:], seeds=self.seeds[middle:]),
        )


@dataclass(frozen=True)
class TaskResult:
    """A row for each run of a task, in their order, also for those that failed."""

    rows: tuple[Row, ...]
    series: bytes | None = None  # a Parquet file: run, tick, and a column per metric; None: not wanted, or all failed


def run_task(task: Task, worker: str = "", alive: Callable[[], bool] = lambda: True) -> TaskResult:
    """Run a task to its end in this process, which `worker` names in the rows.

    What a run raises is in its row. `alive` is called every second between ticks; where it returns False, no one
    waits for the task any more: it ends after the tick, and Interrupted is raised.
    """
    clock = WallClock()
    began_ns = clock.now_ns()
    rows, series, error = _tried(task, alive)
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


def lost_task(task: Task, why: str) -> TaskResult:
    """The result of a task of one run of which workers died."""
    run, seed = task.runs[0], task.seeds[0]
    return TaskResult(({"run": run, "point": task.point, "seed": seed, **failed_row(why)},))


class TickSeries(Observer):
    """Observer that keeps the metrics' values of each tick in memory, 4 bytes per metric and arena."""

    def __init__(self, metrics: Metrics) -> None:
        """`metrics` must see each tick before."""
        self._metrics = metrics
        self._ticks: list[NDArray[np.float32]] = []  # each (metrics, arenas)

    def begin(self, static: Static) -> None:
        """Start afresh."""
        self._ticks = []

    def see(self, truth: Truth) -> None:
        """Keep this tick."""
        self._ticks.append(self._metrics.values.astype(np.float32))

    def parquet(self, runs: Sequence[int], ticks: Sequence[int]) -> bytes:
        """A Parquet file: `run`, `tick`, a float32 column per metric (NaN: no value); `ticks` rows of each arena.

        Rows rise by run and tick, where `runs` do, the number of each arena's.
        """
        import polars as pl

        names = [metric.name for metric in self._metrics.metrics]
        values = np.stack(self._ticks) if self._ticks else np.empty((0, len(names), len(runs)), np.float32)
        columns: dict[str, Any] = {
            "run": np.repeat(np.array(runs, np.int64), ticks),
            "tick": np.concatenate([np.arange(count, dtype=np.int32) for count in ticks]),
        }
        for place, name in enumerate(names):
            of_arenas = [values[:count, place, arena] for arena, count in enumerate(ticks)]
            columns[name] = np.concatenate(of_arenas)
        return _parquet(pl.DataFrame(columns))


class Alive(Observer):
    """Observer that calls `alive` between ticks, and interrupts the run where it returns False."""

    def __init__(self, alive: Callable[[], bool], interrupt: Interrupt, clock: Clock | None = None) -> None:
        self._alive, self._interrupt, self._clock = alive, interrupt, clock or WallClock()
        self._due_ns = self._clock.now_ns()

    def see(self, truth: Truth) -> None:
        """Call it, unless it was called a moment ago."""
        now_ns = self._clock.now_ns()
        if now_ns >= self._due_ns:
            self._due_ns = now_ns + to_ns(ALIVE_S)
            self._interrupt.requested = not self._alive()


def _tried(task: Task, alive: Callable[[], bool]) -> tuple[list[Row], bytes | None, str]:
    """As `_together`, and what was raised instead, or ""."""
    try:
        return *_together(task, alive), ""
    except Interrupted:
        raise
    except (Exception, SystemExit) as error:  # noqa: BLE001 - an agent may raise anything; it is in the run's row
        return [], None, _error_text(error, task)


def _together(task: Task, alive: Callable[[], bool]) -> tuple[list[Row], bytes | None]:
    """A row for each run, and their series, of all seeds in one world."""
    out = None if task.record_to is None else _aside(Path(task.record_to))
    simulation = Simulation(task.scenario, seeds=task.seeds, overrides=task.overrides, out=out)
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
    rows = [row_of(arena, times) for arena in simulation.result.arenas]
    return rows, series.parquet(task.runs, [row["ticks"] for row in rows]) if task.series else None


def _aside(folder: Path) -> Path:
    """The path of a run folder while it grows: under its own name it is complete. Removes what was there before."""
    aside = folder.with_name(f".aside-{folder.name}")
    for old in (folder, aside):
        if old.exists():
            shutil.rmtree(old)
    return aside


def _error_text(error: BaseException, task: Task) -> str:
    """An error as text that depends neither on the place of the campaign's folder nor on the depth of the stack."""
    text = str(error) or type(error).__name__
    text = text.encode("utf-8", "replace").decode("utf-8")  # a file's name may hold what is no letter
    text = sub(r"line repeated \d+ more times", "line repeated many times", text)
    return text.replace(str(Path(task.scenario).parent), "scenario")


def _joined(parts: list[TaskResult]) -> TaskResult:
    rows = tuple(row for part in parts for row in part.rows)
    series = [part.series for part in parts if part.series is not None]
    if len(series) < 2:
        return TaskResult(rows, series[0] if series else None)
    import polars as pl

    return TaskResult(rows, _parquet(pl.concat([pl.read_parquet(BytesIO(of)) for of in series])))


def _parquet(frame: Any) -> bytes:
    file = BytesIO()
    frame.write_parquet(file, **PARQUET)
    return file.getvalue()


@cache
def _machine() -> Row:
    return {"machine_cpu": provenance.cpu(), "machine_host": platform.node()}
