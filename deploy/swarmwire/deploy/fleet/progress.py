"""How work on robots is shown: a line each while it goes on in a terminal, and one for each when it is done."""

from collections.abc import Sequence

from rich.console import Console
from rich.progress import BarColumn, DownloadColumn, Progress, SpinnerColumn, TaskID, TextColumn

from swarmwire.deploy.fleet.result import Result
from swarmwire.deploy.fleet.watcher import SILENT, Watcher
from swarmwire.deploy.terminal.rows import aligned


class Bars:
    """Watcher that draws a line for each robot that is at work; use it as a context."""

    def __init__(self, console: Console) -> None:
        columns = (
            SpinnerColumn(),
            TextColumn("{task.description}", markup=False),
            TextColumn("{task.fields[doing]}", markup=False),
            BarColumn(),
            DownloadColumn(),
        )
        self._progress = Progress(*columns, console=console, transient=True)
        self._tasks: dict[str, TaskID] = {}

    def __enter__(self) -> Watcher:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def step(self, robot: str, doing: str, done: int = 0, total: int = 0) -> None:
        """Draw it on."""
        if robot not in self._tasks:
            self._tasks[robot] = self._progress.add_task(robot, doing=doing, total=None)
        self._progress.update(self._tasks[robot], doing=doing, completed=done, total=total or None)

    def end(self, result: Result) -> None:
        """Take its line away."""
        if result.robot in self._tasks:
            self._progress.remove_task(self._tasks.pop(result.robot))


class Nothing:
    """In the place of `Bars` where there is no terminal."""

    def __enter__(self) -> Watcher:
        return SILENT

    def __exit__(self, *_: object) -> None: ...


def shown_on(console: Console) -> Bars | Nothing:
    """Bars in a terminal; else nothing until the results."""
    return Bars(console) if console.is_terminal and not console.is_dumb_terminal else Nothing()


def result_lines(results: Sequence[Result]) -> list[str]:
    """A line per robot, names below one another."""
    return aligned([(result.robot, _told(result)) for result in results])


def _told(result: Result) -> str:
    said = " ".join(result.said.split())
    return said if result.good else f"failed: {said}" + (f"; {' '.join(result.cure.split())}" if result.cure else "")
