"""Vicsek's model: one tick of the loop is one step of the model, of which an independent form stands here."""

from pathlib import Path

import numpy as np
import pytest

from swarmwire.agent.behaviours import Vicsek
from swarmwire.agent.testing import Trial, assert_rows_independent
from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.draws import derive_key, purpose, uniform
from swarmwire.deploy import Simulation, run

PAPER = Path(__file__).parents[4] / "scenarios" / "papers" / "scenarios" / "vicsek.toml"
SIDE_M, RANGE_M, WAY_M = 5.0, 1.0, 0.03
SHORT = ["duration_s=20"]


def wrapped(x: FloatArray, side: float) -> FloatArray:
    return x - side * np.round(x / side)


def neighbours(place_m: FloatArray, range_m: float) -> FloatArray:
    """1 where two of the particles (n, 2) are in range on the torus, each of itself, too; (n, n)."""
    apart = wrapped(place_m[:, None, :] - place_m[None, :, :], SIDE_M)
    return (np.hypot(apart[..., 0], apart[..., 1]) <= range_m).astype(np.float64)


def next_step(
    place_m: FloatArray, theta: FloatArray, noise: FloatArray, way_m: float = WAY_M
) -> tuple[FloatArray, ...]:
    """Vicsek et al. (1995), equations 1 and 2: places and directions one step on, both from those of now."""
    near = neighbours(place_m, RANGE_M)
    mean = np.arctan2(near @ np.sin(theta), near @ np.cos(theta))
    moved = place_m + way_m * np.stack([np.cos(theta), np.sin(theta)], axis=1)
    return wrapped(moved, SIDE_M), mean + noise


def noise_of(simulation: Simulation, tick: int, noise_rad: float) -> FloatArray:
    """What the particles draw in a tick, by the keys of their draws."""
    keys = np.array([derive_key("robot", simulation.static.seeds[0], i) for i in range(100)], np.uint64)
    return noise_rad * (uniform(keys, tick, 0, 0, purpose("noise of the direction")) - 0.5)


def off(a: FloatArray, b: FloatArray) -> float:
    return float(np.abs(wrapped(a - b, 2.0 * np.pi)).max())


@pytest.mark.parametrize("noise_rad", [0.0, 1.0, 5.0])
def test_a_tick_is_a_step_of_the_model_for_the_same_noise(noise_rad: float) -> None:
    """But for rounding, which grows where neighbours nearly cancel."""
    with Simulation(PAPER, overrides=[*SHORT, f"robots.particles.params.noise_rad={noise_rad}"]) as simulation:
        world = simulation.world
        place_m = world.pose[:, :2].copy()
        # Nothing is received in the first tick, so it only turns each by its noise.
        theta = world.pose[:, 2] + noise_of(simulation, 0, noise_rad)
        for tick in range(20):
            simulation.step()
            assert off(world.pose[:, 2], theta) < 1e-7  # the heading at a tick's end is the direction of its step
            place_m, theta = next_step(place_m, theta, noise_of(simulation, tick + 1, noise_rad))
            assert np.abs(wrapped(world.pose[:, :2] - place_m, SIDE_M)).max() < 1e-7
    assert np.count_nonzero(neighbours(place_m, RANGE_M)) > 300  # of 100 that would hear themselves alone


def test_rows_are_independent() -> None:
    assert_rows_independent(Vicsek, Trial(body="point"))


def order(noise_rad: float, range_m: float, ticks: int = 400, count: int = 100) -> float:
    """The mean order over the second half of a run."""
    given = {"duration_s": ticks, "robots.particles.params.noise_rad": noise_rad, "radio.range_m": range_m}
    given["robots.particles.count"] = count
    seen: list[float] = []
    with Simulation(PAPER, overrides=[f"{key}={value}" for key, value in given.items()]) as simulation:
        for _ in range(ticks):
            simulation.step()
            heading = simulation.world.pose[:, 2]
            seen.append(float(np.hypot(np.cos(heading).mean(), np.sin(heading).mean())))
    return float(np.mean(seen[ticks // 2 :]))


def test_where_all_hear_all_the_order_is_that_of_the_noise_alone() -> None:
    """Each is off the common direction by its own noise: 60 independent ticks, so 5 standard errors allow for luck."""
    mean, across = np.sin(0.5) / 0.5, 0.5 * (1.0 - np.sin(1.0))
    along = 0.5 * (1.0 + np.sin(1.0)) - mean**2
    expected = mean + across / (2.0 * 100 * mean)
    assert order(1.0, 4.0, 120) == pytest.approx(expected, abs=5.0 * np.sqrt(along / 100 / 60) + 1e-3)


def test_a_lost_packet_counts_for_nothing() -> None:
    """So with every packet lost nobody turns but by noise, of which there is none."""
    told = run(PAPER, overrides=[*SHORT, "robots.particles.params.noise_rad=0", "radio.loss=1"])
    metric = told.metrics["order"]
    assert metric.min == pytest.approx(metric.max, abs=1e-12)
