import pytest

from swarmwire.agent.drivers.epuck2.driver import Epuck2Driver
from swarmwire.agent.drivers.epuck2.options import Epuck2Options
from swarmwire.agent.on_robot.robot_lock import STOPPED, RobotLock
from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.errors import BadInput
from tests.agent.on_robot.scripted import DatedFakeClock, ScriptedDriver


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
