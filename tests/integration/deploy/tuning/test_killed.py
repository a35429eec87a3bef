"""A tuning in a process of its own that is killed."""

import re
import subprocess
import sys

import psutil
import pytest

from tests.support.deploy.runs import ROOT, called
from tests.support.deploy.tuning import scenario_in, trials_in, tuned

KILLED = """
import sys
from pathlib import Path
from swarmwire.deploy.campaign.sweep import NoObserver
from swarmwire.deploy.controls import Interrupt
from swarmwire.deploy.tuning.run import TuneObservers, begin_tune
from tests.support.deploy.tuning import plan_of
class Watcher:
    def begin(self, tuning, trials): print("begins", flush=True)
    def see(self, trial): print("trial", flush=True)
    def end(self): pass
plan = plan_of(Path(sys.argv[1]), seeds=1, trials=5, parallel_trials=2)
begin_tune(plan, Path(sys.argv[2]), "", 1, TuneObservers(Watcher(), NoObserver(), Interrupt()))
"""


@pytest.fixture
def typed(monkeypatch, capsys, calculated):
    return lambda *arguments: called(monkeypatch, capsys, *arguments)


def test_a_tuning_that_is_killed_leaves_no_worker_and_is_gone_on_with(tmp_path, typed):
    scenario, folder = scenario_in(tmp_path), tmp_path / "t"
    command = [sys.executable, "-c", KILLED, str(scenario), str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        assert process.stdout is not None
        lines = iter(process.stdout)
        assert [next(lines).strip() for _ in range(4)] == ["begins", "trial", "trial", "trial"]
        workers = psutil.Process(process.pid).children(recursive=True)
        assert len(workers) == 1
        process.kill()
        gone, alive = psutil.wait_procs(workers, timeout=60)
    assert (len(gone), alive) == (1, [])
    code, out, _ = typed("tune", "--resume", folder)
    there = re.search(r"5 trials x 1 seeds; (\d) of them are there", out)
    assert code == 0
    assert there is not None
    assert int(there[1]) >= 3
    tuned(scenario, tmp_path / "whole", seeds=1, trials=5, parallel_trials=2)
    assert trials_in(folder).equals(trials_in(tmp_path / "whole"), null_equal=True)
