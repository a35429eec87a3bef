"""Sensors with rays: infrared, light, scans."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.observe.truth import Light
from swarmwire.comms.robot.bodies.body import Body, load_body
from swarmwire.comms.robot.sensors.rays import InfraredSpec, ProximitySpec, ResponseCurve
from swarmwire.comms.robot.sensors.scan import ScanSpec
from swarmwire.world.sensors.pipeline import SensorPipeline
from swarmwire.world.sensors.sensor import Scene
from swarmwire.world.world import World
from tests.support.world.scenes import posed, read, scene, staged

EPUCK = load_body("epuck")
REACH_M = 10 * EPUCK.radius_m  # five diameters
RING: dict[str, Any] = {
    "angles_deg": tuple(range(-30, 330, 30)),  # four sectors of three: ahead, left, behind, right
    "range_m": REACH_M,
    "response": ResponseCurve(kind="quadratic", a=0.0, b=-1.0 / REACH_M, c=1.0, reach_m=REACH_M),
}
FOOTBOT = load_body("footbot")


def answers(poses: Any, obstacles: tuple[Obstacle, ...] = (), **more: Any) -> tuple[FloatArray, FloatArray]:
    """Readings of proximity and of passive infrared of the first robot."""
    looked_at = scene(poses, EPUCK, obstacles, **more)
    active = read(looked_at, EPUCK, "proximity", ProximitySpec(**RING))["proximity.value"]
    passive = read(looked_at, EPUCK, "infrared", InfraredSpec(**RING))["infrared.value"]
    return active[0], passive[0]


@pytest.mark.parametrize(("gap_m", "in_reach"), [(REACH_M - 1e-6, True), (REACH_M + 1e-6, False)])
def test_infrared_range_is_measured_from_rim_to_rim(gap_m: float, in_reach: bool) -> None:
    passive = answers([[0.0, 0.0, 0.0], [2 * EPUCK.radius_m + gap_m, 0.0, 0.0]], boundary="open")[1]
    assert bool(passive.any()) is in_reach


def test_scene_follows_which_robots_are_alive() -> None:
    world = World(posed([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0]]), [1, 2], {})
    alive = world.scene.alive
    assert alive.all()
    world.set_alive(np.array([True, False, True, True]))
    assert alive.tolist() == [[True, False], [True, True]]
    world.set_alive(np.ones(4, np.bool_))
    assert alive.all()


def sensor(looked_at: Scene, body: Body, **spec: Any) -> SensorPipeline:
    assert body.light is not None
    return staged(looked_at, body, "light", replace(body.light, **spec))


def values(looked_at: Scene, body: Body = EPUCK) -> FloatArray:
    return sensor(looked_at, body, noise=0.0).read(0)["light.value"]


def law(distance_m: float, intensity_m: float, off_rad: FloatArray) -> FloatArray:
    """The law of light in numpy; `off_rad` is the angle between sensors and light, any number of turns."""
    off = np.abs(np.angle(np.exp(1j * off_rad)))
    glow = np.exp(-2.0 * distance_m / intensity_m) if distance_m <= 2.5 * intensity_m else 0.0
    return glow * np.where(off < np.pi / 2, 1.0 - 2.0 * off / np.pi, 0.0)


def test_light_ahead_of_an_epuck_reads_as_the_law() -> None:
    answers = values(scene([[0.0, 0.0, 0.0]], EPUCK, lights=(Light(1.0, 0.0, 2.0),)))[0]
    near, side = 0.75 * np.exp(-1.0), 0.25 * np.exp(-1.0)  # at 22.5 and 67.5 degrees
    assert answers == pytest.approx([near, side, 0, 0, 0, 0, side, near])


@pytest.mark.parametrize(("distance_m", "lit"), [(2.4999, True), (2.5001, False)])
def test_light_is_dark_beyond_two_and_a_half_times_its_intensity(distance_m: float, lit: bool) -> None:
    answers = values(scene([[0.0, 0.0, 0.0]], EPUCK, lights=(Light(0.0, distance_m, 1.0),)))
    assert bool(answers.any()) is lit
    assert not values(scene([[0.0, 0.0, 0.0]], EPUCK)).any()


def test_lights_add_up_to_one_at_most() -> None:
    left, right = Light(1.0, 0.3, 2.0), Light(-0.4, 1.0, 1.5)
    lit = (left, right), (left,), (right,)
    both, first, second = (values(scene([[0, 0, 0.4]], EPUCK, lights=lights)) for lights in lit)
    assert both == pytest.approx(first + second)
    bright = values(scene([[0, 0, 0]], EPUCK, lights=(Light(0.01, 0.0, 5.0),) * 3))
    assert bright.max() == 1.0


@given(turn=st.floats(-20, 20), heading=st.floats(-20, 20))
def test_light_depends_only_on_the_angle_to_the_heading(turn: float, heading: float) -> None:
    lit = (Light(float(np.cos(turn)), float(np.sin(turn)), 2.0),)
    assert EPUCK.light is not None
    expected = law(1.0, 2.0, turn - heading - EPUCK.light.angle_rad)
    assert values(scene([[0, 0, heading]], EPUCK, lights=lit))[0] == pytest.approx(expected, abs=1e-9)


def test_robot_casts_a_shadow_but_not_on_itself() -> None:
    lit, radius = (Light(1.0, 0.0, 2.0),), EPUCK.radius_m
    assert not values(scene([[0, 0, 0], [0.5, 0.99 * radius, 0]], EPUCK, lights=lit))[0].any()
    assert values(scene([[0, 0, 0], [0.5, 1.01 * radius, 0]], EPUCK, lights=lit)).any(axis=1).all()
    assert values(scene([[0, 0, 0], [-0.5, 0, 0]], EPUCK, lights=lit)).any(axis=1).tolist() == [True, False]
    assert values(scene([[1.0, 0, 0]], EPUCK, lights=lit))[0].any()


@pytest.mark.parametrize("spread_m", [2.4, 5.0])
def test_shadows_equal_a_search_among_all_robots(spread_m: float) -> None:
    """The second case has robots outside the open arena of 5 m."""
    random = np.random.default_rng(6)
    poses = random.uniform(-1, 1, (150, 3)) * [spread_m, spread_m, np.pi]
    lights = tuple(Light(*at, 20.0) for at in random.uniform(-2.5, 2.5, (6, 2)).tolist())
    lights = (*lights, Light(float(poses[0, 0]), -1.0, 20.0), Light(1.0, float(poses[1, 1]), 20.0))  # along the axes
    lit = set[bool]()
    for light in lights:
        answers = values(scene(poses, EPUCK, size_m=5.0, boundary="open", lights=(light,))).any(axis=1)
        to = np.array([light.x_m, light.y_m]) - poses[:, :2]
        length = np.hypot(*to.T)
        apart = poses[None, :, :2] - poses[:, None, :2]  # vectors from robot i to robot j
        share = np.clip((apart * to[:, None]).sum(2) / (length**2)[:, None], 0.0, 1.0)
        gap = np.hypot(*(apart - share[..., None] * to[:, None]).transpose(2, 0, 1)) + np.eye(len(poses))
        assert np.array_equal(answers, gap.min(axis=1) > EPUCK.radius_m)
        lit |= set(answers.tolist())
    assert lit == {True, False}


def scanned(poses: Any, spec: ScanSpec, tick: int = 0, **more: Any) -> FloatArray:
    return read(scene(poses, FOOTBOT, **more), FOOTBOT, "scan", spec, tick)["scan.range_m"]


def test_scan_rays_have_the_angles_of_the_sheet() -> None:
    assert np.rad2deg(ScanSpec(rays=4, range_m=1.0).angle_rad) == pytest.approx([0.0, 90.0, 180.0, -90.0])
    half = ScanSpec(rays=5, range_m=1.0, first_deg=-90.0, span_deg=180.0)
    assert np.rad2deg(half.angle_rad) == pytest.approx([-90.0, -45.0, 0.0, 45.0, 90.0])


def test_scan_reads_range_min_when_too_near_and_inf_beyond() -> None:
    poses = [[0.0, 0.0, 0.0], [0.2, 0.0, 0.0]]
    spec = ScanSpec(rays=2, range_m=1.0, range_min_m=0.12)
    assert scanned(poses, spec, boundary="open").tolist() == [[0.12, np.inf], [np.inf, 0.12]]


def test_lost_scan_ray_reads_inf() -> None:
    readings = scanned([[0.0, 0.0, 0.0]] * 1, ScanSpec(rays=360, range_m=3.5, drop_out=0.5), size_m=4.0)
    assert 0.4 < np.mean(np.isinf(readings)) < 0.6
