"""Robots that stand: what they do is their program's affair."""

from swarmwire.agent import Agent, Robot


class Standing(Agent):
    def step(self, robot: Robot) -> None:
        robot.drive(0.0, 0.0)
