"""How a campaign is shown while it goes on: a bar in a terminal, else a line now and then."""

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from swarmwire.comms.clock import Clock, WallClock, to_s
from swarmwire.deploy.campaign.sweep import Observer
from swarmwire.deploy.campaign.worker import TaskResult
from swarmwire.metrics.campaign.spec import FAILED, Campaign

SHARE = 0.1  # a line each time that so much more is done


def sweep_progress(console: Console) -> Observer:
    """A bar with time left in a terminal, else plain lines."""
    clock = WallClock()
    if console.is_terminal and not console.is_dumb_terminal and not console.quiet:
        return SweepBar(clock, console)
    return SweepLines(clock, console)


class Figures:
    """How many runs are done, how many of them failed, and how fast they are."""

    def __init__(self, clock: Clock) -> None:
        self._clock, self._began_ns, self._new = clock, clock.now_ns(), 0
        self.runs = self.done = self.failed = 0

    def begin(self, campaign: Campaign, done: int, failed: int) -> None:
        """So many have rows already."""
        self.runs, self.done, self.failed = campaign.runs, done, failed
        self._began_ns = self._clock.now_ns()

    def see(self, result: TaskResult) -> None:
        """Count a task."""
        self._new += len(result.rows)
        self.done += len(result.rows)
        self.failed += sum(row["ended"] == FAILED for row in result.rows)

    @property
    def per_s(self) -> float:
        """Runs per s of wall time, without those that were there before."""
        wall_s = to_s(self._clock.now_ns() - self._began_ns)
        return self._new / wall_s if wall_s > 0 else 0.0

    def told(self) -> str:
        """In a few words."""
        failed = f", {self.failed} failed" if self.failed else ""
        return f"{self.per_s:.1f} runs/s{failed}"


class SweepBar:
    """Observer that draws a bar."""

    def __init__(self, clock: Clock, console: Console) -> None:
        self._figures = Figures(clock)
        columns = (
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[told]}", markup=False),
            TimeRemainingColumn(elapsed_when_finished=True),
        )
        self._progress = Progress(*columns, console=console, transient=True, speed_estimate_period=600)
        self._bar: TaskID | None = None

    def begin(self, campaign: Campaign, done: int, failed: int) -> None:
        """Show it."""
        self._figures.begin(campaign, done, failed)
        self._progress.start()
        self._bar = self._progress.add_task(campaign.name, total=campaign.runs, completed=done, told="starting")

    def see(self, result: TaskResult) -> None:
        """Draw it on."""
        self._figures.see(result)
        if self._bar is not None:
            self._progress.update(self._bar, completed=self._figures.done, told=self._figures.told())

    def end(self) -> None:
        """Take it away."""
        self._progress.stop()


class SweepLines:
    """Observer that prints a few lines."""

    def __init__(self, clock: Clock, console: Console) -> None:
        self._figures, self._console = Figures(clock), console
        self._next = 0.0

    def begin(self, campaign: Campaign, done: int, failed: int) -> None:
        """Say what runs."""
        self._figures.begin(campaign, done, failed)
        points, seeds = len(campaign.points), len(campaign.seeds)
        here = f"; {done} of them are there" if done else ""
        self._print(f"{campaign.name}: {points} points x {seeds} seeds = {campaign.runs} runs{here}")
        self._next = done + SHARE * campaign.runs

    def see(self, result: TaskResult) -> None:
        """Say how far it is, ten times in all."""
        figures = self._figures
        figures.see(result)
        if figures.done >= min(self._next, figures.runs):
            self._next = figures.done + SHARE * figures.runs
            left_s = (figures.runs - figures.done) / figures.per_s if figures.per_s > 0 else 0.0
            self._print(f"{figures.done}/{figures.runs} runs, {figures.told()}, {left_s:.0f} s left")

    def end(self) -> None:
        """Nothing is left to say."""

    def _print(self, text: str) -> None:
        self._console.print(text, markup=False, soft_wrap=True)
