"""An agent for real robots: goes on, and turns away from whatever is near."""

from swarmwire.agent import Agent, Robot


class Shy(Agent):
    """Needs nothing but proximity sensors, so it runs on an e-puck2 as it runs in emulation."""

    needs = ("proximity",)
    speed_mps: float = 0.05
    near: float = 0.2

    def step(self, robot: Robot) -> None:
        """Drive on; turn on the spot while something is near."""
        if robot.proximity.value.max() > self.near:
            robot.drive(0.0, 1.0)
        else:
            robot.drive(self.speed_mps, 0.0)
