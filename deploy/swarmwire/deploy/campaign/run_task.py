"""A task, run: its seeds as arenas of one world; where something raises, in halves until those that fail are alone.

So one bad seed costs its neighbours nothing but time. A run that failed did so alone, whatever its batch was:
its row does not depend on the packing.
"""

import platform
import shutil
from collections.abc import Callable
from functools import cache
from io import BytesIO
from pathlib import Path
from re import sub

from swarmwire.comms.clock import WallClock, to_s
from swarmwire.comms.errors import Interrupted
from swarmwire.deploy.campaign.row import failed_row, row_of
from swarmwire.deploy.campaign.silence import Alive
from swarmwire.deploy.campaign.task import Row, Task, TaskResult
from swarmwire.deploy.campaign.tick_series import TickSeries
from swarmwire.deploy.record import machine
from swarmwire.deploy.simulation import Simulation


def nobody_listens() -> None:
    """For whoever does not watch over its workers."""


def run_task(task: Task, worker: str = "", alive: Callable[[], None] = nobody_listens) -> TaskResult:
    """Run a task to its end in this process; `worker` names who does, for the rows; `alive` is called now and then.

    There is a row for each run of the task: what a run raises is in its row. (Interrupted alone is passed on.)
    """
    clock = WallClock()
    began_ns = clock.now_ns()
    rows, series, error = _tried(task, alive)
    if error and len(task.runs) > 1:
        return _joined([run_task(half, worker, alive) for half in task.halves()])
    if error:
        rows = [failed_row(error)]
    wall_s = to_s(clock.now_ns() - began_ns) / len(rows)
    machines = {"timing_wall_s": wall_s, **_machine(), "machine_worker": worker}
    numbered = zip(task.runs, task.seeds, rows, strict=True)
    return TaskResult(
        tuple({"run": run, "point": task.point, "seed": seed, **row, **machines} for run, seed, row in numbered), series
    )


def lost_task(task: Task, why: str) -> TaskResult:
    """What is told of a task of one run whose workers died of it."""
    run, seed = task.runs[0], task.seeds[0]
    return TaskResult(({"run": run, "point": task.point, "seed": seed, **failed_row(why)},))


def _tried(task: Task, alive: Callable[[], None]) -> tuple[list[Row], bytes | None, str]:
    """As `_together`, and what was raised instead, or ""."""
    try:
        return *_together(task, alive), ""
    except Interrupted:
        raise
    except (Exception, SystemExit) as error:  # noqa: BLE001 - whatever it is, it is told in the row of whose it is
        return [], None, _told(error, task)


def _together(task: Task, alive: Callable[[], None]) -> tuple[list[Row], bytes | None]:
    """A row for each run, and their series, of all seeds in one world."""
    out = None if task.record_to is None else _beside(Path(task.record_to))
    simulation = Simulation(task.scenario, seeds=task.seeds, overrides=task.overrides, out=out)
    simulation.watch(Alive(alive))
    series = TickSeries(simulation.metrics)
    if task.series:
        simulation.watch(series)
    try:
        with simulation:
            simulation.run()
        if simulation.record_failed:
            raise simulation.record_failed
    finally:
        if out is not None and out.exists():
            out.replace(str(task.record_to))
    times = {metric.name for metric in simulation.metrics.metrics if metric.kind == "time"}
    rows = [row_of(arena, times) for arena in simulation.result.arenas]
    return rows, series.parquet(task.runs, [row["ticks"] for row in rows]) if task.series else None


def _beside(folder: Path) -> Path:
    """Where a run folder is while it grows: under its own name it is whole, so what is there of old goes."""
    beside = folder.with_name(f".aside-{folder.name}")
    for old in (folder, beside):
        if old.exists():
            shutil.rmtree(old)
    return beside


def _told(error: BaseException, task: Task) -> str:
    """What was raised, as text that does not depend on where the campaign's folder lies, nor on how deep we are."""
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

    from swarmwire.metrics.run_folder.writer import PARQUET

    file = BytesIO()
    pl.concat([pl.read_parquet(BytesIO(of)) for of in series]).write_parquet(file, **PARQUET)
    return TaskResult(rows, file.getvalue())


@cache
def _machine() -> Row:
    return {"machine_cpu": machine.cpu(), "machine_host": platform.node()}
