"""Photocells answer by ARGoS's law to the lights in sight, and robots and obstacles cast shadows."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.body import Body, load_body
from swarmwire.comms.draws import purpose, uniform
from swarmwire.comms.truth import Light, Obstacle
from swarmwire.world.sensors.pipeline import Staged
from swarmwire.world.sensors.sensor import Scene
from tests.support.world.scenes import scene, staged

EPUCK, FOOTBOT = load_body("epuck"), load_body("footbot")


def sensor(looked_at: Scene, body: Body, **spec: Any) -> Staged:
    assert body.light is not None
    return staged(looked_at, body, "light", replace(body.light, **spec))


def values(looked_at: Scene, body: Body = EPUCK) -> FloatArray:
    return sensor(looked_at, body, noise=0.0).read(0)["light.value"]


def law(distance_m: float, intensity_m: float, off_rad: FloatArray) -> FloatArray:
    """The law in numpy; `off_rad` between sensors and light, any turns."""
    off = np.abs(np.angle(np.exp(1j * off_rad)))
    glow = np.exp(-2.0 * distance_m / intensity_m) if distance_m <= 2.5 * intensity_m else 0.0
    return glow * np.where(off < np.pi / 2, 1.0 - 2.0 * off / np.pi, 0.0)


def test_an_epuck_answers_to_a_light_ahead_as_the_law_says() -> None:
    seen = values(scene([[0.0, 0.0, 0.0]], EPUCK, lights=(Light(1.0, 0.0, 2.0),)))[0]
    near, side = 0.75 * np.exp(-1.0), 0.25 * np.exp(-1.0)  # at 22.5 and 67.5 degrees
    assert seen == pytest.approx([near, side, 0, 0, 0, 0, side, near])


def test_a_footbot_s_cells_answer_within_a_quarter_turn() -> None:
    seen = values(scene([[0.0, 0.0, np.deg2rad(7.5)]], FOOTBOT, lights=(Light(0.0, 0.5, 1.0),)), FOOTBOT)[0]
    assert FOOTBOT.light is not None
    off = np.deg2rad(FOOTBOT.light.angles_deg) + np.deg2rad(7.5) - np.pi / 2
    assert seen == pytest.approx(law(0.5, 1.0, off))
    assert np.count_nonzero(seen > 1e-9) == 11  # of the 13 nearest cells, the two at the ends look a quarter away


@pytest.mark.parametrize(("distance_m", "lit"), [(2.4999, True), (2.5001, False)])
def test_a_light_is_dark_beyond_two_and_a_half_of_its_intensity(distance_m: float, lit: bool) -> None:
    seen = values(scene([[0.0, 0.0, 0.0]], EPUCK, lights=(Light(0.0, distance_m, 1.0),)))
    assert bool(seen.any()) is lit
    assert not values(scene([[0.0, 0.0, 0.0]], EPUCK)).any()


def test_lights_add_up_to_one_at_most() -> None:
    one, other = Light(1.0, 0.3, 2.0), Light(-0.4, 1.0, 1.5)
    both, first, second = (values(scene([[0, 0, 0.4]], EPUCK, lights=of)) for of in ((one, other), (one,), (other,)))
    assert both == pytest.approx(first + second)
    bright = values(scene([[0, 0, 0]], EPUCK, lights=(Light(0.01, 0.0, 5.0),) * 3))
    assert bright.max() == 1.0


@given(turn=st.floats(-20, 20), heading=st.floats(-20, 20))
def test_only_the_angle_between_heading_and_light_counts(turn: float, heading: float) -> None:
    lit = (Light(float(np.cos(turn)), float(np.sin(turn)), 2.0),)
    assert EPUCK.light is not None
    expected = law(1.0, 2.0, turn - heading - EPUCK.light.angle_rad)
    assert values(scene([[0, 0, heading]], EPUCK, lights=lit))[0] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    "obstacle",
    [
        Obstacle("cylinder", 0.5, 0.05, radius_m=0.1),
        Obstacle("box", 0.5, 0.0, 0.5, size_m=(0.4, 0.02)),
        Obstacle("polygon", 0.5, 0.0, points_m=((-0.1, -0.1), (0.1, -0.1), (0.0, 0.1))),
    ],
)
def test_an_obstacle_casts_a_shadow(obstacle: Obstacle) -> None:
    lit = (Light(1.0, 0.0, 2.0),)
    poses = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.8, 0.0, 0.0]]
    seen = values(scene(poses[:2], EPUCK, (obstacle,), lights=lit))
    assert not seen[0].any()
    assert seen[1].any()
    assert values(scene(poses[2:], EPUCK, (obstacle,), lights=lit)).any()


def test_a_robot_in_between_casts_a_shadow_and_none_for_itself() -> None:
    lit, radius = (Light(1.0, 0.0, 2.0),), EPUCK.radius_m
    assert not values(scene([[0, 0, 0], [0.5, 0.99 * radius, 0]], EPUCK, lights=lit))[0].any()
    assert values(scene([[0, 0, 0], [0.5, 1.01 * radius, 0]], EPUCK, lights=lit)).any(axis=1).all()
    assert values(scene([[0, 0, 0], [-0.5, 0, 0]], EPUCK, lights=lit)).any(axis=1).tolist() == [True, False]
    assert values(scene([[1.0, 0, 0]], EPUCK, lights=lit))[0].any()


@pytest.mark.parametrize("spread_m", [2.4, 5.0])
def test_shadows_are_those_of_a_search_among_all_robots(spread_m: float) -> None:
    """Robots also stand outside the arena of 5 m, which is open, in the second case."""
    random = np.random.default_rng(6)
    poses = random.uniform(-1, 1, (150, 3)) * [spread_m, spread_m, np.pi]
    lights = tuple(Light(*at, 20.0) for at in random.uniform(-2.5, 2.5, (6, 2)).tolist())
    lights = (*lights, Light(float(poses[0, 0]), -1.0, 20.0), Light(1.0, float(poses[1, 1]), 20.0))  # along the axes
    lit = set[bool]()
    for light in lights:
        seen = values(scene(poses, EPUCK, size_m=5.0, boundary="open", lights=(light,))).any(axis=1)
        to = np.array([light.x_m, light.y_m]) - poses[:, :2]
        length = np.hypot(*to.T)
        apart = poses[None, :, :2] - poses[:, None, :2]  # from robot i to robot j
        share = np.clip((apart * to[:, None]).sum(2) / (length**2)[:, None], 0.0, 1.0)
        gap = np.hypot(*(apart - share[..., None] * to[:, None]).transpose(2, 0, 1)) + np.eye(len(poses))
        assert np.array_equal(seen, gap.min(axis=1) > EPUCK.radius_m)
        lit |= set(seen.tolist())
    assert lit == {True, False}


def test_light_noise_is_uniform_keyed_and_clipped() -> None:
    poses = np.stack([np.linspace(-4, 4, 20), np.zeros(20), np.zeros(20)], axis=1)
    noisy = sensor(scene(poses, EPUCK), EPUCK)
    told = noisy.read(3)["light.value"]
    draw = uniform(7, np.arange(20)[:, None], 3, np.arange(8), purpose("light.value noise"))
    assert told == pytest.approx(np.maximum(0.05 * (2.0 * draw - 1.0), 0.0))
    assert np.array_equal(told, noisy.read(3)["light.value"])
    assert not np.array_equal(told, noisy.read(4)["light.value"])
    assert told.flags.c_contiguous
