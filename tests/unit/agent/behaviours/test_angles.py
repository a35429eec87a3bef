"""Angles of another turn are the same direction."""

import numpy as np
import pytest

from swarmwire.agent.behaviours.angles import wrapped


def test_angles_of_other_turns_come_within_half_a_turn_to_either_side_the_left_end_left_out() -> None:
    turns = np.array([0.0, 1.0, 4.0, -4.0, 7.0, np.pi, -np.pi])
    expected = [0.0, 1.0, 4.0 - 2.0 * np.pi, 2.0 * np.pi - 4.0, 7.0 - 2.0 * np.pi, -np.pi, -np.pi]
    assert wrapped(turns) == pytest.approx(expected)
