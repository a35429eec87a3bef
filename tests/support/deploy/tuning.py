"""Small tunings."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import polars as pl
import pytest

from swarmwire.deploy.campaigns.columns import Row
from swarmwire.deploy.campaigns.schedule import Finished
from swarmwire.deploy.campaigns.sweep import NoObserver
from swarmwire.deploy.campaigns.tuning import run
from swarmwire.deploy.campaigns.tuning.run import TuneObservers, begin_tune, resume_tune
from swarmwire.deploy.campaigns.tuning.spec import TuningPlan, TuningSpec, fresh_seeds, search_of, tuning_plan
from swarmwire.deploy.campaigns.worker import Task, TaskResult
from swarmwire.deploy.runs.config import seed_list
from swarmwire.deploy.runs.controls import Interrupt
from swarmwire.world.scenario.scenario import mapping_of
from swarmwire.world.scenario_file import load_scenario
from tests.support.deploy.campaign import InThisProcess

SCENARIO = """
format = 1
name = "bowl"
seed = 7
duration_s = 0.5
metrics = [{ metric = "bowl.py:Bowl", at = 0.1 }, { metric = "bowl.py:Ready", after_s = 0.4 }]
standard_metrics = false
[arena]
size_m = [4.0, 4.0]
[robots.pair]
body = "epuck"
count = 2
agent = "careful.py:Careful"
"""
BOWL = """
from dataclasses import dataclass
import numpy as np
from swarmwire.comms.base.config import parameter
from swarmwire.metrics.measures.metric import Metric

@dataclass(frozen=True)
class Bowl(Metric):
    at: float = parameter(0.0, help="where", at_least=0.0, at_most=1.0)
    name, help, bounds = "bowl", "least where at is 0.7", (0.0, None)

    def begin(self, static):
        return lambda moment: (self.at - 0.7) ** 2

@dataclass(frozen=True)
class Ready(Metric):
    after_s: float = parameter(0.0, help="when it happens", unit="s", at_least=0.0)
    name, help, unit, kind, bounds = "ready_s", "as told", "s", "time", (0.0, None)

    def begin(self, static):
        return lambda moment: self.after_s if moment.truth.tick / 10.0 >= self.after_s else np.nan
"""
CAREFUL = """
from swarmwire.agent import Agent
class Careful(Agent):
    speed: float = 0.1
    steps: int = 1
    def step(self, robot):
        if self.speed > 0.5:
            raise ValueError("too fast")
        robot.drive(0.0, 0.0)
"""
AT = "metrics.0.at=0:1"


def scenario_in(folder: Path) -> Path:
    """The scenario's file in this folder."""
    (folder / "bowl.py").write_text(BOWL)
    (folder / "careful.py").write_text(CAREFUL)
    path = folder / "bowl.toml"
    path.write_text(SCENARIO)
    return path


def plan_of(scenario: Path, *searched: str, **options: Any) -> TuningPlan:
    """The plan of a tuning for the bowl, unless something else is said."""
    seeds = seed_list(options.pop("seeds", 2))
    usual = {"goal": "min bowl", "trials": 10, "parallel_trials": 4, "sampler_seed": 1}
    searches = tuple(map(search_of, searched or (AT,)))
    fresh = fresh_seeds(options.pop("check_seeds", "2"), seeds)
    return tuning_plan(TuningSpec(scenario, searches, seeds=seeds, check_seeds=fresh, **{**usual, **options}))


class Calculating(InThisProcess):
    """An executor that knows what runs of the bowl come to, without running any."""

    def finished(self, timeout_s: float) -> list[Finished]:
        tasks, self.tasks = self.tasks[::-1], []
        return [Finished(task, TaskResult(tuple(_rows(task)))) for task in tasks]


def _rows(task: Task) -> Iterator[Row]:
    scenario = load_scenario(task.scenario, task.overrides)
    bowl, ready = mapping_of(scenario)["metrics"]
    value, end_s = (bowl["at"] - 0.7) ** 2, scenario.duration_s
    for index, seed in zip(task.runs, task.seeds, strict=True):
        row = {"run": index, "point": task.point, "seed": seed, "ended": "duration", "ticks": 5, "sim_time_s": end_s}
        yield {**row, "bowl.final": value, "ready_s": ready["after_s"] if ready["after_s"] < end_s else None}


class Looking:
    """Looks on, and asks for the end after so many trials."""

    def __init__(self, until: int | None = None) -> None:
        self.interrupt, self.until, self.seen = Interrupt(), until, []

    def begin(self, tuning, trials):
        self.begun = len(trials)

    def see(self, trial):
        self.seen.append(trial.number)
        self.interrupt.requested = self.until is not None and len(self.seen) >= self.until

    def end(self):
        pass

    def observers(self) -> TuneObservers:
        return TuneObservers(self, NoObserver(), self.interrupt)


def tuned(scenario: Path, folder: Path, *searched: str, until: int | None = None, **options: Any) -> Any:
    """What came of a tuning (`Tuned`), ended after so many trials if that is said."""
    plan = plan_of(scenario, *searched, **options)
    return begin_tune(plan, folder, "tune", None, Looking(until).observers())


def gone_on_with(folder: Path, trials: int | None = None, until: int | None = None) -> Any:
    """The same tuning, resumed."""
    return resume_tune(folder, None, Looking(until).observers(), trials=trials)


def trials_in(folder: Path) -> pl.DataFrame:
    """The table of trials."""
    return pl.read_parquet(folder / "trials.parquet")


@pytest.fixture
def scenario(tmp_path):
    return scenario_in(tmp_path)


@pytest.fixture
def executors(monkeypatch):
    """Tunings of this test need no processes: a second less for each."""
    monkeypatch.setattr(run, "open_executor", lambda *_: InThisProcess())


@pytest.fixture
def calculated(monkeypatch):
    """Tunings of this test run nothing."""
    monkeypatch.setattr(run, "open_executor", lambda *_: Calculating())
