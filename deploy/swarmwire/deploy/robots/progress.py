"""Work on robots while a terminal shows the progress of each as a bar."""

import asyncio
from collections.abc import Awaitable, Callable, Generator
from contextlib import contextmanager
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, DownloadColumn, Progress, SpinnerColumn, TaskID, TextColumn

from swarmwire.comms.base.errors import Interrupted
from swarmwire.deploy.robots.result import SILENT, RobotResult, Watcher
from swarmwire.deploy.terminal.console import TerminalConsole

T = TypeVar("T")


def watched(work: Callable[[Watcher], Awaitable[T]], interrupted: str) -> T:
    """The result of the work; Interrupted by Ctrl-C: what is under way is given up, and what is done stays.

    `interrupted` says what this means for robots that were not done.
    """

    async def run() -> T:
        with shown_on(TerminalConsole(stderr=True)) as watcher:
            return await work(watcher)

    try:
        return asyncio.run(run())
    except KeyboardInterrupt:
        raise Interrupted(f"interrupted: robots that were not done {interrupted}") from None


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

    def end(self, result: RobotResult) -> None:
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
