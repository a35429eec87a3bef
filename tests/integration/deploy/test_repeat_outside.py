"""What came into a run from outside (late answers, lost runners, Ctrl-C) is recorded; the repetition gets the same."""

import signal
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import psutil
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.comms.outcomes import NO_OUTCOMES, Outcomes
from swarmwire.comms.packets import Heard
from swarmwire.comms.senses import Actions, Senses
from swarmwire.deploy import repeat, run
from swarmwire.deploy.record.inputs import RecordedCrew
from swarmwire.deploy.record.run_record import RunRecord
from swarmwire.metrics.record.names import INPUTS
from tests.integration.deploy.test_realtime import Watcher, runners_here, still
from tests.support.deploy.commands import LOSSY

TALKER = """
from swarmwire.agent import Agent, Message, Robot, f4

class Word(Message):
    heading_rad: f4

class Talker(Agent):
    needs = ("compass",)

    def step(self, robot: Robot) -> None:
        words = robot.radio.heard(Word)
        robot.note(state="turning" if words else "waiting")
        robot.radio.send(Word(heading_rad=robot.compass.heading_rad))
        robot.drive(0.03, 0.1 * len(words) - 0.2)
"""


@pytest.fixture
def talkers(tmp_path) -> list[str]:
    (tmp_path / "talker.py").write_text(TALKER)
    return [f"robots.flock.agent={tmp_path / 'talker.py'}:Talker", "robots.flock.params={}"]


def interrupt() -> None:
    signal.raise_signal(signal.SIGINT)


def killed(runner: psutil.Process) -> None:
    runner.kill()


def recorded_ticks(folder: Path) -> int:
    data, ticks = (folder / INPUTS).read_bytes(), 0
    while data:
        data, ticks = data[4 + struct.unpack("<I", data[:4])[0] :], ticks + 1
    return ticks


def test_an_interrupted_run_is_repeated_as_far_as_it_came(tmp_path):
    watcher = Watcher((lambda truth: truth.tick == 12, interrupt))
    result = run(LOSSY, overrides=["duration_s=500"], out=tmp_path / "run", observers=[watcher])
    assert (result.ended, result.ticks) == ("interrupted", 13)
    repetition = repeat(tmp_path / "run")
    assert repetition.same
    assert repetition.result.ticks == 13


def test_a_run_in_real_time_with_late_answers_is_the_same_again(tmp_path, talkers):
    def freeze() -> None:
        runners_here()[0].suspend()

    def thaw() -> None:
        runners_here()[0].resume()

    watcher = Watcher(
        (lambda truth: truth.tick >= 3, freeze),
        (lambda truth: truth.tick >= 6, thaw),
        (lambda truth: truth.tick >= 40, interrupt),
    )
    setting = [*talkers, "duration_s=500", "run.watchdog_s=0.2"]
    result = run(LOSSY, overrides=setting, runners=3, realtime=5, out=tmp_path / "run", observers=[watcher])
    assert result.realtime is not None
    assert result.realtime.late_answers or result.realtime.frames_dropped  # of the runner that was frozen
    assert result.inputs is not None
    assert (result.inputs.first_tick, result.inputs.ticks) == (0, result.ticks)
    repetition = repeat(tmp_path / "run", out=tmp_path / "again")
    assert repetition.same
    assert repetition.result.radio == result.radio
    assert repetition.result.inputs == result.inputs
    assert repeat(tmp_path / "again").same
    with pytest.raises(BadInput, match="says what the runners did"):
        repeat(tmp_path / "run", runners=2)


@pytest.mark.parametrize("realtime", [None, 10])
def test_a_run_that_lost_a_runner_is_the_same_again(tmp_path, talkers, realtime):
    watcher = Watcher(
        (lambda truth: truth.tick >= 5, lambda: killed(runners_here()[0])),
        *[(lambda truth: still(truth) == 5, lambda: None)] * 10,
        (lambda truth: still(truth) == 5, interrupt),
    )
    setting = [*talkers, "duration_s=500", "run.on_runner_loss=dead", "run.watchdog_s=1000"]
    result = run(LOSSY, overrides=setting, runners=4, realtime=realtime, out=tmp_path / "run", observers=[watcher])
    assert len(result.lost_runners) == 1
    assert result.inputs is not None
    # In lockstep the robots acted by scenario and seed alone until the loss.
    assert (result.inputs.first_tick > 5) is (realtime is None)
    repetition = repeat(tmp_path / "run")
    assert repetition.same
    assert repetition.result.ticks == result.ticks


def test_a_run_whose_lost_runner_was_replaced_by_a_fresh_one_is_the_same_again(tmp_path, talkers, monkeypatch):
    takeovers: list[subprocess.Popen[bytes]] = []

    def take_over(_: RunRecord, text: str) -> None:
        command = text.partition("such as: python ")[2].replace("NAME", "fresh").split()
        if not command:  # it is told, too, that the other came
            return
        takeovers.append(subprocess.Popen([sys.executable, *command], stdin=subprocess.PIPE, stdout=subprocess.PIPE))

    monkeypatch.setattr(RunRecord, "say", take_over)
    setting = [*talkers, "duration_s=1.5", "run.on_runner_loss=wait"]
    watcher = Watcher((lambda truth: truth.tick >= 5, lambda: killed(runners_here()[0])))
    try:
        result = run(LOSSY, overrides=setting, runners=2, out=tmp_path / "run", observers=[watcher])
    finally:
        for process in takeovers:
            process.communicate()
    assert (len(takeovers), len(result.lost_runners), result.ended) == (1, 1, "duration")
    assert repeat(tmp_path / "run").same


def test_a_lockstep_run_that_may_lose_runners_but_lost_none_needs_no_record(tmp_path, talkers):
    setting = [*talkers, "duration_s=1", "run.on_runner_loss=dead"]
    assert run(LOSSY, overrides=setting, runners=2, out=tmp_path / "run").inputs is None
    assert repeat(tmp_path / "run", runners=2).same


@pytest.fixture
def in_real_time(tmp_path, talkers) -> Path:
    run(LOSSY, overrides=[*talkers, "duration_s=1"], runners=2, realtime=20, out=tmp_path / "run")
    return tmp_path / "run"


def test_a_record_that_is_cut_off_is_repeated_as_far_as_it_is_whole(in_real_time):
    data = (in_real_time / INPUTS).read_bytes()
    (in_real_time / INPUTS).write_bytes(data[:-10])
    repetition = repeat(in_real_time)
    assert (repetition.before, repetition.compared, repetition.same) == (None, 9, True)
    assert repetition.why_not_all == "this is 9 of the run's 10 ticks"
    assert repetition.changes == (f"{INPUTS} is not as the run left it: its sha256 differs",)
    (in_real_time / "summary.json").unlink()
    assert repeat(in_real_time).result.ticks == 9


def test_a_record_that_is_missing_or_damaged_is_refused(in_real_time):
    data = bytearray((in_real_time / INPUTS).read_bytes())
    data[10] ^= 0xFF
    (in_real_time / INPUTS).write_bytes(data)
    with pytest.raises(BadInput, match="expected the actions of a tick"):
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


def test_the_record_of_a_run_in_real_time_has_each_tick(in_real_time):
    assert recorded_ticks(in_real_time) == 10


class Standing:
    """A crew whose robot stands."""

    def start(self) -> None: ...

    def act(self, tick: int, senses: Senses, heard: Heard, outcomes: Outcomes) -> Actions:
        return Actions(np.zeros(1, np.int64), np.ones(1, np.bool_), *np.zeros((3, 1)))

    def counts(self) -> dict[str, int]:
        return {}

    def close(self) -> None: ...


def test_a_record_that_cannot_be_written_does_not_end_the_run_and_is_counted(tmp_path):
    (tmp_path / "inputs").write_text("in the way")
    crew = RecordedCrew(Standing(), tmp_path, lambda tick: tick >= 2)
    for tick in range(5):
        crew.act(tick, {}, Heard.none(), NO_OUTCOMES)
    record = crew.record()
    assert record is not None
    assert (record.first_tick, record.ticks, record.ticks_not_recorded) == (2, 0, 3)
