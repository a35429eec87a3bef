"""Free robots drive the path that their targets describe, and their wheels measure it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.world.engines.conformance import EVERY, FLOOR, Make, asked, made

BASE_M = 0.14


@pytest.mark.parametrize("make", EVERY)
@pytest.mark.parametrize("steps", [1, 5])
@given(
    forward=st.floats(-0.3, 0.3),
    left=st.floats(-0.3, 0.3),
    turn=st.floats(-2.0, 2.0),
    heading=st.floats(-3.1, 3.1),
)
def test_a_robot_drives_chords_of_its_arc(
    make: Make, steps: int, forward: float, left: float, turn: float, heading: float
) -> None:
    engine = made(make, [[0.1, -0.2, heading]], steps=steps)
    target = asked(engine, forward, turn, left)
    for _ in range(3):
        engine.tick(target)
    x, y, start = engine.state[0, 0, :3]
    rolled = engine.travel_m[0, 0].copy()
    for _ in range(10):
        engine.tick(target)
    chord = np.sinc(turn / (2.0 * np.pi))
    along, across = start + turn / 2.0, start + turn / 2.0 + np.pi / 2.0
    at_x = x + chord * (forward * np.cos(along) + left * np.cos(across))
    at_y = y + chord * (forward * np.sin(along) + left * np.sin(across))
    # The path of k steps is k chords, each longer than its own by (turn per step)^2 / 24.
    slack = 1e-9 + np.hypot(forward, left) * (turn * 0.1 / steps) ** 2 / 20
    assert engine.state[0, 0, :2] == pytest.approx((at_x, at_y), abs=slack)
    assert engine.state[0, 0, 2] - start == pytest.approx(turn, abs=1e-9)
    wheels = forward - 0.5 * BASE_M * turn, forward + 0.5 * BASE_M * turn
    assert engine.travel_m[0, 0] - rolled == pytest.approx(wheels, abs=1e-9)


@pytest.mark.parametrize("make", FLOOR)
@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_speed_builds_up_and_turns_with_the_grip_that_there_is(make: Make, heading: float) -> None:
    """From driving ahead to driving across: velocity changes by force / mass along the straight line between both."""
    engine = made(make, [[0.0, 0.0, heading]], max_force_n=1.6, mass_kg=1.6, steps=50)
    for _ in range(4):
        engine.tick(asked(engine, 0.3))
    for tick in range(1, 4):
        engine.tick(asked(engine, 0.0, 0.0, 0.4))
        ahead = np.array([np.cos(heading), np.sin(heading)])
        wanted = ahead * (0.3 - 0.06 * tick * 10 / 10) + np.array([-ahead[1], ahead[0]]) * 0.08 * tick
        assert engine.state[0, 0, 3:5] == pytest.approx(wanted, abs=1e-6)
