"""Runs in real time and runs that survive a lost runner, over real processes: what happens, in no set time."""

import signal
from collections.abc import Callable

import numpy as np
import psutil
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.comms.truth import Static, Tally, Truth
from swarmwire.deploy import run
from tests.support.deploy.commands import LOSSY, swarmwire

STEADY = """
from swarmwire.agent import Robots, State, VectorAgent

class Steady(VectorAgent):
    def step(self, robots: Robots, state: State) -> None:
        robots.drive(0.02, 0.5)
"""


@pytest.fixture
def steady(tmp_path):
    (tmp_path / "steady.py").write_text(STEADY)
    return [f"robots.flock.agent={tmp_path / 'steady.py'}:Steady", "robots.flock.params={}"]


def runners_here() -> list[psutil.Process]:
    return [runner for nursery in psutil.Process().children() for runner in nursery.children()]


class Watcher:
    """An observer that goes from one act to the next as soon as what it waits for is true."""

    def __init__(self, *steps: tuple[Callable[[Truth], bool], Callable[[], object]]) -> None:
        self.steps = list(steps)
        self.truths: list[Truth] = []

    def begin(self, static: Static) -> None:
        """Nothing yet."""

    def see(self, truth: Truth) -> None:
        self.truths.append(truth)
        if self.steps and self.steps[0][0](truth):
            self.steps.pop(0)[1]()

    def end(self, last: Tally | None) -> dict[str, object]:
        return {}


def still(truth: Truth) -> int:
    """How many robots are told to stand."""
    return int(np.count_nonzero(~truth.command.any(axis=1)))


def test_a_run_in_real_time_ends_and_its_fates_add_up():
    result = run(LOSSY, overrides=["duration_s=4"], runners=4, realtime=20)
    assert (result.mode, result.ended, result.ticks) == ("realtime", "duration", 40)
    assert result.wall_time_s >= 4 / 20
    assert result.radio is not None
    assert sum(result.radio.fates.values()) == result.radio.intended
    assert result.radio.fates["heard"] > 0
    assert result.realtime is not None
    assert result.realtime.factor == 20
    summary = result.summary()["realtime"]
    assert {"factor", "late_answers", "missed_ticks", "worst_lag_s", "frames_dropped", "watchdog_stops"} <= set(summary)


def test_agents_in_this_process_are_paced_too_and_do_the_same():
    short = ["duration_s=2"]
    result = run(LOSSY, overrides=short, realtime=10)
    assert result.mode == "realtime"
    assert result.wall_time_s >= 0.2
    assert result.trajectory_sha256 == run(LOSSY, overrides=short).trajectory_sha256


def test_a_machine_that_cannot_keep_up_says_so_at_once_and_in_the_summary(capfd):
    result = run(LOSSY, overrides=["duration_s=2"], realtime=1e6)
    assert result.realtime is not None
    assert result.realtime.missed_ticks == 20
    assert result.realtime.worst_lag_s > 0
    assert "does not keep up with 1e+06 x real time" in capfd.readouterr().err


def test_a_frozen_runners_robots_stop_and_go_on_when_it_does(steady):
    frozen: list[psutil.Process] = []

    def freeze() -> None:
        frozen.append(runners_here()[0])
        frozen[0].suspend()

    watcher = Watcher(
        (lambda truth: not still(truth), freeze),
        (lambda truth: still(truth) >= 5, lambda: [process.resume() for process in frozen]),
        (lambda truth: not still(truth), lambda: signal.raise_signal(signal.SIGINT)),
    )
    result = run(LOSSY, overrides=[*steady, "duration_s=500"], runners=4, realtime=5, observers=[watcher])
    assert result.ended == "interrupted"
    assert result.realtime is not None
    stops = result.realtime.watchdog_stops
    assert len(stops) >= 5
    # Five ticks or more went by without an answer from it: each came late or was passed over.
    assert result.realtime.frames_dropped + max(result.realtime.late_answers.values(), default=0) >= 4
    assert not result.lost_runners


@pytest.mark.parametrize("realtime", [None, 10])
def test_robots_of_a_runner_that_is_killed_stand_still_if_the_scenario_says_so(steady, realtime, capfd):
    watcher = Watcher(
        (lambda truth: not still(truth), lambda: [runner.kill() for runner in runners_here()[:1]]),
        *[(lambda truth: still(truth) == 5, lambda: None)] * 20,
        (lambda truth: still(truth) == 5, lambda: signal.raise_signal(signal.SIGINT)),
    )
    setting = [*steady, "duration_s=500", "run.on_runner_loss=dead", "run.watchdog_s=1000"]
    result = run(LOSSY, overrides=setting, runners=4, realtime=realtime, observers=[watcher])
    assert result.ended == "interrupted"
    assert result.counts["runners_lost"] == 1
    assert len(result.lost_runners) == 1
    assert "(5 robots)" in result.lost_runners[0]
    assert "its robots stand still" in capfd.readouterr().err
    stood = ~watcher.truths[-1].command.any(axis=1)
    assert not watcher.truths[-20].command[stood].any()


@pytest.mark.parametrize("factor", [0, -1, float("nan"), float("inf"), "fast"])
def test_a_factor_that_cannot_be_is_refused(factor):
    with pytest.raises(BadInput, match="expected a factor above 0"):
        run(LOSSY, realtime=factor)


def test_a_watchdog_that_cannot_be_is_refused():
    with pytest.raises(BadInput, match=r"run.watchdog_s: expected a number above 0"):
        run(LOSSY, overrides=["run.watchdog_s=0"], realtime=1)


@pytest.mark.parametrize("arguments", [["--realtime"], ["--realtime", "20"], ["--realtime=20"]])
def test_the_factor_may_be_left_out(arguments, tmp_path):
    ended = swarmwire("run", *arguments, LOSSY, "--set", "duration_s=0.3", "--out", tmp_path / "run")
    assert ended.returncode == 0
    assert f"x {20 if '20' in arguments[-1] else 1}; " in ended.stdout


def test_the_command_refuses_a_factor_in_one_line(tmp_path):
    for arguments in (["--realtime", "0"], ["--realtime", "-2"], ["--realtime=fast"]):
        ended = swarmwire("run", LOSSY, *arguments, cwd=tmp_path)
        assert (ended.returncode, ended.stdout, ended.stderr.count("\n")) == (2, "", 1)
        assert "--realtime: expected a factor above 0" in ended.stderr
