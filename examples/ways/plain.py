"""A plain class: what the robot remembers are attributes, what it does is decided from the top in each step.

Right for rules that look at the present. Each `if` is a priority: the first that holds decides.
"""

import numpy as np

from swarmwire.agent import Agent, Message, Robot, f4, parameter


class Call(Message):
    """I am at the lamp."""

    brightness: f4


class Seeker(Agent):
    """Wander until the lamp shines on the robot, then stay and call; come to whoever calls; turn from what is near."""

    needs = ("proximity", "light", "radio.bearing")
    speed_mps: float = 0.1
    turn_radps: float = 2.0
    safe_m: float = parameter(0.03, help="distance to the front below which an object blocks")
    bright: float = parameter(1.2, help="sum over the light sensors at which the robot is at the lamp")
    patience_s: float = parameter(3.0, help="time for which a call is followed")

    def __init__(self) -> None:
        self.side = 0.0  # to which it turns from what is in the way: 1 left, -1 right, 0 it does not
        self.call_rad = 0.0  # where the last call came from
        self.called_until_s = 0.0

    def step(self, robot: Robot) -> None:
        """Listen, then do what comes first."""
        for packet in robot.radio.received(Call):
            self.call_rad, self.called_until_s = packet.bearing_rad, robot.time_s + self.patience_s

        self.side = side_from_obstacle(robot, self.safe_m, self.side)
        brightness = float(np.sum(robot.light.value))
        if brightness > self.bright:
            robot.note("calls")
            self.side = 0.0
            robot.drive(0.0, 0.0)
            robot.radio.send(Call(brightness=brightness))
        elif self.side:
            robot.note("turns away")
            robot.drive(0.0, self.side * self.turn_radps)
        elif robot.time_s < self.called_until_s:
            robot.note("comes")
            robot.drive(self.speed_mps, self.call_rad)
            self.call_rad -= self.call_rad * robot.period_s  # it turns that way meanwhile
        else:
            robot.note("wanders")
            robot.drive(self.speed_mps, robot.draw.normal("wander"))


def side_from_obstacle(robot: Robot, safe_m: float, side: float) -> float:
    """The side away from what is nearest ahead, kept until the way is free, then 0."""
    rays = robot.proximity
    ahead = np.abs(rays.angle_rad) < 1.0
    distance = np.where(ahead, rays.distance_m, np.inf)
    nearest = int(np.argmin(distance))
    if distance[nearest] > safe_m:
        return 0.0
    return side or (-1.0 if rays.angle_rad[nearest] > 0.0 else 1.0)
