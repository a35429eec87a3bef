"""The point-particle model: straight to the target, no further, and in sight of nothing but the light."""

import numpy as np
import pytest

from swarmwire.agent.behaviours import PsoModel
from tests.support.agent.behaviours.one_particle import HERE, One

SPEED_MPS, PERIOD_S = 0.1, 0.1


@pytest.mark.parametrize("heading_rad", [0.0, 2.0, -2.0])
def test_a_particle_flies_straight_to_its_target_whatever_its_heading(heading_rad: float) -> None:
    one = One(PsoModel)
    one.step()
    one.heading_rad = heading_rad
    actions = one.step()
    forward, left = actions.linear_mps[0], actions.lateral_mps[0]
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    x, y = one.vector("target")
    away_m = np.hypot(x, y)
    assert (forward * cos - left * sin, forward * sin + left * cos) == pytest.approx(
        (SPEED_MPS * x / away_m, SPEED_MPS * y / away_m)
    )
    assert actions.angular_radps[0] == 0.0


def test_a_particle_stops_at_its_target() -> None:
    one = One(PsoModel)
    one.step()
    x, y = one.vector("target")
    away_m = np.hypot(x, y)
    short_m = 0.4 * SPEED_MPS * PERIOD_S
    one.place = (HERE[0] + x * (1.0 - short_m / away_m), HERE[1] + y * (1.0 - short_m / away_m))
    actions = one.step()
    assert np.hypot(actions.linear_mps[0], actions.lateral_mps[0]) * PERIOD_S == pytest.approx(short_m)
    one.place = (HERE[0] + x, HERE[1] + y)
    assert one.step().linear_mps[0] == pytest.approx(0.0, abs=1e-9)


def test_a_particle_does_not_avoid_anything() -> None:
    free, blocked = One(PsoModel), One(PsoModel)
    blocked.rays[:] = 1.0
    for _ in range(3):
        one, other = free.step(), blocked.step()
        assert one.linear_mps[0] == other.linear_mps[0]
