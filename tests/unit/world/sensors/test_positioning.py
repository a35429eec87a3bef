"""Positioning tells the place in the arena, with an error by the sheet; only a body that has it knows."""

import numpy as np
import pytest

from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.draws import normal, purpose
from swarmwire.comms.errors import BadInput
from swarmwire.comms.sensors.simple import PositioningSpec
from swarmwire.world.world import World
from tests.support.world.samples import posed
from tests.support.world.scenes import read, scene

GPS = load_body("epuck-gps")


def test_the_error_is_normal_and_keyed_by_robot_tick_and_axis() -> None:
    poses = np.random.default_rng(1).uniform(-2, 2, (20, 3))
    looked_at = scene(poses, GPS)
    exact = read(looked_at, GPS, "positioning", PositioningSpec(0.0), 4)
    noisy = read(looked_at, GPS, "positioning", PositioningSpec(0.1), 4)
    for axis, field in enumerate(("positioning.x_m", "positioning.y_m")):
        assert np.array_equal(exact[field], poses[:, axis])
        error = 0.1 * normal(7, np.arange(20), 4, 0, purpose(f"{field} noise"))
        assert np.allclose(noisy[field], poses[:, axis] + error)
        assert noisy[field].flags.c_contiguous
    assert np.array_equal(looked_at.state[0, :, :3], poses)


def test_a_body_without_it_is_refused_to_an_agent_that_needs_it() -> None:
    needs = {"a": ("positioning",)}
    with pytest.raises(BadInput, match="the agent needs the sense 'positioning'; the body epuck has proximity"):
        World(posed([[0, 0, 0]]), [1], needs)
    readings = World(posed([[0.5, 0.25, 0]], body="epuck-gps"), [1], needs).sense(0)["a"].fields
    assert readings["positioning.x_m"][0] == pytest.approx(0.5, abs=0.06)
    assert readings["positioning.y_m"][0] == pytest.approx(0.25, abs=0.06)
