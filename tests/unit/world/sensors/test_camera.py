"""Cameras."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.draws import normal, purpose
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

EPUCK, FOOTBOT = load_body("epuck"), load_body("footbot")
assert FOOTBOT.proximity is not None
BEACON = replace(FOOTBOT, leds=Leds(angles_deg=(0.0,), height_m=0.085, radius_m=0.09, beacon_height_m=0.174249733))
HIGH = CameraSpec(height_m=0.2887, aperture_deg=70.0)
GREEN = 0x00FF00
BOUNDARIES: list[Boundary] = ["walls", "open", "torus"]
ANGLES_DEG = (0.0, 17.0, 50.0, 90.0, 150.0, 210.0, 270.0, 310.0, 343.0)
RESPONSE = replace(FOOTBOT.proximity.response, reach_m=0.6)
NEAR_RESPONSE = replace(FOOTBOT.proximity.response, reach_m=0.5)
RING: dict[str, Any] = {
    "angles_deg": tuple(range(0, 360, 30)),
    "range_m": 0.5,
    "response": NEAR_RESPONSE,
}
SEEING: dict[str, Any] = {
    "proximity": ProximitySpec(**RING),
    "infrared": InfraredSpec(**RING),
    "scan": ScanSpec(rays=45, range_m=1.0, at_m=0.02),
    "camera": CameraSpec(height_m=0.2887, aperture_deg=70.0, max_blobs=200),
    "light": LightSpec(angles_deg=RING["angles_deg"]),
}


def told(poses: Any, spec: CameraSpec = HIGH, tick: int = 0, **more: Any) -> dict[str, FloatArray]:
    body, colour = more.pop("body", BEACON), more.pop("colour", GREEN)
    looked_at = scene(poses, body, more.pop("obstacles", ()), boundary="open", colour=colour)
    if "dark" in more:
        looked_at.leds[0, :, more["dark"]] = 0
    fields = read(looked_at, body, "camera", spec, tick)
    return {name.removeprefix("camera."): values for name, values in fields.items()}


def distances(*at: Any, **more: Any) -> list[float]:
    """What the first robot, which looks along x, sees of others."""
    found = told([[0.0, 0.0, 0.0], *at], **more)["distance_m"][0]
    return found[np.isfinite(found)].tolist()


@pytest.mark.parametrize(
    ("height_m", "aperture_deg", "reach_m"),
    [(0.2887, 70.0, 0.793), (0.2887, 80.0, 1.64), (0.122, 70.0, 0.335)],
)
def test_a_camera_sees_as_far_as_argos_s_do(height_m: float, aperture_deg: float, reach_m: float) -> None:
    spec = CameraSpec(height_m=height_m, aperture_deg=aperture_deg)
    assert spec.reach_m(0.0) == pytest.approx(reach_m, abs=4e-3)
    low = replace(FOOTBOT, height_m=0.05, leds=Leds(angles_deg=(0.0,), radius_m=1e-9, height_m=0.05))
    for share, seen in ((0.999, 1), (1.001, 0)):
        assert len(distances([spec.reach_m(0.0) * share, 0.0, 0.0], spec=spec, body=low)) == seen


def test_a_blob_is_where_its_led_is() -> None:
    fields = told([[0.0, 0.0, 0.5], [0.3, 0.4, 0.9 + np.pi]], dark=1)  # only the one in front, nearest to the camera
    led = 0.3 + 0.09 * np.cos(0.9 + np.pi), 0.4 + 0.09 * np.sin(0.9 + np.pi)
    assert fields["distance_m"][0, :2] == pytest.approx([np.hypot(*led), np.nan], nan_ok=True)
    assert fields["bearing_rad"][0, 0] == pytest.approx(np.arctan2(led[1], led[0]) - 0.5)
    assert fields["colour"][0, 0] == GREEN
    assert {name: values.shape for name, values in fields.items()} == dict.fromkeys(fields, (2, 32))


def test_neither_own_leds_nor_dark_ones_are_seen() -> None:
    assert distances() == []
    assert distances([0.4, 0.0, 0.0], colour=0) == []


def test_a_robot_hides_its_own_far_side_and_what_is_low_behind_it_but_not_its_beacon() -> None:
    facing = [0.4, 0.0, np.pi]
    assert distances(facing) == pytest.approx([0.31, 0.4])
    assert distances([0.4, 0.0, 0.0]) == pytest.approx([0.4])
    between = [0.2, 0.0, np.pi]
    assert distances(between, facing, dark=1) == pytest.approx([0.11])
    assert distances(between, facing, dark=0) == pytest.approx([0.2, 0.4])


@pytest.mark.parametrize(("height_m", "seen"), [(0.05, 1), (0.1, 1), (0.25, 0)])
def test_an_obstacle_hides_what_the_line_to_passes_through_it(height_m: float, seen: int) -> None:
    """The line from 0.289 m to a beacon at 0.174 m is at 0.23 m halfway."""
    box = Obstacle("box", 0.2, 0.0, 0.3, size_m=(0.02, 0.3), height_m=height_m)
    assert len(distances([0.4, 0.0, 0.0], obstacles=(box,), dark=0)) == seen


def test_the_nearest_blobs_are_kept_in_order() -> None:
    apart_m = 0.75, 0.25, 0.5, 0.625, 0.375, 0.725
    others = [[d * np.cos(a), d * np.sin(a), 0.0] for a, d in enumerate(apart_m)]
    assert distances(*others, dark=0) == pytest.approx([0.25, 0.375, 0.5, 0.625, 0.725, 0.75])
    assert distances(*others, dark=0, spec=replace(HIGH, max_blobs=3)) == pytest.approx([0.25, 0.375, 0.5])


def test_the_error_of_a_distance_is_a_share_of_it() -> None:
    poses = [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.6, 0.0]]
    exact = told(poses, dark=0)
    noisy = told(poses, replace(HIGH, noise_relative=0.1), tick=3, dark=0)
    factor = 1.0 + 0.1 * normal(7, 0, 3, np.arange(2), purpose("camera.distance_m noise"))
    assert noisy["distance_m"][0, :2] == pytest.approx(exact["distance_m"][0, :2] * factor)
    assert np.array_equal(noisy["bearing_rad"], exact["bearing_rad"], equal_nan=True)


def test_a_lost_blob_is_lost_altogether() -> None:
    poses = np.random.default_rng(1).uniform(-1, 1, (30, 3)) * [0.8, 0.8, np.pi]
    exact, lossy = told(poses), told(poses, replace(HIGH, drop_out=0.3))
    lost = np.isfinite(exact["distance_m"]) & np.isnan(lossy["distance_m"])
    assert 0.2 < lost.sum() / np.isfinite(exact["distance_m"]).sum() < 0.4
    for name in ("bearing_rad", "colour"):
        assert np.array_equal(np.isnan(lossy[name]), np.isnan(lossy["distance_m"]))


assert FOOTBOT.proximity is not None


def truth(of: Sample, name: str, spec: Any) -> tuple[FloatArray, ...]:
    """The truth of all groups side by side, a row per robot of each arena."""
    fields = zip(*(sensor_of(name, spec, of.scene, group).truth(0) for group in of.groups), strict=True)
    return tuple(np.concatenate(field, axis=1).reshape(-1, field[0].shape[2]) for field in fields)


def same(seen: FloatArray, expected: FloatArray) -> None:
    """Equal but for rounding, and neither empty nor full."""
    assert np.array_equal(np.isfinite(seen), np.isfinite(expected))
    met = np.isfinite(expected)
    assert 0.1 < met.mean() < 0.95
    assert np.abs(seen[met] - expected[met]).max() < 1e-6  # near a tangent, the root of a rounding error


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_rays_from_the_rim_end_at_the_nearest_thing_or_for_passive_ones_the_nearest_robot(boundary: Boundary) -> None:
    of = sample(1, boundary)
    for name, kind in (("proximity", ProximitySpec), ("infrared", InfraredSpec)):
        spec = kind(angles_deg=ANGLES_DEG, range_m=0.6, response=RESPONSE)
        expected = brute_force.rim_rays(of, name == "proximity", spec.angle_rad, 0.6)
        answers = truth(of, name, spec)[0]
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
def test_a_scan_shows_the_nearest_thing_on_every_ray(turned: dict[str, Any], boundary: Boundary) -> None:
    of, spec = sample(3, boundary), ScanSpec(range_m=1.0, **turned)
    same(truth(of, "scan", spec)[0], brute_force.scanned(of, spec.angle_rad, 1.0, spec.at_m))


@pytest.mark.parametrize("boundary", BOUNDARIES)
@pytest.mark.parametrize("seed", [4, 5])
def test_photocells_see_the_lights_that_nothing_beside_them_hides(seed: int, boundary: Boundary) -> None:
    of = sample(seed, boundary, each=5)
    spec = LightSpec(angles_deg=(0.0, 90.0, 180.0, 270.0))
    expected = brute_force.shone(of, spec.angle_rad)
    assert truth(of, "light", spec)[0] == pytest.approx(expected, abs=1e-9)
    assert 0.05 < (expected > 0).mean() < 0.6


@pytest.mark.parametrize("boundary", BOUNDARIES)
@pytest.mark.parametrize("height_m", [0.12, 0.25])
def test_a_camera_sees_the_leds_within_its_cone_that_no_body_hides(height_m: float, boundary: Boundary) -> None:
    of = sample(6, boundary, each=8)
    spec = CameraSpec(height_m=height_m, aperture_deg=70.0, max_blobs=200)
    seen, hidden = truth(of, "camera", spec), 0
    rows = [(arena, group, i) for arena in range(2) for group in of.groups for i in range(group.start, group.stop)]
    for row, (arena, group, robot) in enumerate(rows):
        expected = brute_force.blobs(of, arena, robot, spec.reach_m(group.body.altitude_m), height_m)
        count = len(expected)
        assert np.isfinite(seen[0][row]).tolist() == [True] * count + [False] * (200 - count)
        assert np.column_stack([field[row, :count] for field in seen]) == pytest.approx(
            np.array(expected).reshape(-1, 3)
        )
        hidden += count == 0
    assert 0 < hidden < len(rows) // 2


assert FOOTBOT.proximity is not None


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

    group, pushed = (
        Group("a", FOOTBOT, 0, 12),
        (replace(pillar, x_m=0.1), replace(box, y_m=-0.2, heading_rad=1.0)),
    )
    looked_at, expected = around(pillar, box, moves=True), around(*pushed)
    sensor = sensor_of(name, SEEING[name], looked_at, group)
    before = truth(sensor)
    for have, now in zip(looked_at.obstacles, expected.obstacles, strict=True):
        have[...] = now
    after = truth(sensor)
    assert np.array_equal(after, truth(sensor_of(name, SEEING[name], expected, group)), equal_nan=True)
    assert not np.array_equal(before, after, equal_nan=True)
