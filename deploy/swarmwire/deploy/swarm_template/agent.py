"""What one robot of this swarm tells the others, and what it does in each step."""

import math

from swarmwire.agent import Agent, Message, Robot, f4


class Hello(Message):
    """What a robot broadcasts in every step: 2 bytes for its kind and 4 for the heading go on air."""

    heading_rad: f4  # of its compass


class Companion(Agent):
    """Goes where its neighbours go, and keeps away from whoever or whatever is near.

    It knows only what its robot senses and hears. Annotated attributes are its parameters: a scenario sets them, and
    `swarmwire describe agent.py:Companion` lists them.
    """

    needs = ("proximity", "compass", "radio.range", "radio.bearing")
    speed_mps: float = 0.08  # straight ahead
    safe_m: float = 0.3  # it turns away from neighbours that are nearer than this
    avoidance: float = 3.0  # weight of the proximity rays
    turn_gain_per_s: float = 2.0  # turn rate per angle to the wanted direction

    def step(self, robot: Robot) -> None:
        """Called once a tick: listen, look, drive, and tell the others."""
        heading_rad = robot.compass.heading_rad
        x, y = 0.5, 0.0  # the wanted direction, seen from the robot: x is ahead, y to the left
        for packet in robot.radio.received(Hello):  # what got through since the last step, and no more
            turn_rad = packet.message.heading_rad - heading_rad
            x += math.cos(turn_rad)
            y += math.sin(turn_rad)
            if packet.range_m < self.safe_m:
                x -= 2.0 * math.cos(packet.bearing_rad)
                y -= 2.0 * math.sin(packet.bearing_rad)
        near_x, near_y = robot.proximity.vector_sum()
        angle_rad = math.atan2(y - self.avoidance * near_y, x - self.avoidance * near_x)

        linear_mps = self.speed_mps * max(math.cos(angle_rad), 0.0)  # slower, the more it has to turn
        robot.drive(linear_mps=linear_mps, angular_radps=self.turn_gain_per_s * angle_rad)
        robot.radio.send(Hello(heading_rad=heading_rad))
