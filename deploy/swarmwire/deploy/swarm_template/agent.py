"""The code of one robot: its message and its step."""

import math

from swarmwire.agent import Agent, Message, Robot, f4, parameter


class Hello(Message):
    """The broadcast of every step: on air, 2 bytes for its kind and 4 for the heading."""

    heading_rad: f4  # heading by the compass


class Companion(Agent):
    """Steers by the headings of its neighbours, and away from near robots and obstacles.

    It can read its own sensors and the packets that it received. Annotated attributes are parameters: a scenario sets
    them, and `swarmwire describe agent.py:Companion` lists them.
    """

    needs = ("proximity", "compass", "radio.range", "radio.bearing")
    speed_mps: float = parameter(0.08, help="straight ahead")
    safe_m: float = parameter(0.3, help="distance of a neighbour below which it turns away", at_least=0.0)
    avoidance: float = parameter(3.0, help="weight of the proximity rays")
    turn_gain_per_s: float = parameter(2.0, help="turn rate per angle to the desired direction")

    def step(self, robot: Robot) -> None:
        """Called once a tick: read packets and sensors, drive, and broadcast."""
        heading_rad = robot.compass.heading_rad
        x, y = 0.5, 0.0  # desired direction, seen from the robot: x is ahead, y to the left
        for packet in robot.radio.received(Hello):  # received since the last step
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
