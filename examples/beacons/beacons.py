"""Avoidance with beacons: one agent file for each robot that has proximity sensors and a radio.

Run it in simulation, from the project's root; `docs/dev/validation.md` has its results on four kinds of robots:

    swarmwire run examples/beacons/beacons.toml

Proximity sensors see what is near, and nothing else: an e-puck2's reach 5 cm. Beacons make robots keep a larger
distance to one another: each packet brings range and bearing of its sender.
"""

from swarmwire.agent import Agent, Message, Robot, parameter, portable, u4


class Beacon(Message):
    """What each robot broadcasts in every step."""

    number: u4


class Beacons(Agent):
    """Drives straight on, and turns on the spot while an obstacle or the sender of a beacon is ahead and near."""

    needs = ("proximity", "radio.range", "radio.bearing")
    speed_mps: float = 0.08
    turn_radps: float = 1.0
    apart_m: float = parameter(0.6, help="least distance to the sender of a beacon, centre to centre")
    near: float = parameter(0.1, help="threshold of a proximity sensor's answer, 0 to 1; above the noise")

    def __init__(self) -> None:
        self.sent = 0
        self.side = 0.0  # to which it turns: 1 left, -1 right, 0 it drives on

    def step(self, robot: Robot) -> None:
        """Add up what is near, weighted by how near it is; turn away from it if it is ahead."""
        x, y = robot.proximity.vector_sum() if robot.proximity.value.max() > self.near else (0.0, 0.0)
        for packet in robot.radio.received(Beacon):
            weight = max(1.0 - packet.range_m / self.apart_m, 0.0)
            x, y = x + weight * portable.cos(packet.bearing_rad), y + weight * portable.sin(packet.bearing_rad)
        if x <= 0.0:
            self.side = 0.0
        elif not self.side:  # kept until the way is free: in a corner the sides alternate
            self.side = -1.0 if y > 0.0 else 1.0
        robot.drive(0.0 if self.side else self.speed_mps, self.turn_radps * self.side)
        robot.radio.send(Beacon(number=self.sent))
        self.sent += 1
