"""Sensors with rays: infrared, light, scans."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.observe.truth import Light
from swarmwire.comms.robot.bodies.body import Body, load_body
from swarmwire.comms.robot.sensors.scan import ScanSpec
from swarmwire.world.sensors.pipeline import SensorPipeline
from swarmwire.world.sensors.sensor import Scene
from swarmwire.world.world import World
from tests.support.world.scenes import posed, read, scene, staged

EPUCK = load_body("epuck")
FOOTBOT = load_body("footbot")


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
