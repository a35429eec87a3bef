"""What came of a tuning, as people read it in a terminal: the best parameters, what they are worth, what to do next."""

from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from swarmwire.deploy.terminal.tune_texts import (
    difference_text,
    failed_text,
    parameter_text,
    sample_text,
    statistic_text,
)
from swarmwire.deploy.tuning.best import FILE, FreshCheck, gained
from swarmwire.deploy.tuning.run import Tuned
from swarmwire.deploy.tuning.study import Trial


def print_tuned(tuned: Tuned, console: Console, program: Path) -> None:
    """How far the tuning is; once it is over, what it found."""
    if tuned.best is None or tuned.check is None:
        _print_interrupted(tuned, console, program)
        return
    failed = [trial for trial in tuned.trials if trial.state == "failed"]
    console.print(_parameters(tuned, tuned.best))
    console.print(_worth(tuned, tuned.best, tuned.check))
    of, difference, interval = gained(tuned.check, tuned.tuning.goal)
    console.print(f"best less own on fresh seeds, {of}: {difference_text(difference, interval)}", markup=False)
    if failed:
        example = f"trial {failed[0].number}: {failed[0].why}"
        text = f"failed: {len(failed)} of {len(tuned.trials)} trials, such as {example}"
        console.print(text, markup=False, soft_wrap=True)
    folder = tuned.folder
    for line in (
        f"written: {folder}",
        f"run the best: {program} run {folder / FILE}",
        f"compare all responses: {program} compare {tuned.check.own_folder} {tuned.check.best_folder}",
        f"try more: {program} tune --resume {folder} --trials {2 * tuned.tuning.trials}",
    ):
        console.print(line, markup=False, soft_wrap=True)


def _print_interrupted(tuned: Tuned, console: Console, program: Path) -> None:
    total, done = tuned.tuning.trials, len(tuned.trials)
    where = f"interrupted: {done} of {total} trials are done" if done < total else "interrupted during the check"
    console.print(where, soft_wrap=True)
    if tuned.best is not None:
        parameters = ", ".join(f"{path}={parameter_text(value)}" for path, value in tuned.best.parameters.items())
        text = f"best so far: {statistic_text(tuned.best, tuned.tuning.goal)} with {parameters}"
        console.print(text, markup=False, soft_wrap=True)
    console.print(f"go on: {program} tune --resume {tuned.folder}", markup=False, soft_wrap=True)


def _parameters(tuned: Tuned, best: Trial) -> Table:
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


def _worth(tuned: Tuned, best: Trial, check: FreshCheck) -> Table:
    """The goal on the seeds of the trials, on which the best looks better than it is, and on fresh ones."""
    tuning = tuned.tuning
    table = Table(title=Text(tuning.goal.text), title_justify="left", title_style="bold")
    table.add_column("parameters", style="cyan")
    table.add_column(f"{len(tuning.seeds)} tuning seeds", justify="right")
    table.add_column(f"{len(tuning.check_seeds)} fresh seeds", justify="right", overflow="fold")
    for name, before, sample in (
        ("best", statistic_text(best, tuning.goal), check.best),
        ("the scenario's own", "", check.own),
    ):
        after = sample_text(sample, tuning.goal) + failed_text(sample.failed)
        table.add_row(name, Text(before), Text(after))
    return table
