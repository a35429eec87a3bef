"""What a worker is given, and what it gives back: some runs of one design point, and their rows."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

Row = dict[str, Any]  # one run, by column of summary.parquet


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

    def halves(self) -> "tuple[Task, Task]":
        """The same runs as two tasks; of at least two runs."""
        middle = len(self.runs) // 2
        return (
            replace(self, runs=self.runs[:middle], seeds=self.seeds[:middle]),
            replace(self, runs=self.runs[middle:], seeds=self.seeds[middle:]),
        )


@dataclass(frozen=True)
class TaskResult:
    """What came of a task: a row for each of its runs, in their order, also for those that failed."""

    rows: tuple[Row, ...]
    series: bytes | None = None  # a Parquet file: run, tick, and a column per metric; None: not wanted, or all failed


def task_message(task: Task) -> dict[str, Any]:
    """A task as a plain mapping."""
    return asdict(task)


def task_from(message: Mapping[str, Any]) -> Task:
    """The task of such a mapping."""
    tuples: dict[str, Any] = {name: tuple(message[name]) for name in ("overrides", "runs", "seeds")}
    return Task(**{**message, **tuples})


def result_message(result: TaskResult) -> dict[str, Any]:
    """A result as a plain mapping."""
    return {"rows": list(result.rows), "series": result.series}


def result_from(message: Mapping[str, Any]) -> TaskResult:
    """The result of such a mapping."""
    return TaskResult(tuple(message["rows"]), message["series"])
