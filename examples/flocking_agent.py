"""The flocking rule as a user would write it: an Agent that decides for one robot.

Run it with a process per robot, from the project's root:

    mine=../examples/flocking_agent.py:MyFlocking
    swarmwire run scenarios/flocking-lossy.toml --runners per-robot --set robots.flock.agent=$mine

The arithmetic is that of `swarmwire.agent.behaviours:Flocking`, in portable functions, so the swarm moves the same,
bit for bit.
"""

from swarmwire.agent import Agent, Message, Robot, f4, portable


class Heading(Message):
    """What each robot broadcasts in every step."""

    heading_rad: f4


class MyFlocking(Agent):
    """Keep together, apart and aligned with the neighbours that were received; keep away from what is near."""

    needs = ("proximity", "compass", "radio.range", "radio.bearing")
    speed_mps: float = 0.1
    separation_m: float = 0.4
    cohesion: float = 0.6
    alignment: float = 1.0
    avoidance: float = 3.0
    forward: float = 0.3
    turn_gain_per_s: float = 2.0

    def step(self, robot: Robot) -> None:
        """Steer to the sum of all pulls, and broadcast the heading."""
        heading = robot.compass.heading_rad
        packets = robot.radio.received(Heading)
        x = y = 0.0
        for packet in packets:
            pull = min((packet.range_m - self.separation_m) / self.separation_m, 1.0)
            turn = packet.message.heading_rad - heading
            x += self.cohesion * (pull * portable.cos(packet.bearing_rad)) + self.alignment * portable.cos(turn)
            y += self.cohesion * (pull * portable.sin(packet.bearing_rad)) + self.alignment * portable.sin(turn)
        neighbours = max(len(packets), 1)

        near_x, near_y = robot.proximity.vector_sum()
        x = self.forward + x / neighbours - self.avoidance * near_x
        y = y / neighbours - self.avoidance * near_y

        angle = portable.atan2(y, x)
        robot.drive(self.speed_mps * max(portable.cos(angle), 0.0), self.turn_gain_per_s * angle)
        robot.radio.send(Heading(heading_rad=heading))
