"""Progress of the work on robots: a bar per robot, in a terminal."""

import asyncio
from collections.abc import Awaitable, Callable, Generator
from contextlib import contextmanager
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, DownloadColumn, Progress, SpinnerColumn, TaskID, TextColumn

from swarmwire.comms.base.errors import Interrupted
from swarmwire.deploy.robots.result import SILENT, RobotResult, Watcher
from swarmwire.deploy.terminal.console import TerminalConsole

Result = TypeVar("Result")


def run_with_progress(work: Callable[[Watcher], Awaitable[Result]]) -> Result:
    """Run the work and return its result; Ctrl-C cancels it and raises Interrupted, and finished robots stay as is."""

    async def run() -> Result:
        with progress_watcher(TerminalConsole(stderr=True)) as watcher:
            return await work(watcher)

    try:
        return asyncio.run(run())
    except KeyboardInterrupt:
        raise Interrupted("interrupted: unfinished robots did not change") from None


class ProgressBars:
    """Watcher that draws a line for each robot at work, while its `progress` is shown."""

    def __init__(self, console: Console) -> None:
        columns = (
            SpinnerColumn(),
            TextColumn("{task.description}", markup=False),
            TextColumn("{task.fields[activity]}", markup=False),
            BarColumn(),
            DownloadColumn(),
        )
        self.progress = Progress(*columns, console=console, transient=True)
        self._tasks: dict[str, TaskID] = {}

    def step(self, robot: str, activity: str, done: int = 0, total: int = 0) -> None:
        """Draw the robot's activity and bytes."""
        if robot not in self._tasks:
            self._tasks[robot] = self.progress.add_task(robot, activity=activity, total=None)
        self.progress.update(self._tasks[robot], activity=activity, completed=done, total=total or None)

    def end(self, result: RobotResult) -> None:
        """Remove the robot's line."""
        if result.robot in self._tasks:
            self.progress.remove_task(self._tasks.pop(result.robot))


@contextmanager
def progress_watcher(console: Console) -> Generator[Watcher]:
    """Show bars within the context in a terminal, and nothing anywhere else."""
    if not console.is_terminal or console.is_dumb_terminal:
        yield SILENT
        return
    bars = ProgressBars(console)
    with bars.progress:
        yield bars
