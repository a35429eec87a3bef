"""Cameras."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.geometry.shapes import Boundary, Obstacle
from swarmwire.comms.observe.truth import Group
from swarmwire.comms.observe.truth import Light as Lamp
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.comms.robot.bodies.drives import Leds
from swarmwire.comms.robot.sensors.camera import CameraSpec
from swarmwire.comms.robot.sensors.light import LightSpec
from swarmwire.comms.robot.sensors.rays import InfraredSpec, ProximitySpec
from swarmwire.comms.robot.sensors.scan import ScanSpec
from swarmwire.world.sensors.loading import sensor_of
from swarmwire.world.sensors.sensor import Scene, Sensor
from tests.support.world import brute_force
from tests.support.world.brute_force import Sample, sample
from tests.support.world.scenes import read, scene

FOOTBOT = load_body("footbot")
assert FOOTBOT.proximity is not None
BEACON = replace(FOOTBOT, leds=Leds(angles_deg=(0.0,), height_m=0.085, radius_m=0.09, beacon_height_m=0.174249733))
HIGH = CameraSpec(height_m=0.2887, aperture_deg=70.0)
GREEN = 0x00FF00
BOUNDARIES: list[Boundary] = ["walls", "open", "torus"]
ANGLES_DEG = (0.0, 17.0, 50.0, 90.0, 150.0, 210.0, 270.0, 310.0, 343.0)
RESPONSE = replace(FOOTBOT.proximity.response, reach_m=0.6)
NEAR_RESPONSE = replace(FOOTBOT.proximity.response, reach_m=0.5)
RING: dict[str, Any] = {"angles_deg": tuple(range(0, 360, 30)), "range_m": 0.5, "response": NEAR_RESPONSE}
SEEING: dict[str, Any] = {
    "proximity": ProximitySpec(**RING),
    "infrared": InfraredSpec(**RING),
    "scan": ScanSpec(rays=45, range_m=1.0, at_m=0.02),
    "camera": CameraSpec(height_m=0.2887, aperture_deg=70.0, max_blobs=200),
    "light": LightSpec(angles_deg=RING["angles_deg"]),
}


def camera_fields(poses: Any, spec: CameraSpec = HIGH, tick: int = 0, **more: Any) -> dict[str, FloatArray]:
    body, colour = more.pop("body", BEACON), more.pop("colour", GREEN)
    looked_at = scene(poses, body, more.pop("obstacles", ()), boundary="open", colour=colour)
    if "dark" in more:
        looked_at.leds[0, :, more["dark"]] = 0
    fields = read(looked_at, body, "camera", spec, tick)
    return {name.removeprefix("camera."): values for name, values in fields.items()}


def distances(*at: Any, **more: Any) -> list[float]:
    """Distances of the blobs that the first robot sees; it looks along x."""
    distance_m = camera_fields([[0.0, 0.0, 0.0], *at], **more)["distance_m"][0]
    return distance_m[np.isfinite(distance_m)].tolist()


@pytest.mark.parametrize(
    ("height_m", "aperture_deg", "reach_m"), [(0.2887, 70.0, 0.793), (0.2887, 80.0, 1.64), (0.122, 70.0, 0.335)]
)
def test_camera_reach_equals_the_cameras_of_argos(height_m: float, aperture_deg: float, reach_m: float) -> None:
    spec = CameraSpec(height_m=height_m, aperture_deg=aperture_deg)
    assert spec.reach_m(0.0) == pytest.approx(reach_m, abs=4e-3)
    low = replace(FOOTBOT, height_m=0.05, leds=Leds(angles_deg=(0.0,), radius_m=1e-9, height_m=0.05))
    for share, count in ((0.999, 1), (1.001, 0)):
        assert len(distances([spec.reach_m(0.0) * share, 0.0, 0.0], spec=spec, body=low)) == count


def test_robot_hides_its_far_side_and_low_leds_behind_it() -> None:
    facing = [0.4, 0.0, np.pi]
    assert distances(facing) == pytest.approx([0.31, 0.4])
    assert distances([0.4, 0.0, 0.0]) == pytest.approx([0.4])
    between = [0.2, 0.0, np.pi]
    assert distances(between, facing, dark=1) == pytest.approx([0.11])
    assert distances(between, facing, dark=0) == pytest.approx([0.2, 0.4])


def test_camera_lists_the_nearest_blobs_in_order() -> None:
    apart_m = 0.75, 0.25, 0.5, 0.625, 0.375, 0.725
    others = [[d * np.cos(a), d * np.sin(a), 0.0] for a, d in enumerate(apart_m)]
    assert distances(*others, dark=0) == pytest.approx([0.25, 0.375, 0.5, 0.625, 0.725, 0.75])
    assert distances(*others, dark=0, spec=replace(HIGH, max_blobs=3)) == pytest.approx([0.25, 0.375, 0.5])


def test_lost_blob_is_lost_in_all_fields() -> None:
    poses = np.random.default_rng(1).uniform(-1, 1, (30, 3)) * [0.8, 0.8, np.pi]
    exact, lossy = camera_fields(poses), camera_fields(poses, replace(HIGH, drop_out=0.3))
    lost = np.isfinite(exact["distance_m"]) & np.isnan(lossy["distance_m"])
    assert 0.2 < lost.sum() / np.isfinite(exact["distance_m"]).sum() < 0.4
    for name in ("bearing_rad", "colour"):
        assert np.array_equal(np.isnan(lossy[name]), np.isnan(lossy["distance_m"]))


def truth(crowd: Sample, name: str, spec: Any) -> tuple[FloatArray, ...]:
    """The truth of all groups, a row per robot of each arena."""
    fields = zip(*(sensor_of(name, spec, crowd.scene, group).truth(0) for group in crowd.groups), strict=True)
    return tuple(np.concatenate(field, axis=1).reshape(-1, field[0].shape[2]) for field in fields)


def assert_close_where_finite(values: FloatArray, expected: FloatArray) -> None:
    """Assert that both are equal within rounding, and neither empty nor full."""
    assert np.array_equal(np.isfinite(values), np.isfinite(expected))
    met = np.isfinite(expected)
    assert 0.1 < met.mean() < 0.95
    assert np.abs(values[met] - expected[met]).max() < 1e-6  # near a tangent, the root of a rounding error


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_proximity_and_infrared_equal_brute_force(boundary: Boundary) -> None:
    crowd = sample(1, boundary)
    for name, kind in (("proximity", ProximitySpec), ("infrared", InfraredSpec)):
        spec = kind(angles_deg=ANGLES_DEG, range_m=0.6, response=RESPONSE)
        expected = brute_force.rim_rays(crowd, name == "proximity", spec.angle_rad, 0.6)
        answers = truth(crowd, name, spec)[0]
        assert answers == pytest.approx(RESPONSE.value(expected), abs=1e-6)
        assert 0.1 < np.isfinite(expected).mean() < 0.9


@pytest.mark.parametrize("boundary", BOUNDARIES)
@pytest.mark.parametrize(
    "turned",
    [
        {"rays": 17},
        {"rays": 20, "first_deg": -100.0, "span_deg": 200.0, "at_m": -0.03},
        {"rays": 7, "first_deg": 3000.0, "span_deg": 359.0},
        {"rays": 1, "first_deg": 45.0, "span_deg": 10.0},
    ],
)
def test_scan_equals_brute_force(turned: dict[str, Any], boundary: Boundary) -> None:
    crowd, spec = sample(3, boundary), ScanSpec(range_m=1.0, **turned)
    assert_close_where_finite(
        truth(crowd, "scan", spec)[0], brute_force.scan_distances(crowd, spec.angle_rad, 1.0, spec.at_m)
    )


@pytest.mark.parametrize("boundary", BOUNDARIES)
@pytest.mark.parametrize("seed", [4, 5])
def test_photocells_equal_brute_force(seed: int, boundary: Boundary) -> None:
    crowd = sample(seed, boundary, each=5)
    spec = LightSpec(angles_deg=(0.0, 90.0, 180.0, 270.0))
    expected = brute_force.light_values(crowd, spec.angle_rad)
    assert truth(crowd, "light", spec)[0] == pytest.approx(expected, abs=1e-9)
    assert 0.05 < (expected > 0).mean() < 0.6


@pytest.mark.parametrize("boundary", BOUNDARIES)
@pytest.mark.parametrize("height_m", [0.12, 0.25])
def test_camera_blobs_equal_brute_force(height_m: float, boundary: Boundary) -> None:
    crowd = sample(6, boundary, each=8)
    spec = CameraSpec(height_m=height_m, aperture_deg=70.0, max_blobs=200)
    fields, hidden = truth(crowd, "camera", spec), 0
    rows = [(arena, group, i) for arena in range(2) for group in crowd.groups for i in range(group.start, group.stop)]
    for row, (arena, group, robot) in enumerate(rows):
        expected = brute_force.blobs(crowd, arena, robot, spec.reach_m(group.body.altitude_m), height_m)
        count = len(expected)
        assert np.isfinite(fields[0][row]).tolist() == [True] * count + [False] * (200 - count)
        assert np.column_stack([field[row, :count] for field in fields]) == pytest.approx(
            np.array(expected).reshape(-1, 3)
        )
        hidden += count == 0
    assert 0 < hidden < len(rows) // 2


def truth_of_footbots(poses: Any, name: str, lamps: Any, size_m: float = 3.0) -> tuple[FloatArray, ...]:
    """The truth of foot-bots at these poses among lamps, in an open arena."""
    lights = tuple(Lamp(x, y, 1.0) for x, y in lamps)
    looked_at = scene(poses, FOOTBOT, size_m=size_m, boundary="open", colour=0x00FF00, lights=lights)
    sensor = sensor_of(name, SEEING[name], looked_at, Group("a", FOOTBOT, 0, len(poses)))
    return tuple(field[0] for field in sensor.truth(0))


@pytest.mark.parametrize("name", SEEING)
@given(x=st.floats(-30, 30), y=st.floats(-30, 30), turn=st.floats(-20, 20), seed=st.integers(0, 5))
def test_sensor_truth_is_equal_when_everything_is_moved_and_turned(
    name: str, x: float, y: float, turn: float, seed: int
) -> None:
    random = np.random.default_rng(seed)
    poses = random.uniform(-1, 1, (15, 3)) * [1.0, 1.0, np.pi]
    lamps = random.uniform(-1, 1, (2, 2))
    c, s = np.cos(turn), np.sin(turn)

    def moved(at: FloatArray) -> FloatArray:
        return np.stack([x + c * at[:, 0] - s * at[:, 1], y + s * at[:, 0] + c * at[:, 1]], axis=1)

    before = truth_of_footbots(poses, name, lamps)
    after = truth_of_footbots(np.column_stack([moved(poses), poses[:, 2] + turn]), name, moved(lamps))
    for values, moved_values in zip(before, after, strict=True):
        assert np.isfinite(values).any()
        assert np.array_equal(np.isfinite(values), np.isfinite(moved_values))
        # Near a tangent a distance changes with the root of a rounding error.
        assert np.allclose(values, moved_values, atol=3e-6, equal_nan=True)


@pytest.mark.parametrize("name", SEEING)
@given(bearing=st.floats(0, 6.3), size_m=st.sampled_from([1.0, 3.0, 7.0]))
def test_robot_out_of_range_changes_no_bit(name: str, bearing: float, size_m: float) -> None:
    random = np.random.default_rng(3)
    poses = random.uniform(-1, 1, (20, 3)) * [0.5, 0.5, np.pi]
    far = [3.0 * np.cos(bearing), 3.0 * np.sin(bearing), 0.0]  # beyond 1 m of everybody and of every line to a lamp
    lamps = random.uniform(-1, 1, (2, 2))
    alone, with_far = (truth_of_footbots(at, name, lamps, size_m) for at in (poses, np.vstack([poses, far])))
    for expected, values in zip(alone, with_far, strict=True):
        assert np.array_equal(expected, values[:-1], equal_nan=True)


@pytest.mark.parametrize("name", ["proximity", "infrared", "scan", "camera", "light"])
def test_pushed_obstacle_is_sensed_at_its_new_position(name: str) -> None:
    poses = np.random.default_rng(5).uniform(-1, 1, (12, 3)) * [0.6, 0.6, np.pi]
    pillar, box = Obstacle("cylinder", -0.9, 0.0, radius_m=0.3), Obstacle("box", 0.0, 0.7, size_m=(0.3, 0.2))

    def scene_with(*obstacles: Obstacle, moves: bool = False) -> Scene:
        lamps = (Lamp(0.9, 0.9, 1.0), Lamp(-0.9, 0.9, 1.0))
        built = scene(poses, FOOTBOT, obstacles, size_m=2.0, colour=0xFF0000, lights=lamps)
        return replace(built, obstacles_move=moves)

    def truth(sensor: Sensor) -> FloatArray:
        return np.stack([field[0] for field in sensor.truth(0)])

    group, pushed = (Group("a", FOOTBOT, 0, 12), (replace(pillar, x_m=0.1), replace(box, y_m=-0.2, heading_rad=1.0)))
    looked_at, expected = scene_with(pillar, box, moves=True), scene_with(*pushed)
    sensor = sensor_of(name, SEEING[name], looked_at, group)
    before = truth(sensor)
    for have, now in zip(looked_at.obstacles, expected.obstacles, strict=True):
        have[...] = now
    after = truth(sensor)
    assert np.array_equal(after, truth(sensor_of(name, SEEING[name], expected, group)), equal_nan=True)
    assert not np.array_equal(before, after, equal_nan=True)
