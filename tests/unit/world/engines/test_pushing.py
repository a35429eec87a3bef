"""Pushing is symmetric, and drives do with contacts what their motors can."""

import numpy as np
import pytest

from swarmwire.comms.arrays import FloatArray
from tests.support.world.engines.conformance import FLOOR, Make, R, asked, made

pytestmark = pytest.mark.parametrize("make", FLOOR)


def pushed(make: Make, aside_m: float, braked: bool, mirror: tuple[int, int], swapped: bool) -> FloatArray:
    """Poses of a robot and of one that it pushes, mirrored and swapped back: (ticks, 2, 2) x, y."""
    x, y = mirror
    poses = [[0.0, y * aside_m, 0.0 if x > 0 else np.pi], [x * (2.0 * R + 0.03), 0.0, 0.0]]
    order = [1, 0] if swapped else [0, 1]
    engine = made(make, [poses[i] for i in order])
    engine.braked[0, order.index(1)] = braked
    way: list[FloatArray] = []
    for _ in range(25):
        engine.tick(asked(engine, np.array([0.2, 0.0])[order]))
        way.append(engine.state[0, order, :2] * [x, y])
    return np.array(way)


@pytest.mark.parametrize("braked", [True, False])
@pytest.mark.parametrize("aside_m", [0.0, 0.02, 0.06])
def test_pushing_is_the_same_mirrored_and_with_robots_in_another_order(
    make: Make, aside_m: float, braked: bool
) -> None:
    as_it_is = pushed(make, aside_m, braked, (1, 1), False)
    assert as_it_is[-1, 1, 0] > 2.0 * R + 0.05
    for mirror in ((-1, 1), (1, -1), (-1, -1)):
        assert pushed(make, aside_m, braked, mirror, False) == pytest.approx(as_it_is, abs=1e-6)
    assert pushed(make, aside_m, braked, (1, 1), True) == pytest.approx(as_it_is, abs=1e-6)


@pytest.mark.parametrize("heading", [0.0, 0.7, np.pi / 2, 3.0])
def test_equals_head_on_stay_where_they_met(make: Make, heading: float) -> None:
    along = np.array([np.cos(heading), np.sin(heading)])
    places = [[*(-0.15 * along), heading], [*(0.15 * along), heading + np.pi]]
    engine = made(make, places)
    for _ in range(60):
        engine.tick(asked(engine, 0.2))
    assert engine.state[0, :, :2].mean(axis=0) == pytest.approx([0.0, 0.0], abs=1e-4)
    assert np.abs(engine.state[0, :, 3:5]).max() < 0.01


def test_the_stronger_wins(make: Make) -> None:
    places = [[-0.15, 0.0, 0.0], [0.15, 0.0, np.pi]]
    engine = made(make, places, max_force_n=[3.0, 1.0], steps=50)
    for _ in range(50):
        engine.tick(asked(engine, 0.2))
    assert engine.state[0, :, 0].mean() > 0.2


def test_a_fast_crowd_of_one_row_pushes_as_one(make: Make) -> None:
    """Four equal robots in touch, the last drives: all move alike."""
    x = np.arange(4) * 2.0 * R - 1.0
    engine = made(make, np.column_stack([x, np.zeros(4), np.zeros(4)]))
    for _ in range(40):
        engine.tick(asked(engine, [0.2, 0.0, 0.0, 0.0]))
    gained = engine.state[0, :, 0] - x
    assert gained.min() > 0.05
    assert np.ptp(gained) < 0.03 * R


def test_wheels_count_what_they_roll_and_not_what_they_slip(make: Make) -> None:
    """A robot against a wall does not roll; one pushed sideways does neither."""
    engine = made(
        make, [[1.9, 0.0, 0.0], [0.0, 0.0, 0.0], [-2.0 * R - 1e-3, 0.0, 0.0], [0.0, 2 * R + 1e-3, -np.pi / 2]]
    )
    for _ in range(5):
        engine.tick(asked(engine, [0.2, 0.0, 0.0, 0.0]))
    stopped = engine.travel_m[0, 0].copy()
    for _ in range(20):
        engine.tick(asked(engine, [0.2, 0.0, 0.0, 0.2]))
    assert engine.travel_m[0, 0] == pytest.approx(stopped, abs=1e-3)
    assert engine.state[0, 1, 1] < -0.1
    assert np.abs(engine.travel_m[0, 1]).max() < 0.01
