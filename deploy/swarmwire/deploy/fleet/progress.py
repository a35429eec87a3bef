"""The progress of each robot as a bar, in a terminal."""

from collections.abc import Generator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, DownloadColumn, Progress, SpinnerColumn, TaskID, TextColumn

from swarmwire.deploy.fleet.result import SILENT, Result, Watcher


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
