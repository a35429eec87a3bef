"""Motors: an emergency stop holds, whatever is under way, and nobody believes in one that did not reach the robot."""

import pytest

from swarmwire.agent.drivers.driver import Command, DriverLost
from swarmwire.agent.on_robot.motors import Motors


class Robot:
    """Keeps what it is told; may be out of reach, or be told to stop while a command is on its way."""

    def __init__(self) -> None:
        self.told: list[str] = []
        self.reachable, self.on_act = True, lambda: None

    def act(self, command: Command) -> None:
        self.told.append("act")
        self.on_act()

    def stop(self) -> None:
        if not self.reachable:
            raise DriverLost("nobody answers")
        self.told.append("stop")


def test_nothing_moves_after_an_emergency_stop() -> None:
    robot = Robot()
    motors = Motors(robot)
    motors.act(None)
    motors.control.estop()
    motors.act(None)
    assert robot.told == ["act", "stop"]


def test_a_command_that_an_emergency_stop_overtook_is_followed_by_a_stop() -> None:
    robot = Robot()
    motors = Motors(robot)
    robot.on_act = motors.control.estop
    motors.act(None)
    assert robot.told == ["act", "stop", "stop"]


def test_a_robot_out_of_reach_is_no_reason_to_fail_but_is_not_believed_to_stand() -> None:
    robot = Robot()
    motors = Motors(robot)
    robot.reachable = False
    motors.stop()
    with pytest.raises(DriverLost):
        motors.control.estop()
    assert motors.control.stopped


def test_a_stop_that_was_taken_by_a_robot_that_was_given_up_is_not_believed_either() -> None:
    motors = Motors(Robot())
    motors.reachable = False
    with pytest.raises(DriverLost):
        motors.control.estop()
