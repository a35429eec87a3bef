"""An agent for the robots of `hall.toml`: it drives straight ahead and greets all the time."""

from swarmwire.agent import Agent, Message, Robot, u4


class Greeting(Message):
    """A numbered greeting."""

    number: u4


class Apart(Agent):
    """Drives straight ahead, and sends a greeting in each step."""

    def __init__(self, speed_mps: float = 0.06) -> None:
        self.speed_mps, self.number = speed_mps, 0

    def step(self, robot: Robot) -> None:
        robot.drive(self.speed_mps, 0.0)
        robot.radio.send(Greeting(number=self.number))
        self.number += 1
