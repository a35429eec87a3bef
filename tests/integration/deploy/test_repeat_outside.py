"""What came into a run from outside (late answers, lost runners) is recorded; the repetition gets the same."""

import subprocess
import sys
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.comms.truth import Truth
from swarmwire.deploy import repeat, run
from swarmwire.deploy.record.folder import RunFolder
from swarmwire.deploy.record.inputs import WITHIN
from swarmwire.metrics.run_folder.layout import INPUTS
from tests.integration.deploy.test_realtime import frames_of, runners_here
from tests.support.deploy.commands import LOSSY
from tests.support.deploy.joiners import Watcher, interrupt

TALKER = """
from swarmwire.agent import Agent, Message, Robot, f4

class Word(Message):
    heading_rad: f4

class Talker(Agent):
    needs = ("compass",)

    def step(self, robot: Robot) -> None:
        words = robot.radio.received(Word)
        robot.note(state="turning" if words else "waiting")
        robot.radio.send(Word(heading_rad=robot.compass.heading_rad))
        robot.drive(0.03, 0.1 * len(words) - 0.2)
"""


def talkers_in(folder: Path) -> list[str]:
    (folder / "talker.py").write_text(TALKER)
    return [f"robots.flock.agent={folder / 'talker.py'}:Talker", "robots.flock.params={}"]


@pytest.fixture
def talkers(tmp_path) -> list[str]:
    return talkers_in(tmp_path)


def still(truth: Truth) -> int:
    """How many robots are told to stand."""
    return int(np.count_nonzero(~truth.command.any(axis=1)))


def kill_one() -> None:
    """As the system does that is out of memory."""
    runners_here()[0].kill()


def freeze() -> None:
    runners_here()[0].suspend()


def thaw() -> None:
    runners_here()[0].resume()


def test_a_run_in_real_time_whose_runner_was_frozen_for_a_while_is_the_same_again(tmp_path, talkers):
    """The watchdog stops its robots, which go on when it does."""
    watcher = Watcher(
        (lambda truth: not still(truth), freeze),
        (lambda truth: still(truth) >= 6, thaw),
        (lambda truth: not still(truth), interrupt),
    )
    setting = [*talkers, "duration_s=500", "run.watchdog_s=0.2"]
    result = run(LOSSY, overrides=setting, runners=3, realtime=5, out=tmp_path / "run", observers=[watcher])
    assert (result.ended, result.lost_runners) == ("interrupted", ())
    assert result.realtime is not None
    assert len(result.realtime.watchdog_stops) >= 6
    assert result.realtime.late_answers or result.realtime.frames_dropped  # of the runner that was frozen
    assert result.inputs is not None
    assert (result.inputs.first_tick, result.inputs.ticks) == (0, result.ticks)
    repetition = repeat(tmp_path / "run", out=tmp_path / "again")
    assert repetition.same
    assert repetition.result.radio == result.radio
    assert repetition.result.inputs == result.inputs
    assert repeat(tmp_path / "again").same
    with pytest.raises(BadInput) as refused:
        repeat(tmp_path / "run", runners=2)
    assert refused.value.where == "--runners"


@pytest.mark.parametrize("realtime", [None, 10])
def test_a_run_that_lost_a_runner_whose_robots_stand_from_then_on_is_the_same_again(tmp_path, talkers, realtime, capfd):
    watcher = Watcher(
        (lambda truth: truth.tick >= 5 and not still(truth), kill_one),
        *[(lambda truth: still(truth) == 5, lambda: None)] * 10,
        (lambda truth: still(truth) == 5, interrupt),
    )
    setting = [*talkers, "duration_s=500", "run.on_runner_loss=dead", "run.watchdog_s=1000"]
    result = run(LOSSY, overrides=setting, runners=4, realtime=realtime, out=tmp_path / "run", observers=[watcher])
    assert (result.ended, result.counts["runners_lost"], len(result.lost_runners)) == ("interrupted", 1, 1)
    assert "(5 robots)" in result.lost_runners[0]
    assert "stand still" in capfd.readouterr().err
    stood = ~watcher.truths[-1].command.any(axis=1)
    assert not watcher.truths[-10].command[stood].any()
    assert result.inputs is not None
    # In lockstep the robots acted by scenario and seed alone until the loss.
    assert (result.inputs.first_tick > 5) is (realtime is None)
    repetition = repeat(tmp_path / "run")
    assert repetition.same
    assert repetition.result.ticks == result.ticks


def test_a_run_whose_lost_runner_was_replaced_by_a_fresh_one_is_the_same_again(tmp_path, talkers, monkeypatch):
    takeovers: list[subprocess.Popen[bytes]] = []

    def take_over(_: RunFolder, text: str) -> None:
        command = text.partition("such as: python ")[2].replace("NAME", "fresh").split()
        if not command:  # it is told, too, that the other came
            return
        takeovers.append(subprocess.Popen([sys.executable, *command], stdin=subprocess.PIPE, stdout=subprocess.PIPE))

    monkeypatch.setattr(RunFolder, "say", take_over)
    setting = [*talkers, "duration_s=1.5", "run.on_runner_loss=wait"]
    watcher = Watcher((lambda truth: truth.tick >= 5, kill_one))
    try:
        result = run(LOSSY, overrides=setting, runners=2, out=tmp_path / "run", observers=[watcher])
    finally:
        for process in takeovers:
            process.communicate()
    assert (len(takeovers), len(result.lost_runners), result.ended) == (1, 1, "duration")
    assert repeat(tmp_path / "run").same


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    """The folder of a run in real time of ten ticks."""
    folder = tmp_path_factory.mktemp("recorded")
    run(LOSSY, overrides=[*talkers_in(folder), "duration_s=1"], runners=2, realtime=20, out=folder / "run")
    return folder / "run"


@pytest.fixture
def in_real_time(recorded, tmp_path) -> Path:
    """A copy, for one test to damage."""
    return copytree(recorded, tmp_path / "run")


def test_the_record_of_a_run_in_real_time_has_each_tick_and_nothing_between(recorded):
    found = frames_of(recorded)
    assert len(found) == 10
    assert not any(WITHIN in frame["arrays"] for frame in found)
    assert repeat(recorded).same


def test_a_record_that_is_cut_off_is_repeated_as_far_as_it_is_whole(in_real_time):
    data = (in_real_time / INPUTS).read_bytes()
    (in_real_time / INPUTS).write_bytes(data[:-10])
    repetition = repeat(in_real_time)
    assert (repetition.before, repetition.compared, repetition.same) == (None, 9, True)
    assert repetition.why_not_all
    assert "9 of the run's 10" in repetition.why_not_all
    assert [change.split()[0] for change in repetition.changes] == [INPUTS]
    (in_real_time / "summary.json").unlink()
    assert repeat(in_real_time).result.ticks == 9


def test_a_record_that_is_missing_or_damaged_is_refused(in_real_time):
    data = bytearray((in_real_time / INPUTS).read_bytes())
    data[10] ^= 0xFF
    (in_real_time / INPUTS).write_bytes(data)
    with pytest.raises(BadInput, match="the actions of a tick"):
        repeat(in_real_time)
    scenario = in_real_time / "scenario.toml"
    data[10] ^= 0xFF
    (in_real_time / INPUTS).write_bytes(data)
    scenario.write_text(scenario.read_text().replace("count = 20", "count = 19"))
    with pytest.raises(BadInput, match="rows: expected robots of 19"):
        repeat(in_real_time)
    (in_real_time / INPUTS).unlink()
    with pytest.raises(BadInput, match="what came from outside"):
        repeat(in_real_time)
