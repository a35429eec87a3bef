"""How a tuning is shown while it goes on: a bar in a terminal, else a line now and then."""

from collections.abc import Sequence

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from swarmwire.comms.clock import Clock, WallClock, to_s
from swarmwire.deploy.terminal.tune_texts import statistic_text
from swarmwire.deploy.tuning.best import best_of
from swarmwire.deploy.tuning.run import TrialObserver
from swarmwire.deploy.tuning.spec import Tuning
from swarmwire.deploy.tuning.study import Trial

SHARE = 0.1  # a line each time that so much more is done


def tune_progress(console: Console) -> TrialObserver:
    """A bar with the best so far and the time left in a terminal, else plain lines."""
    if console.is_terminal and not console.is_dumb_terminal and not console.quiet:
        return TuneBar(console)
    return TuneLines(WallClock(), console)


def best_told(tuning: Tuning, trials: Sequence[Trial]) -> str:
    """The best so far, and how many failed, in a few words."""
    best = best_of(trials, tuning.goal)
    failed = sum(trial.state == "failed" for trial in trials)
    told = "none yet" if best is None else f"{statistic_text(best, tuning.goal)} (trial {best.number})"
    return f"best: {told}" + (f", {failed} failed" if failed else "")


class TuneBar:
    """Observer that draws a bar."""

    def __init__(self, console: Console) -> None:
        columns = (
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[told]}", markup=False),
            TimeRemainingColumn(elapsed_when_finished=True),
        )
        self._progress = Progress(*columns, console=console, transient=True, speed_estimate_period=600)
        self._bar: TaskID | None = None
        self._tuning: Tuning | None = None
        self._trials: list[Trial] = []

    def begin(self, tuning: Tuning, trials: Sequence[Trial]) -> None:
        """Show it."""
        self._tuning, self._trials = tuning, list(trials)
        self._progress.start()
        told = best_told(tuning, trials)
        self._bar = self._progress.add_task("trials", total=tuning.trials, completed=len(trials), told=told)

    def see(self, trial: Trial) -> None:
        """Draw it on."""
        self._trials.append(trial)
        if self._bar is not None and self._tuning is not None:
            told = best_told(self._tuning, self._trials)
            self._progress.update(self._bar, completed=len(self._trials), told=told)

    def end(self) -> None:
        """Take it away."""
        self._progress.stop()


class TuneLines:
    """Observer that prints a few lines."""

    def __init__(self, clock: Clock, console: Console) -> None:
        self._clock, self._console, self._began_ns = clock, console, clock.now_ns()
        self._tuning: Tuning | None = None
        self._trials: list[Trial] = []
        self._before, self._next = 0, 0.0

    def begin(self, tuning: Tuning, trials: Sequence[Trial]) -> None:
        """Say what runs."""
        self._tuning, self._trials, self._before = tuning, list(trials), len(trials)
        self._began_ns = self._clock.now_ns()
        self._next = self._before + SHARE * tuning.trials
        here = f"; {self._before} of them are there" if trials else ""
        self._print(f"{tuning.scenario}: {tuning.goal.text}: {tuning.trials} trials x {len(tuning.seeds)} seeds{here}")

    def see(self, trial: Trial) -> None:
        """Say how far it is and what is the best, ten times in all."""
        self._trials.append(trial)
        tuning, done = self._tuning, len(self._trials)
        if tuning is not None and done >= min(self._next, tuning.trials):
            self._next = done + SHARE * tuning.trials
            each_s = to_s(self._clock.now_ns() - self._began_ns) / (done - self._before)
            left_s = (tuning.trials - done) * each_s
            self._print(f"{done}/{tuning.trials} trials, {best_told(tuning, self._trials)}, {left_s:.0f} s left")

    def end(self) -> None:
        """Nothing is left to say."""

    def _print(self, text: str) -> None:
        self._console.print(text, markup=False, soft_wrap=True)
