"""A campaign as people see it in a terminal: while it goes on, and what came of it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from swarmwire.comms.clock import Clock, WallClock, to_s
from swarmwire.deploy.campaign.sweep import Observer, Sweep
from swarmwire.deploy.campaign.worker import TaskResult
from swarmwire.metrics.campaign.folder import CampaignFolder
from swarmwire.metrics.campaign.spec import FAILED, FINAL, LINK_PDR, Campaign, Response, value_text
from swarmwire.metrics.statistics.sample import Sample
from swarmwire.metrics.statistics.summary import quantile_text
from swarmwire.metrics.statistics.survival import kaplan_meier
from swarmwire.metrics.text import number_text

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


MAX_POINTS = 20  # that are shown
MAX_RESPONSES = 4


def print_sweep(sweep: Sweep, console: Console, program: Path) -> None:
    """How far the campaign is; once it is over, its medians by point."""
    folder = sweep.folder
    if not sweep.is_over:
        console.print(f"interrupted: {sweep.done} of {sweep.runs} runs are done", soft_wrap=True)
        console.print(f"go on: {program} sweep --resume {folder}", soft_wrap=True)
        return
    campaign = CampaignFolder(folder)
    console.print(_table(campaign))
    if len(campaign.points) > MAX_POINTS:
        console.print(f"… and {len(campaign.points) - MAX_POINTS} more points")
    if sweep.failed:
        failed = next(row for row in campaign.runs.iter_rows(named=True) if row["ended"] == FAILED)
        why = failed["error"].strip().splitlines()[-1]
        console.print(f"failed: {sweep.failed} of {sweep.runs} runs, such as run {failed['run']}: {why}", markup=False)
        console.print(f"if the machine was at fault: {program} sweep --resume {folder} --retry-failed", soft_wrap=True)
        console.print("if the scenario's files were: a new campaign, once they are mended; this one keeps its copies")
    console.print(f"written: {folder}", soft_wrap=True)
    console.print(f"look at it: {program} report {folder}", soft_wrap=True)
    console.print(f"again: {program} repeat {folder} --run {min(17, sweep.runs - 1)}", soft_wrap=True)


def _table(folder: CampaignFolder) -> Table:
    about, responses = folder.about, _responses(folder)
    title = f"{about.name}: medians over {len(about.seeds)} seeds"
    table = Table(title=Text(title), title_justify="left", title_style="bold")
    for path in folder.parameters:
        table.add_column(Text(path), style="cyan")
    table.add_column("failed", justify="right")
    for response in responses:
        table.add_column(Text(response.column.removesuffix(FINAL)), justify="right", overflow="fold")
    failed = folder.runs.filter(folder.runs["ended"] == FAILED)["point"].to_list()
    for number, point in enumerate(about.points[:MAX_POINTS]):
        medians = [_median(folder.sample(response.column, number)) for response in responses]
        table.add_row(*(Text(value_text(value)) for value in point.values()), str(failed.count(number)), *medians)
    return table


def _responses(folder: CampaignFolder) -> Sequence[Response]:
    """The first usual ones that have any value, and last the link PDR."""
    runs = folder.runs
    usual = [of for of in folder.responses if of.is_usual and of.column in runs.columns and runs[of.column].count()]
    first, last = [of for of in usual if of.column != LINK_PDR], [of for of in usual if of.column == LINK_PDR]
    return first[: MAX_RESPONSES - len(last)] + last


def _median(sample: Sample) -> str:
    """As in reports: of times Kaplan and Meier's, since runs may have ended before theirs, each at another time."""
    if not len(sample):
        return "-"
    if sample.kind == "time":
        return quantile_text(kaplan_meier(sample).quantile(0.5), float(sample.value.max()))
    return number_text(float(np.median(sample.value)))
