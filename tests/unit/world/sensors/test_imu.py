"""The IMU feels what the body does, in the body's frame, with a bias that stays and one that drifts."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.draws import normal, purpose
from swarmwire.comms.sensors.imu import ImuSpec
from swarmwire.world.sensors.sensor import Scene
from tests.support.world.scenes import scene, staged

EPUCK = load_body("epuck")
FIELDS = ("imu.forward_mps2", "imu.left_mps2", "imu.turn_radps")


def put(looked_at: Scene, heading, velocity) -> None:
    """All robots have this heading and velocity from now on."""
    looked_at.state[0, :, 2], looked_at.state[0, :, 3:5] = heading, velocity


def felt(headings, velocities, spec: ImuSpec | None = None, robots: int = 1):
    """What was felt last when these headings and velocities came one after another, (robots, fields)."""
    looked_at = scene(np.zeros((robots, 3)), EPUCK)
    put(looked_at, headings[0], velocities[0])
    imu = staged(looked_at, EPUCK, "imu", spec or ImuSpec())
    told = {}
    for tick, (heading, velocity) in enumerate(zip(headings, velocities, strict=True)):
        put(looked_at, heading, velocity)
        told = imu.read(tick)
    return np.stack([told[name] for name in FIELDS], axis=1)


def test_speeding_up_is_felt_ahead_and_braking_behind() -> None:
    assert felt([0.5, 0.5], [(0, 0), (0.1 * np.cos(0.5), 0.1 * np.sin(0.5))])[0] == pytest.approx([1.0, 0.0, 0.0])
    assert felt([0.5, 0.5], [(0.1 * np.cos(0.5), 0.1 * np.sin(0.5)), (0, 0)])[0] == pytest.approx([-1.0, 0.0, 0.0])


@pytest.mark.parametrize("turn_radps", [0.5, -2.0])
def test_a_robot_on_a_circle_feels_v_w_to_the_inside(turn_radps: float) -> None:
    headings = 0.7 + turn_radps * 0.1 * np.arange(3)
    told = felt(headings, 0.2 * np.stack([np.cos(headings), np.sin(headings)], axis=1))[0]
    chord = np.sinc(turn_radps * 0.1 / (2.0 * np.pi))  # the mean over the tick's arc
    assert told == pytest.approx([0.0, 0.2 * turn_radps * chord, turn_radps])


@given(turn=st.floats(-9, 9), seed=st.integers(0, 99))
def test_the_frame_of_the_arena_is_not_felt(turn: float, seed: int) -> None:
    random = np.random.default_rng(seed)
    headings, velocities = random.uniform(-3, 3, 4), random.uniform(-1, 1, (4, 2))
    c, s = np.cos(turn), np.sin(turn)
    turned = velocities @ np.array([[c, s], [-s, c]])
    assert felt(headings + turn, turned)[0] == pytest.approx(felt(headings, velocities)[0], abs=1e-9)


def test_nothing_is_felt_in_the_first_tick() -> None:
    assert not felt([0.5], [(0.1, 0.2)]).any()


def test_biases_are_drawn_once_and_drift_from_tick_to_tick() -> None:
    still, robots = [(0.0, 0.0)] * 6, np.arange(500)[:, None]
    drawn = normal(7, robots, 0, np.arange(3), purpose("imu bias"))
    biased = ImuSpec(bias_std_mps2=0.1, bias_std_radps=0.02)
    constant = felt([0.0] * 6, still, biased, 500)
    assert constant == pytest.approx(drawn * [0.1, 0.1, 0.02])
    assert np.array_equal(constant, felt([0.0], still[:1], biased, 500))
    walk = sum(normal(7, robots, tick, np.arange(3), purpose("imu drift")) for tick in range(1, 6))
    drifted = felt([0.0] * 6, still, ImuSpec(drift_mps2=0.1, drift_radps=0.02), 500)
    assert drifted == pytest.approx(walk * np.array([0.1, 0.1, 0.02]) * np.sqrt(0.1))
    # 500 draws: the standard deviation is known to 3.2 %; four of them, 1 in 16,000 for each of three.
    assert drifted.std(axis=0) == pytest.approx(np.array([0.1, 0.1, 0.02]) * np.sqrt(0.5), rel=0.127)


def test_drift_goes_on_while_nobody_looks() -> None:
    looked_at = scene(np.zeros((3, 3)), EPUCK)
    spec = ImuSpec(drift_mps2=0.1, bias_std_radps=0.1, noise_radps=0.1)
    always, seldom = (staged(looked_at, EPUCK, "imu", spec) for _ in range(2))
    for tick in range(9):
        looked_at.state[0, :, 2:5] += 0.01 * tick
        told = always.read(tick)
        if tick % 4:
            seldom.follow(tick)
        else:
            assert all(np.array_equal(told[name], values) for name, values in seldom.read(tick).items())
