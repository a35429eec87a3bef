"""What is not driven gains no energy, and what bodies give each other they take from each other."""

from typing import Any

import numpy as np
import pytest

from swarmwire.comms.arrays import FloatArray
from swarmwire.world.engines.discs.engine import DiscsEngine
from swarmwire.world.engines.engine import Engine
from tests.support.world.engines.conformance import FLOOR, Make, R, asked, made, packed

N = 80
RADIUS_M = np.where(np.arange(N) % 2, R, 0.6 * R)
MASS_KG = np.where(np.arange(N) % 2, 1.6, 0.3)


def energy_j(engine: Engine, mass_kg: Any, radius_m: Any) -> float:
    """Kinetic energy of all robots, turning included."""
    vx, vy, turn = engine.state[:, :, 3:].transpose(2, 0, 1)
    return float((0.5 * mass_kg * (vx**2 + vy**2 + 0.5 * (radius_m * turn) ** 2)).sum())


def thrown(packing: float, seed: int, steps: int, **more: Any) -> Engine:
    """A crowd without motors, thrown about."""
    side_m = float(np.sqrt(N * np.pi * R**2 / packing))
    pose = packed(N, side_m, R, seed)
    motors = {"max_force_n": 0.0, "max_torque_nm": 0.0, "radius_m": RADIUS_M, "mass_kg": MASS_KG}
    engine = made(DiscsEngine, pose, (side_m, side_m), steps=steps, **motors, **more)
    rng = np.random.default_rng(seed)
    engine.state[0, :, 3:5] = rng.normal(0.0, 0.3, (N, 2))
    engine.state[0, :, 5] = rng.normal(0.0, 3.0, N)
    return engine


@pytest.mark.parametrize("packing", [0.2, 0.6])
@pytest.mark.parametrize("steps", [1, 5])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_crowd_without_motors_loses_energy_alone(packing: float, steps: int, seed: int) -> None:
    engine = thrown(packing, seed, steps)
    energies = [energy_j(engine, MASS_KG, RADIUS_M)]
    for _ in range(60):
        engine.tick(asked(engine))
        energies.append(energy_j(engine, MASS_KG, RADIUS_M))
    assert (np.diff(energies) <= 1e-12 * energies[0]).all()
    assert energies[-1] < 0.5 * energies[0]


@pytest.mark.parametrize("make", FLOOR)
def test_a_crowd_that_brakes_loses_energy_alone(make: Make) -> None:
    """Motors too weak to stop at once: most of what is lost is lost in contacts."""
    side_m = float(np.sqrt(N * np.pi * R**2 / 0.4))
    engine = made(make, packed(N, side_m, R, 4), (side_m, side_m), max_force_n=0.16, max_torque_nm=1e-3)
    for _ in range(40):
        engine.tick(asked(engine, 0.3))
    engine.braked[:] = True
    energies = [energy_j(engine, 1.6, R)]
    for _ in range(40):
        engine.tick(asked(engine))
        energies.append(energy_j(engine, 1.6, R))
    assert energies[0] > 0.0
    # What was pressed when the motors stopped may still give a little.
    assert (np.diff(energies) <= 1e-3 * energies[0]).all()
    assert energies[-1] < 0.1 * energies[0]


def momentum(engine: Engine) -> FloatArray:
    """Linear momentum, and angular momentum about the origin."""
    x, y, _, vx, vy, turn = engine.state[0].T
    spin = MASS_KG * (x * vy - y * vx + 0.5 * RADIUS_M**2 * turn)
    return np.array([(MASS_KG * vx).sum(), (MASS_KG * vy).sum(), spin.sum()])


def test_robots_push_back_as_they_are_pushed() -> None:
    """In the open, momentum stays; that of turning but for the gaps across which robots brake each other."""
    engine = thrown(0.6, 3, 5, boundary="open")
    before = momentum(engine)
    size = np.abs(MASS_KG * np.hypot(engine.state[0, :, 3], engine.state[0, :, 4])).sum()
    onsets = sum(engine.tick(asked(engine)) for _ in range(30))
    assert np.array(onsets)[0, 0] > 50
    after = momentum(engine)
    assert after[:2] == pytest.approx(before[:2], abs=1e-12 * size)
    assert after[2] == pytest.approx(before[2], abs=0.01 * size)
