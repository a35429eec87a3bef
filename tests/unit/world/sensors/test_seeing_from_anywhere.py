"""What robots sense of one another depends on where they stand to one another, and on nobody out of range."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.sensors.camera import CameraSpec
from swarmwire.comms.sensors.light import LightSpec
from swarmwire.comms.sensors.rays import InfraredSpec, ProximitySpec
from swarmwire.comms.sensors.scan import ScanSpec
from swarmwire.comms.truth import Group, Obstacle
from swarmwire.comms.truth import Light as Lamp
from swarmwire.world.sensors.loading import sensor_of
from swarmwire.world.sensors.sensor import Scene, Sensor
from tests.support.world.brute_force import FOOTBOT
from tests.support.world.scenes import scene

assert FOOTBOT.proximity is not None
RESPONSE = replace(FOOTBOT.proximity.response, reach_m=0.5)
RING: dict[str, Any] = {"angles_deg": tuple(range(0, 360, 30)), "range_m": 0.5, "response": RESPONSE}
SEEING: dict[str, Any] = {
    "proximity": ProximitySpec(**RING),
    "infrared": InfraredSpec(**RING),
    "scan": ScanSpec(rays=45, range_m=1.0, at_m=0.02),
    "camera": CameraSpec(height_m=0.2887, aperture_deg=70.0, max_blobs=200),
    "light": LightSpec(angles_deg=RING["angles_deg"]),
}


def seen(poses: Any, name: str, lamps: Any, size_m: float = 3.0) -> tuple[FloatArray, ...]:
    """What foot-bots at these poses sense of one another and of lamps, in the open."""
    lights = tuple(Lamp(x, y, 1.0) for x, y in lamps)
    looked_at = scene(poses, FOOTBOT, size_m=size_m, boundary="open", colour=0x00FF00, lights=lights)
    sensor = sensor_of(name, SEEING[name], looked_at, Group("a", FOOTBOT, 0, len(poses)))
    return tuple(field[0] for field in sensor.truth(0))


@pytest.mark.parametrize("name", SEEING)
@given(x=st.floats(-30, 30), y=st.floats(-30, 30), turn=st.floats(-20, 20), seed=st.integers(0, 5))
def test_moving_and_turning_everything_changes_nothing(name: str, x: float, y: float, turn: float, seed: int) -> None:
    random = np.random.default_rng(seed)
    poses = random.uniform(-1, 1, (15, 3)) * [1.0, 1.0, np.pi]
    lamps = random.uniform(-1, 1, (2, 2))
    c, s = np.cos(turn), np.sin(turn)

    def moved(at: FloatArray) -> FloatArray:
        return np.stack([x + c * at[:, 0] - s * at[:, 1], y + s * at[:, 0] + c * at[:, 1]], axis=1)

    before = seen(poses, name, lamps)
    after = seen(np.column_stack([moved(poses), poses[:, 2] + turn]), name, moved(lamps))
    for one, other in zip(before, after, strict=True):
        assert np.isfinite(one).any()
        assert np.array_equal(np.isfinite(one), np.isfinite(other))
        # Near a tangent a distance changes with the root of a rounding error.
        assert np.allclose(one, other, atol=3e-6, equal_nan=True)


@pytest.mark.parametrize("name", SEEING)
@given(bearing=st.floats(0, 6.3), size_m=st.sampled_from([1.0, 3.0, 7.0]))
def test_a_robot_out_of_range_changes_no_bit(name: str, bearing: float, size_m: float) -> None:
    random = np.random.default_rng(3)
    poses = random.uniform(-1, 1, (20, 3)) * [0.5, 0.5, np.pi]
    far = [3.0 * np.cos(bearing), 3.0 * np.sin(bearing), 0.0]  # beyond 1 m of everybody and of every line to a lamp
    lamps = random.uniform(-1, 1, (2, 2))
    alone, beside = (seen(at, name, lamps, size_m) for at in (poses, np.vstack([poses, far])))
    for one, other in zip(alone, beside, strict=True):
        assert np.array_equal(one, other[:-1], equal_nan=True)


@pytest.mark.parametrize("running", [(True, True, True), (True, False, True)])
@pytest.mark.parametrize("name", SEEING)
def test_a_group_of_many_arenas_sees_what_it_sees_alone(name: str, running: tuple[bool, ...]) -> None:
    """Also beside an arena that is over, where nobody looks any more."""
    poses = np.random.default_rng(4).uniform(-1, 1, (3, 12, 3)) * [0.7, 0.7, np.pi]
    many = scene(poses[0], FOOTBOT, size_m=2.0, colour=0xFF0000, lights=(Lamp(0.1, 0.2, 1.0),))
    state = np.zeros((3, 12, 6))
    state[:, :, :3] = poses
    many = replace(
        many,
        keys=np.arange(3, dtype=np.uint64),
        state=state,
        leds=np.repeat(many.leds, 3, axis=0),
        lights=many.lights * 3,
        alive=np.ones((3, many.state.shape[1]), np.bool_),
        running=np.array(running),
        obstacles=many.obstacles._replace(circle_start=np.zeros(4, np.int64), polygon_start=np.zeros(4, np.int64)),
    )
    group = Group("a", FOOTBOT, 3, 9)
    together = sensor_of(name, SEEING[name], many, group).truth(0)
    for arena in np.flatnonzero(running):
        alone = scene(poses[arena], FOOTBOT, size_m=2.0, colour=0xFF0000, lights=(Lamp(0.1, 0.2, 1.0),))
        for one, other in zip(sensor_of(name, SEEING[name], alone, group).truth(0), together, strict=True):
            assert np.array_equal(one[0], other[arena], equal_nan=True)


@pytest.mark.parametrize("name", ["proximity", "infrared", "scan", "camera", "light"])
def test_an_obstacle_that_was_pushed_is_seen_where_it_is(name: str) -> None:
    poses = np.random.default_rng(5).uniform(-1, 1, (12, 3)) * [0.6, 0.6, np.pi]
    pillar, box = Obstacle("cylinder", -0.9, 0.0, radius_m=0.3), Obstacle("box", 0.0, 0.7, size_m=(0.3, 0.2))

    def around(*obstacles: Obstacle, moves: bool = False) -> Scene:
        lamps = (Lamp(0.9, 0.9, 1.0), Lamp(-0.9, 0.9, 1.0))
        made = scene(poses, FOOTBOT, obstacles, size_m=2.0, colour=0xFF0000, lights=lamps)
        return replace(made, obstacles_move=moves)

    def truth(sensor: Sensor) -> FloatArray:
        return np.stack([field[0] for field in sensor.truth(0)])

    group, pushed = Group("a", FOOTBOT, 0, 12), (replace(pillar, x_m=0.1), replace(box, y_m=-0.2, heading_rad=1.0))
    looked_at, expected = around(pillar, box, moves=True), around(*pushed)
    sensor = sensor_of(name, SEEING[name], looked_at, group)
    before = truth(sensor)
    for have, now in zip(looked_at.obstacles, expected.obstacles, strict=True):
        have[...] = now
    after = truth(sensor)
    assert np.array_equal(after, truth(sensor_of(name, SEEING[name], expected, group)), equal_nan=True)
    assert not np.array_equal(before, after, equal_nan=True)
