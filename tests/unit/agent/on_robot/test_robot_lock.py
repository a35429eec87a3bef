import signal

import pytest

from swarmwire.agent.drivers.epuck2.driver import Epuck2Driver, Epuck2Options
from swarmwire.agent.on_robot.robot_lock import OUT_OF_REACH, STOP_SIGNAL, STOPPED, NotStopped, RobotLock
from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.errors import BadInput
from tests.support.agent.on_robot.scripted import DatedFakeClock, ScriptedDriver


def _epuck2(address: str) -> Epuck2Driver:
    return Epuck2Driver(address, load_body("epuck2"), Epuck2Options(), DatedFakeClock())


def test_an_address_with_the_usual_port_is_the_same_robot_as_without():
    assert _epuck2("10.0.0.1").target == _epuck2("10.0.0.1:1000").target != _epuck2("10.0.0.1:1001").target


def test_one_holds_it_at_a_time_and_nobody_once_it_is_let_go(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    clock = DatedFakeClock()
    first, second = (RobotLock("scripted", ScriptedDriver(clock), clock) for _ in range(2))
    assert second.stopped_by_holder() is None
    with first.held("robot.toml"):
        first.tell(STOPPED)
        with pytest.raises(BadInput, match="the robot at nowhere is driven by process"), second.held("robot.toml"):
            pass
    with second.held("robot.toml"):
        pass


def test_what_a_dead_agent_left_behind_is_not_asked(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    clock = DatedFakeClock()
    first, second = (RobotLock("scripted", ScriptedDriver(clock), clock) for _ in range(2))
    with first.held("robot.toml"):
        next((tmp_path / "swarmwire").iterdir()).write_text("99999999\n")  # no process has this number
        assert second.stopped_by_holder() is None


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        (OUT_OF_REACH, "cannot reach the robot at nowhere, and stops it as soon as it can"),
        ("", "drives the robot at nowhere, and did not say within 2 s that it stopped it"),
    ],
)
def test_a_holder_that_does_not_say_that_it_stopped_the_robot_is_told_of(tmp_path, monkeypatch, told, expected):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    clock, asked = DatedFakeClock(), []
    first, second = (RobotLock("scripted", ScriptedDriver(clock), clock) for _ in range(2))
    before = signal.signal(STOP_SIGNAL, lambda *_: asked.append(True))
    try:
        with first.held("robot.toml"):
            first.tell(told)
            with pytest.raises(NotStopped, match=expected):
                second.stopped_by_holder()
    finally:
        signal.signal(STOP_SIGNAL, before)
    assert asked == [True]  # once, not in every round


@pytest.mark.parametrize("words", ["", "somebody\n", "\xff\xfe"])
def test_a_lock_that_names_nobody_holds_up_nobody(tmp_path, monkeypatch, words):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    clock = DatedFakeClock()
    first, second = (RobotLock("scripted", ScriptedDriver(clock), clock) for _ in range(2))
    with first.held("robot.toml"):
        next((tmp_path / "swarmwire").iterdir()).write_bytes(words.encode("latin-1"))
        assert second.stopped_by_holder() is None


def test_a_folder_for_locks_must_be_one_of_ones_own(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    (tmp_path / "swarmwire").symlink_to(tmp_path)
    clock = DatedFakeClock()
    with pytest.raises(BadInput, match="expected a folder of this user's own"):
        RobotLock("scripted", ScriptedDriver(clock), clock)
    (tmp_path / "swarmwire").unlink()
    (tmp_path / "swarmwire").write_text("no folder")
    with pytest.raises(BadInput, match="expected a folder for locks of robots"):
        RobotLock("scripted", ScriptedDriver(clock), clock)
