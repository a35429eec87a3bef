"""A tuning in the terminal: its progress and its summary."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from swarmwire.comms.base.clock import WallClock
from swarmwire.deploy.campaigns.tuning.best import FILE, FreshCheck, best_of, gained
from swarmwire.deploy.campaigns.tuning.run import Tuned
from swarmwire.deploy.campaigns.tuning.spec import SHARES, Goal, Tuning
from swarmwire.deploy.campaigns.tuning.study import TuningTrial
from swarmwire.deploy.cli.display.sweep import Meter
from swarmwire.metrics.statistics.bootstrap import binomial_interval, is_skewed
from swarmwire.metrics.statistics.sample import UNKNOWN, Interval, Sample
from swarmwire.metrics.statistics.summary import SKEWED_SAMPLE, interval_text, quantile_text, summary
from swarmwire.metrics.statistics.survival import kaplan_meier
from swarmwire.metrics.text import UNKNOWN_TEXT, number_text


def statistic_text(trial: TuningTrial, goal: Goal) -> str:
    """Return the statistic of a trial: a number with its unit, or `> 60 s`."""
    statistic = trial.result.statistic
    if trial.result.value is None:
        return UNKNOWN_TEXT
    return with_unit(quantile_text(math.nan if statistic is None else statistic, goal.limit_s), goal)


def sample_text(sample: Sample, goal: Goal) -> str:
    """Return the statistic of other runs, with its interval if there is one."""
    reached = goal.reached(sample)
    if not len(sample):
        return UNKNOWN_TEXT
    text = with_unit(quantile_text(reached.statistic, goal.limit_s), goal)
    interval = interval_text(_interval(sample, goal))
    return text if interval == UNKNOWN_TEXT else f"{text} ({interval})"


def with_unit(text: str, goal: Goal) -> str:
    """Append the unit of the goal to a number; a share has none."""
    return text if goal.stat == "censored" or not goal.response.unit else f"{text} {goal.response.unit}"


def _interval(sample: Sample, goal: Goal) -> Interval:
    if goal.stat == "censored":
        low, high = binomial_interval(np.array([np.count_nonzero(~sample.observed)]), np.array([len(sample)]))
        return Interval(float(low[0]), float(high[0]))
    statistics = summary(sample)
    if goal.stat == "mean":
        return statistics.mean_interval
    if goal.stat == "q50":
        return statistics.q50_interval
    return kaplan_meier(sample).quantile_interval(SHARES[goal.stat]) if sample.kind == "time" else UNKNOWN


def parameter_text(value: object) -> str:
    """Return a parameter with five digits; best.toml has all digits.

    >>> parameter_text(0.123456789), parameter_text(12), parameter_text("discs")
    ('0.12346', '12', 'discs')
    """
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def failed_text(failed: int) -> str:
    """Return the number of failed runs as a text, empty for none.

    >>> failed_text(0), failed_text(2)
    ('', ', 2 failed')
    """
    return f", {failed} failed" if failed else ""


def difference_text(difference: float, interval: Interval) -> str:
    """Return a difference with its interval, signed.

    >>> difference_text(-1.5, Interval(-2.0, -1.0))
    '-1.5 (-2 to -1)'
    """
    return f"{number_text(difference, sign=True)} ({interval_text(interval, sign=True)})"


def best_text(tuning: Tuning, trials: Sequence[TuningTrial]) -> str:
    """Return a text on the best trial so far and the number of failed trials."""
    best = best_of(trials, tuning.goal)
    failed = sum(trial.state == "failed" for trial in trials)
    result = "none yet" if best is None else f"{statistic_text(best, tuning.goal)} (trial {best.number})"
    return f"best: {result}" + (f", {failed} failed" if failed else "")


class TuneProgress:
    """Observer that shows the number of finished trials, and the best trial."""

    def __init__(self, console: Console) -> None:
        self._meter = Meter(console, WallClock())
        self._tuning: Tuning | None = None
        self._trials: list[TuningTrial] = []

    def begin(self, tuning: Tuning, trials: Sequence[TuningTrial]) -> None:
        """Show goal and size of the tuning."""
        self._tuning, self._trials = tuning, list(trials)
        line = f"{tuning.scenario}: {tuning.goal.text}: {tuning.trials} trials x {len(tuning.seeds)} seeds"
        self._meter.begin(("trials", line), "trials", tuning.trials, len(trials), best_text(tuning, trials))

    def see(self, trial: TuningTrial) -> None:
        """Count a trial."""
        self._trials.append(trial)
        if self._tuning is not None:
            self._meter.see(len(self._trials), best_text(self._tuning, self._trials))

    def end(self) -> None:
        """Work is over."""
        self._meter.end()


def print_tuned(tuned: Tuned, console: Console, program: Path) -> None:
    """Print the progress of an interrupted tuning, or its result."""
    if tuned.best is None or tuned.check is None:
        _print_interrupted(tuned, console, program)
        return
    failed = [trial for trial in tuned.trials if trial.state == "failed"]
    console.print(_parameters(tuned, tuned.best))
    console.print(_goal_table(tuned, tuned.best, tuned.check))
    statistic, difference, interval = gained(tuned.check, tuned.tuning.goal)
    console.print(
        f"best minus scenario on fresh seeds, {statistic}: {difference_text(difference, interval)}", markup=False
    )
    if tuned.tuning.goal.stat == "mean" and any(map(is_skewed, (tuned.check.baseline.value, tuned.check.best.value))):
        console.print(SKEWED_SAMPLE, markup=False, soft_wrap=True)
    for search in tuned.tuning.searches:
        if (end := search.end_at(tuned.best.parameters[search.path])) is not None:
            text = f"{search.path} is best at the end of its range, {parameter_text(end)}: search further there"
            console.print(text, markup=False, soft_wrap=True)
    if failed:
        example = f"trial {failed[0].number}: {failed[0].why}"
        text = f"failed: {len(failed)} of {len(tuned.trials)} trials, such as {example}"
        console.print(text, markup=False, soft_wrap=True)
    folder = tuned.folder
    for line in (
        f"written: {folder}",
        f"run the best: {program} run {folder / FILE}",
        f"compare all responses: {program} compare {tuned.check.baseline_folder} {tuned.check.best_folder}",
        f"try more: {program} tune --resume {folder} --trials {2 * tuned.tuning.trials}",
    ):
        console.print(line, markup=False, soft_wrap=True)


def _print_interrupted(tuned: Tuned, console: Console, program: Path) -> None:
    total, done = tuned.tuning.trials, len(tuned.trials)
    progress = f"interrupted: {done} of {total} trials are done" if done < total else "interrupted during the check"
    console.print(progress, soft_wrap=True)
    if tuned.best is not None:
        parameters = ", ".join(f"{path}={parameter_text(value)}" for path, value in tuned.best.parameters.items())
        text = f"best so far: {statistic_text(tuned.best, tuned.tuning.goal)} with {parameters}"
        console.print(text, markup=False, soft_wrap=True)
    console.print(f"continue: {program} tune --resume {tuned.folder}", markup=False, soft_wrap=True)


def _parameters(tuned: Tuned, best: TuningTrial) -> Table:
    title = f"{tuned.tuning.scenario}: the best of {len(tuned.trials)} trials is trial {best.number}"
    table = Table(title=Text(title), title_justify="left", title_style="bold")
    table.add_column("parameter", style="cyan", overflow="fold")
    table.add_column("best", justify="right", overflow="fold")
    table.add_column("searched", justify="right", overflow="fold")
    if tuned.importance:
        table.add_column("importance", justify="right")
    for search in tuned.tuning.searches:
        ends = f"{parameter_text(search.low)} to {parameter_text(search.high)}"
        searched = ", ".join(search.names) if search.choices else ends + (", log" if search.log else "")
        row = [search.path, parameter_text(best.parameters[search.path]), searched]
        if tuned.importance:
            row.append(f"{100.0 * tuned.importance.get(search.path, 0.0):.0f} %")
        table.add_row(*map(Text, row))
    return table


def _goal_table(tuned: Tuned, best: TuningTrial, check: FreshCheck) -> Table:
    """Return the goal on the seeds of the trials, which flatter the best trial, and on fresh seeds."""
    tuning = tuned.tuning
    table = Table(title=Text(tuning.goal.text), title_justify="left", title_style="bold")
    table.add_column("parameters", style="cyan")
    table.add_column(f"{len(tuning.seeds)} tuning seeds", justify="right")
    table.add_column(f"{len(tuning.check_seeds)} fresh seeds", justify="right", overflow="fold")
    for name, before, sample in (
        ("best", statistic_text(best, tuning.goal), check.best),
        ("the scenario", "", check.baseline),
    ):
        after = sample_text(sample, tuning.goal) + failed_text(sample.failed)
        table.add_row(name, Text(before), Text(after))
    return table
