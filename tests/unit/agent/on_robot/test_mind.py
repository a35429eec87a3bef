"""What of an agent's deeds a robot has no use for is counted."""

from dataclasses import replace

from swarmwire.agent.on_robot.limits import limits_for
from swarmwire.agent.on_robot.mind import Mind, group_of
from swarmwire.comms.bodies.actuator_sheet import ActuatorSheet
from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.outcomes import NO_OUTCOMES
from swarmwire.comms.packets import Heard
from tests.support.agent.on_robot.scripted import PLAYERS, RATE_HZ


def test_what_is_told_to_actuators_of_the_users_own_is_counted_since_no_driver_moves_them():
    body = replace(load_body("epuck2"), actuators={"arm": ActuatorSheet("a:Arm", {}, 3)})
    group = group_of("robot-0", 0, f"{PLAYERS}:Painting", {}, body, seed=0)
    mind = Mind(group, RATE_HZ, None, limits_for(body, None, None, ""))
    for tick in range(2):
        mind.step(tick, {}, Heard.none(()), NO_OUTCOMES)
    assert mind.actuations == 6
