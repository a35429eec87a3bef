"""Robots that find a gas leak by run and tumble, as bacteria find food, and seal it together."""

from swarmwire.agent import Agent, Robot


class Seeker(Agent):
    """Straight on while it smells stronger, and turning while it does not; at the leak, stand and seal it."""

    needs = ("gas", "proximity")
    speed_mps: float = 0.08
    turn_radps: float = 2.0
    # concentration at which the leak is near enough to be sealed, and below which it is sealed
    near: float = 0.8
    gone: float = 0.02

    def __init__(self) -> None:
        self.before = 0.0
        self.sealing = False

    def step(self, robot: Robot) -> None:
        """Compare with the step before."""
        smelled = robot.sensor("gas").concentration
        x, y = robot.proximity.vector_sum()
        self.sealing = smelled >= (self.gone if self.sealing else self.near)
        if self.sealing:
            robot.drive(0.0, 0.0)
            robot.actuate("sealer", 1.0)
            robot.note("sealing")
        elif x > 0.1:
            robot.drive(0.0, -self.turn_radps if y > 0.0 else self.turn_radps)
            robot.note("avoiding")
        elif smelled > self.before:
            robot.drive(self.speed_mps, 0.0)
            robot.note("running")
        else:
            robot.drive(0.5 * self.speed_mps, robot.draw.uniform("tumble", 0.0, self.turn_radps))
            robot.note("tumbling")
        self.before += 0.3 * (smelled - self.before)
