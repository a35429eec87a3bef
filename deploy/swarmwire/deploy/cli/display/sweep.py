"""A campaign in the terminal: its progress and its summary."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from swarmwire.comms.base.clock import Clock, WallClock, to_s
from swarmwire.deploy.campaigns.columns import failure_line
from swarmwire.deploy.campaigns.sweep import Sweep
from swarmwire.deploy.campaigns.worker import TaskResult
from swarmwire.metrics.records.campaign.campaign_json import FAILED, FINAL, LINK_PDR, Campaign, Response, value_text
from swarmwire.metrics.records.campaign.folder import CampaignFolder
from swarmwire.metrics.statistics.sample import Sample
from swarmwire.metrics.statistics.summary import quantile_text
from swarmwire.metrics.statistics.survival import kaplan_meier
from swarmwire.metrics.text import counted, number_text

SHARE = 0.1  # progress between two lines
MAX_POINTS = 20  # rows of the table
MAX_RESPONSES = 4


class Meter:
    """Progress of work: a bar with the remaining time in a terminal, else a line per tenth."""

    def __init__(self, console: Console, clock: Clock) -> None:
        self._console, self._clock = console, clock
        self._progress: Progress | None = None
        self._bar: TaskID | None = None
        if console.is_terminal and not console.is_dumb_terminal and not console.quiet:
            columns = (
                TextColumn("{task.description}", markup=False),
                BarColumn(),
                MofNCompleteColumn(),
                TextColumn("{task.fields[note]}", markup=False),
                TimeRemainingColumn(elapsed_when_finished=True),
            )
            self._progress = Progress(*columns, console=console, transient=True, speed_estimate_period=600)

    def begin(self, heading: tuple[str, str], noun: str, total: int, done: int, note: str) -> None:
        """Show the bar with a heading, or print a heading; `done` of `total` are done already."""
        self._noun, self._total, self._before, self._began_ns = noun, total, done, self._clock.now_ns()
        self._next = done + SHARE * total
        if self._progress is None:
            self._print(heading[1] + (f"; {done} of them are there" if done else ""))
            return
        self._progress.start()
        self._bar = self._progress.add_task(heading[0], total=total, completed=done, note=note)

    def per_s(self, done: int) -> float:
        """Return the number done per s of wall time, without earlier work."""
        wall_s = to_s(self._clock.now_ns() - self._began_ns)
        return (done - self._before) / wall_s if wall_s > 0 else 0.0

    def see(self, done: int, note: str) -> None:
        """Show the progress."""
        if self._progress is not None and self._bar is not None:
            self._progress.update(self._bar, completed=done, note=note)
        elif done >= min(self._next, self._total):
            self._next = done + SHARE * self._total
            per_s = self.per_s(done)
            remaining_s = (self._total - done) / per_s if per_s > 0 else 0.0
            self._print(f"{done}/{self._total} {self._noun}, {note}, {remaining_s:.0f} s left")

    def end(self) -> None:
        """Remove the bar."""
        if self._progress is not None:
            self._progress.stop()

    def _print(self, text: str) -> None:
        self._console.print(text, markup=False, soft_wrap=True)


class SweepProgress:
    """Observer that shows the finished and failed runs of a campaign, and their rate."""

    def __init__(self, console: Console, clock: Clock | None = None) -> None:
        self._meter = Meter(console, clock or WallClock())
        self._done = self._failed = 0

    def begin(self, campaign: Campaign, done: int, failed: int) -> None:
        """Show name and size of the campaign."""
        self._done, self._failed = done, failed
        points, seeds = counted(len(campaign.points), "point"), counted(len(campaign.seeds), "seed")
        line = f"{campaign.name}: {points} x {seeds} = {counted(campaign.runs, 'run')}"
        self._meter.begin((campaign.name, line), "runs", campaign.runs, done, "starting")

    def see(self, result: TaskResult) -> None:
        """Count the runs of a task."""
        self._done += len(result.rows)
        self._failed += sum(row["ended"] == FAILED for row in result.rows)
        failed = f", {self._failed} failed" if self._failed else ""
        self._meter.see(self._done, f"{self._meter.per_s(self._done):.1f} runs/s{failed}")

    def end(self) -> None:
        """Remove the bar."""
        self._meter.end()


def print_sweep(sweep: Sweep, console: Console, program: Path) -> None:
    """Print the progress of an interrupted campaign, or the medians by point."""
    folder = sweep.folder
    if not sweep.is_over:
        console.print(f"interrupted: {sweep.done} of {sweep.runs} runs are done", soft_wrap=True)
        console.print(f"continue: {program} sweep --resume {folder}", soft_wrap=True)
        return
    campaign = CampaignFolder(folder)
    console.print(_table(campaign))
    if len(campaign.points) > MAX_POINTS:
        console.print(f"… and {len(campaign.points) - MAX_POINTS} more points")
    if sweep.failed:
        failed = next(row for row in campaign.runs.iter_rows(named=True) if row["ended"] == FAILED)
        cause = failure_line(failed["error"])
        console.print(
            f"failed: {sweep.failed} of {sweep.runs} runs, such as run {failed['run']}: {cause}", markup=False
        )
        console.print(f"if the machine was at fault: {program} sweep --resume {folder} --retry-failed", soft_wrap=True)
        console.print("if the scenario's files were at fault: fix them, then start a new campaign in a new folder")
    console.print(f"written: {folder}", soft_wrap=True)
    console.print(f"look at it: {program} report {folder}", soft_wrap=True)
    console.print(f"again: {program} repeat {folder} --run {min(17, sweep.runs - 1)}", soft_wrap=True)


def _table(folder: CampaignFolder) -> Table:
    about, responses = folder.about, _responses(folder)
    title = f"{about.name}: medians over {counted(len(about.seeds), 'seed')}"
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
    """Return the first usual responses with a value, and the link PDR as the last."""
    runs = folder.runs
    usual = [
        response
        for response in folder.responses
        if response.is_usual and response.column in runs.columns and runs[response.column].count()
    ]
    others = [response for response in usual if response.column != LINK_PDR]
    link_pdr = [response for response in usual if response.column == LINK_PDR]
    return others[: MAX_RESPONSES - len(link_pdr)] + link_pdr


def _median(sample: Sample) -> str:
    """Return the median, of times that of Kaplan and Meier: runs may have ended before the event."""
    if not len(sample):
        return "-"
    if sample.kind == "time":
        return quantile_text(kaplan_meier(sample).quantile(0.5), float(sample.value.max()))
    return number_text(float(np.median(sample.value)))
