"""Results of a command, one for each robot: how they are made, watched and printed."""

from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

from rich.console import Console
from rich.progress import BarColumn, DownloadColumn, Progress, SpinnerColumn, TaskID, TextColumn

from swarmwire.comms.errors import SwarmwireError
from swarmwire.deploy.terminal.tables import aligned


class HostFailed(SwarmwireError):
    """A robot's host cannot be reached or cannot do the request: the reason and a remedy. Other robots continue."""

    def __init__(self, cause: str, cure: str = "") -> None:
        self.cause, self.cure = cause, cure
        super().__init__("; ".join(filter(None, (cause, cure))))


@dataclass(frozen=True)
class Result:
    """One robot's line: whether it is as was asked, what there is to say, and what helps if it is not."""

    robot: str
    good: bool
    said: str
    cure: str = ""

    @classmethod
    def failed(cls, robot: str, error: HostFailed) -> "Result":
        """The line of a robot for which it did not work."""
        return cls(robot, False, error.cause, error.cure)


class Watcher(Protocol):
    """Receives the progress of each robot."""

    def step(self, robot: str, doing: str, done: int = 0, total: int = 0) -> None:
        """Something begins, or has got to `done` of `total` bytes."""
        ...

    def end(self, result: Result) -> None:
        """A robot is through."""
        ...


class Silent:
    """No observer."""

    def step(self, robot: str, doing: str, done: int = 0, total: int = 0) -> None:
        """Nothing to do."""

    def end(self, result: Result) -> None:
        """Nothing to do."""


SILENT = Silent()


class Bars:
    """Watcher that draws a line for each robot that is at work, while its `progress` is shown."""

    def __init__(self, console: Console) -> None:
        columns = (
            SpinnerColumn(),
            TextColumn("{task.description}", markup=False),
            TextColumn("{task.fields[doing]}", markup=False),
            BarColumn(),
            DownloadColumn(),
        )
        self.progress = Progress(*columns, console=console, transient=True)
        self._tasks: dict[str, TaskID] = {}

    def step(self, robot: str, doing: str, done: int = 0, total: int = 0) -> None:
        """Draw it on."""
        if robot not in self._tasks:
            self._tasks[robot] = self.progress.add_task(robot, doing=doing, total=None)
        self.progress.update(self._tasks[robot], doing=doing, completed=done, total=total or None)

    def end(self, result: Result) -> None:
        """Take its line away."""
        if result.robot in self._tasks:
            self.progress.remove_task(self._tasks.pop(result.robot))


@contextmanager
def shown_on(console: Console) -> Generator[Watcher]:
    """Bars in a terminal while the block lasts; else nothing until the results."""
    if not console.is_terminal or console.is_dumb_terminal:
        yield SILENT
        return
    bars = Bars(console)
    with bars.progress:
        yield bars


def result_lines(results: Sequence[Result]) -> list[str]:
    """A line per robot, names below one another."""
    return aligned([(result.robot, _told(result)) for result in results])


def _told(result: Result) -> str:
    said = " ".join(result.said.split())
    return said if result.good else f"failed: {said}" + (f"; {' '.join(result.cure.split())}" if result.cure else "")
