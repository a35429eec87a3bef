"""Worker processes of campaigns: what they do is the same, and they die, freeze, and end with their campaign."""

import subprocess
import sys
from contextlib import closing

import psutil
import pytest

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.errors import SwarmwireError
from swarmwire.deploy import resume, sweep
from swarmwire.deploy.campaigns import local
from swarmwire.deploy.campaigns.local import LocalExecutor, Silence
from swarmwire.deploy.campaigns.schedule import execute
from swarmwire.deploy.campaigns.worker import Task
from tests.support.clocks import FakeClock, until
from tests.support.deploy.campaign import rows_in, scenario_in, series_in
from tests.support.deploy.runs import ROOT

VARY = {"radio.loss": [0.0, 0.5]}
DEADLY = 2  # one of the seeds that stumble


def same(folder, reference):
    """The same rows and series."""
    assert rows_in(folder) == rows_in(reference)
    assert series_in(folder).equals(series_in(reference), null_equal=True)


def tasks_of(scenario, *seeds, overrides=()):
    return [Task(str(scenario), overrides, 0, (seed,), (seed,)) for seed in seeds]


def executed(tasks, workers=1):
    """The rows of tasks that worker processes have done."""
    rows = []
    with closing(LocalExecutor(workers)) as executor:
        assert execute(tasks, executor, lambda _, result: rows.extend(result.rows))
    return rows


def test_worker_that_dies_is_replaced_and_its_deadly_seed_is_a_failed_row(stumbling):
    rows = executed(tasks_of(stumbling, 1, DEADLY, 4, overrides=('robots.pair.params.how="kill"',)))
    assert [(row["seed"], row["ended"]) for row in rows] == [(1, "duration"), (DEADLY, "failed"), (4, "duration")]
    assert "signal 9" in rows[1].pop("error")
    assert rows[1] == {"run": 2, "point": 0, "seed": DEADLY, "ended": "failed"}


def test_agent_that_asks_for_input_gets_none_and_takes_no_task(scenario):
    agent = "from swarmwire.agent import Agent\nclass Asking(Agent):\n    def step(self, robot): input('go on? ')\n"
    (scenario.parent / "asking.py").write_text(agent)
    rows = executed(tasks_of(scenario, 1, 2, overrides=('robots.pair.agent="asking.py:Asking"',)))
    assert [row["ended"] for row in rows] == ["failed", "failed"]
    assert "EOFError" in rows[0]["error"]


def test_workers_that_cannot_start_are_one_line(scenario, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with pytest.raises(SwarmwireError, match="exit code 1"):
        executed(tasks_of(scenario, 1, 2), workers=2)


FROZEN = """
import os, signal
from pathlib import Path
from swarmwire.agent import Agent
class Frozen(Agent):
    always: bool = False
    def step(self, robot):
        before = Path(__file__).with_name("before")
        if self.always or not before.exists():
            before.touch()
            os.kill(os.getpid(), signal.SIGSTOP)
"""


class WhileFrozen(FakeClock):
    """A clock that goes on by a second with each look while a child of this process is frozen."""

    def now_ns(self) -> int:
        if any(child.status() == psutil.STATUS_STOPPED for child in psutil.Process().children()):
            self.time_ns += NS_PER_S
        return self.time_ns


@pytest.mark.parametrize(("always", "ended"), [(False, "duration"), (True, "failed")])
def test_worker_that_is_frozen_is_ended_and_its_runs_are_done_by_another(scenario, monkeypatch, always, ended):
    monkeypatch.setattr(local, "Silence", lambda: Silence(WhileFrozen(), max_s=2.0))
    (scenario.parent / "frozen.py").write_text(FROZEN)
    agent = ('robots.pair.agent="frozen.py:Frozen"', f"robots.pair.params.always={str(always).lower()}")
    rows = executed(tasks_of(scenario, 1, overrides=agent))
    assert [row["ended"] for row in rows] == [ended]
    if always:
        assert rows[0]["error"] == "the worker stood still for 2 s"
    else:
        assert rows[0]["machine_worker"] == "local-1"


KILLED = """
import sys
from swarmwire.deploy import sweep
class Watcher:
    def begin(self, campaign, done, failed): print("begins", flush=True)
    def see(self, result): print("task", flush=True)
    def end(self): pass
vary = {sys.argv[3]: [float(value) for value in sys.argv[4:]]}
sweep(sys.argv[1], seeds=4, vary=vary, batch=1, workers=1, out=sys.argv[2], observer=Watcher())
"""


def test_campaign_that_is_killed_leaves_no_worker_and_can_be_resumed(tmp_path, executors):
    scenario, folder = scenario_in(tmp_path), tmp_path / "c"
    command = [sys.executable, "-c", KILLED, str(scenario), str(folder), "radio.loss", "0.0", "0.5"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        assert process.stdout is not None
        lines = iter(process.stdout)
        assert [next(lines).strip() for _ in range(3)] == ["begins", "task", "task"]
        workers = psutil.Process(process.pid).children(recursive=True)
        assert len(workers) == 1
        process.kill()
        ended, alive = psutil.wait_procs(workers, timeout=60)
    assert (len(ended), alive) == (1, [])
    rows = rows_in(folder)
    assert 2 <= len(rows) <= 8
    assert resume(folder).is_over
    sweep(scenario, seeds=4, vary=VARY, out=tmp_path / "whole")
    same(folder, tmp_path / "whole")


def test_worker_ends_with_its_campaign_also_in_the_middle_of_a_run(tmp_path):
    """Of runs of half a second, and of a day, which would take minutes."""
    arguments = (str(scenario_in(tmp_path)), str(tmp_path / "c"), "duration_s", "0.5", "100000.0")
    command = [sys.executable, "-c", KILLED, *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        try:
            assert process.stdout is not None
            lines = iter(process.stdout)
            assert [next(lines).strip() for _ in range(5)] == ["begins", *["task"] * 4]
            [worker] = psutil.Process(process.pid).children(recursive=True)
            busy_s = worker.cpu_times().user + 0.2
            until(lambda: worker.cpu_times().user > busy_s)
        finally:
            process.kill()
        alive = psutil.wait_procs([worker], timeout=20)[1]
        for one in alive:
            one.kill()
        assert alive == []
