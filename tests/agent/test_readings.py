"""Both kinds of agent read the same of every sense; single robots get plain numbers."""

from typing import ClassVar

import numpy as np
import pytest

from swarmwire.agent import Agent, VectorAgent
from swarmwire.agent.testing import Trial, assert_equivalent, assert_rows_independent
from swarmwire.comms.errors import AgentFailed


class Moth(Agent):
    """Drives to the light, away from what it bumped into, and home."""

    needs: ClassVar[tuple[str, ...]] = ("light", "bumper", "positioning")

    def step(self, robot) -> None:
        x, y = robot.light.vector_sum()
        assert type(x) is type(robot.positioning.x_m) is float
        assert type(robot.bumper.pressed) is bool
        assert robot.light.value.shape == robot.light.angle_rad.shape == (8,)
        back = -0.05 if robot.bumper.pressed else 0.01 * x
        robot.drive(back, 0.1 * y + 0.01 * (robot.positioning.x_m - robot.positioning.y_m))


class VectorMoth(VectorAgent):
    """The same rule for n robots."""

    needs: ClassVar[tuple[str, ...]] = ("light", "bumper", "positioning")

    def step(self, robots, state) -> None:
        x, y = robots.light.vector_sum()
        assert robots.light.value.shape == (robots.n, 8)
        assert robots.light.angle_rad.shape == (8,)
        back = np.where(robots.bumper.pressed == 1.0, -0.05, 0.01 * x)
        robots.drive(back, 0.1 * y + 0.01 * (robots.positioning.x_m - robots.positioning.y_m))


def test_one_robot_and_many_read_the_same() -> None:
    assert_equivalent(Moth, VectorMoth, Trial(body="epuck-gps"))
    assert_rows_independent(VectorMoth, Trial(body="epuck-gps"))


@pytest.mark.parametrize("sense", ["light", "bumper", "positioning"])
def test_a_sense_that_is_not_declared_is_refused(sense: str) -> None:
    class Peeks(VectorAgent):
        def step(self, robots, state) -> None:
            getattr(robots, sense)

    with pytest.raises(AgentFailed, match="NotDeclared"):
        assert_rows_independent(Peeks, Trial(body="epuck-gps"))
