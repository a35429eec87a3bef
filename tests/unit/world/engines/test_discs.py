"""The engine of discs."""

from typing import Any

import numpy as np
import pytest

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.geometry.obstacle_index import obstacles_within
from swarmwire.comms.base.geometry.obstacles import obstacle_arrays
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.world.engines.discs import engine as discs_engine
from swarmwire.world.engines.discs.contacts import gap_to_polygon
from swarmwire.world.engines.discs.engine import DiscsEngine
from swarmwire.world.engines.discs.neighbours import FixedIndex, fixed_near, pairs_near
from swarmwire.world.engines.discs.records import CIRCLE, POLYGON, ROBOT_RECORD, Fixed
from swarmwire.world.engines.discs.step import sine_cosine
from swarmwire.world.engines.engine import Engine
from tests.support.world.engines.conformance import FLOOR, Make, R, build_engine, packed, targets
from tests.support.world.scenes import rim

N = 80
RADIUS_M = np.where(np.arange(N) % 2, R, 0.6 * R)
MASS_KG = np.where(np.arange(N) % 2, 1.6, 0.3)


def random_obstacles(n: int, side_m: float, seed: int) -> tuple[Obstacle, ...]:
    """Cylinders, boxes and triangles anywhere, some beyond the border."""
    rng = np.random.default_rng(seed)
    obstacles: list[Obstacle] = []
    for k in range(n):
        x, y = rng.uniform(-0.55 * side_m, 0.55 * side_m, 2)
        size = rng.uniform(0.05, 0.5, 2)
        triangle = ((-size[0], 0.0), (size[0], -0.02), (0.0, size[1]))
        kinds = (
            Obstacle("cylinder", x, y, radius_m=size[0]),
            Obstacle("box", x, y, k, size_m=(size[0], size[1])),
            Obstacle("polygon", x, y, k, points_m=triangle, height_m=0.1),
        )
        obstacles.append(kinds[k % 3])
    return tuple(obstacles)


def test_gap_to_a_polygon_is_the_distance_to_its_nearest_point() -> None:
    rng = np.random.default_rng(3)
    for obstacle in random_obstacles(60, 4.0, 1):
        if obstacle.shape == "cylinder":
            continue
        arrays = obstacle_arrays(((obstacle,),))
        points = rim(obstacle)
        for x, y in np.array([obstacle.x_m, obstacle.y_m]) + rng.uniform(-1.0, 1.0, (20, 2)):
            gap_m, nx, ny = gap_to_polygon(x, y, 0.1, 0, arrays.side_start, arrays.side)
            away = points - [x, y]
            nearest = np.hypot(*away.T).min()
            inside = (arrays.side[:, 2] * x + arrays.side[:, 3] * y <= arrays.side[:, 4]).all()
            assert gap_m + 0.1 == pytest.approx(-nearest if inside else nearest, abs=1e-3)
            assert np.hypot(nx, ny) == pytest.approx(1.0)
            # The nearest point lies along the normal, or, from inside, against it.
            foot = np.array([x, y]) + (gap_m + 0.1) * np.array([nx, ny])
            assert np.hypot(*(points - foot).T).min() < 1e-3


@pytest.mark.parametrize("margin_m", [0.01, 0.2])
def test_neighbour_lists_equal_a_brute_force_search(margin_m: float) -> None:
    rng = np.random.default_rng(5)
    n, arenas, side_m = 60, 3, 4.0
    obstacles = tuple(random_obstacles(20 + 7 * arena, side_m, arena) for arena in range(arenas))
    arrays = obstacle_arrays(obstacles)
    state = np.zeros((arenas * n, 6))
    state[:, :2] = rng.uniform(-0.7 * side_m, 0.7 * side_m, (arenas * n, 2))  # some are outside the open arena
    robots = np.zeros(arenas * n, ROBOT_RECORD)
    robots["radius_m"] = np.tile(rng.uniform(0.03, 0.15, n), arenas)
    robots["bottom_m"] = np.tile(np.where(np.arange(n) % 2, 0.0, 0.1), arenas)
    radius_m = robots["radius_m"]

    running = np.arange(arenas) != 1
    pairs = pairs_near(robots, state, running, (side_m, side_m), 0.15, margin_m)
    apart = np.hypot(*(state[:, None, :2] - state[:, :2]).transpose(2, 0, 1)) - radius_m[:, None] - radius_m
    row = np.arange(arenas * n)
    together = (row[:, None] // n == row // n) & running[row // n]
    expected = np.argwhere((apart <= 2.0 * margin_m) & (row[:, None] < row) & together)
    assert np.array_equal(pairs, expected)

    cells = obstacles_within(arrays, (side_m, side_m), 0.15 + margin_m, torus=False).cells
    fixed = Fixed((0.5 * side_m, 0.5 * side_m), arrays.circle, arrays.side_start, arrays.side)
    index = FixedIndex(fixed, False, arrays.circle_top_m, arrays.polygon_top_m, cells)
    fixed_pairs = fixed_near(robots, state, running, index, margin_m)
    listed = {tuple(pair) for pair in fixed_pairs.tolist()}
    count = {CIRCLE: 0, POLYGON: 0}
    for arena, in_arena in enumerate(obstacles):
        for obstacle in in_arena:
            kind = CIRCLE if obstacle.shape == "cylinder" else POLYGON
            k = count[kind]
            count[kind] += 1
            points = rim(obstacle)
            for i in range(arena * n, (arena + 1) * n):
                gap_m = np.hypot(*(points - state[i, :2]).T).min() - radius_m[i]
                if obstacle.height_m <= robots["bottom_m"][i] or not running[arena]:
                    assert (i, kind, k) not in listed
                elif gap_m <= margin_m - 1e-3:
                    assert (i, kind, k) in listed
    assert fixed_pairs[:, 0].tolist() == sorted(fixed_pairs[:, 0].tolist())


def test_neighbour_list_margin_changes_no_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    side_m = 2.2
    ends: list[FloatArray] = []
    for margin in (0.06, 0.3, 3.0):
        monkeypatch.setattr(discs_engine, "MARGIN", margin)
        engine = build_engine(DiscsEngine, packed(50, side_m, R, 8), (side_m, side_m))
        rng = np.random.default_rng(9)
        onsets = np.zeros((1, 2), np.int64)
        for _ in range(100):
            onsets += engine.tick(targets(engine, rng.uniform(0.0, 0.2, 50), rng.normal(0.0, 1.0, 50)))
        ends.append(np.concatenate([engine.state.ravel(), engine.travel_m.ravel(), onsets.ravel()]))
    assert np.array_equal(ends[0], ends[1])
    assert np.array_equal(ends[0], ends[2])


def test_robots_among_hundreds_of_pillars_stay_outside_them() -> None:
    """Robots drive about between the pillars, never in them."""
    pillars = [
        Obstacle("box", x, y, 0.5, size_m=(0.1, 0.1)) for x in np.arange(-4, 5, 0.5) for y in np.arange(-4, 5, 0.5)
    ]
    positions = np.stack(np.meshgrid(np.arange(-3.75, 4, 0.5), np.arange(-3.75, 4, 0.5)), axis=-1).reshape(-1, 2)
    rng = np.random.default_rng(2)
    pose = np.column_stack([positions, rng.uniform(-np.pi, np.pi, len(positions))])
    engine = build_engine(DiscsEngine, pose, (10.0, 10.0), obstacles=pillars)
    arrays = obstacle_arrays((tuple(pillars),))
    onsets = np.zeros((1, 2), np.int64)
    for _ in range(40):
        onsets += engine.tick(targets(engine, 0.3))
    gaps = [
        min(gap_to_polygon(x, y, R, k, arrays.side_start, arrays.side)[0] for k in range(len(pillars)))
        for x, y in engine.state[0, :30, :2]
    ]
    assert onsets[0, 1] > 100
    assert min(gaps) > -0.002 * R


def energy_j(engine: Engine, mass_kg: Any, radius_m: Any) -> float:
    """Kinetic energy of all robots, turning included."""
    vx, vy, turn = engine.state[:, :, 3:].transpose(2, 0, 1)
    return float((0.5 * mass_kg * (vx**2 + vy**2 + 0.5 * (radius_m * turn) ** 2)).sum())


def thrown(packing: float, seed: int, steps: int, **more: Any) -> Engine:
    """A crowd without motors, thrown about."""
    side_m = float(np.sqrt(N * np.pi * R**2 / packing))
    pose = packed(N, side_m, R, seed)
    motors = {"max_force_n": 0.0, "max_torque_nm": 0.0, "radius_m": RADIUS_M, "mass_kg": MASS_KG}
    engine = build_engine(DiscsEngine, pose, (side_m, side_m), steps=steps, **motors, **more)
    rng = np.random.default_rng(seed)
    engine.state[0, :, 3:5] = rng.normal(0.0, 0.3, (N, 2))
    engine.state[0, :, 5] = rng.normal(0.0, 3.0, N)
    return engine


@pytest.mark.parametrize("packing", [0.2, 0.6])
@pytest.mark.parametrize("steps", [1, 5])
@pytest.mark.parametrize("seed", [1, 2])
def test_crowd_without_motors_never_gains_energy(packing: float, steps: int, seed: int) -> None:
    engine = thrown(packing, seed, steps)
    energies = [energy_j(engine, MASS_KG, RADIUS_M)]
    for _ in range(60):
        engine.tick(targets(engine))
        energies.append(energy_j(engine, MASS_KG, RADIUS_M))
    assert (np.diff(energies) <= 1e-12 * energies[0]).all()
    assert energies[-1] < 0.5 * energies[0]


@pytest.mark.parametrize("make", FLOOR)
def test_braking_crowd_never_gains_energy(make: Make) -> None:
    """The motors are too weak to stop at once: contacts take most of the energy."""
    side_m = float(np.sqrt(N * np.pi * R**2 / 0.4))
    engine = build_engine(make, packed(N, side_m, R, 4), (side_m, side_m), max_force_n=0.16, max_torque_nm=1e-3)
    for _ in range(40):
        engine.tick(targets(engine, 0.3))
    engine.braked[:] = True
    energies = [energy_j(engine, 1.6, R)]
    for _ in range(40):
        engine.tick(targets(engine))
        energies.append(energy_j(engine, 1.6, R))
    assert energies[0] > 0.0
    # Overlaps at the moment when the motors stop may still return a little energy.
    assert (np.diff(energies) <= 1e-3 * energies[0]).all()
    assert energies[-1] < 0.1 * energies[0]


def momentum(engine: Engine) -> FloatArray:
    """Linear momentum, and angular momentum about the origin."""
    x, y, _, vx, vy, turn = engine.state[0].T
    spin = MASS_KG * (x * vy - y * vx + 0.5 * RADIUS_M**2 * turn)
    return np.array([(MASS_KG * vx).sum(), (MASS_KG * vy).sum(), spin.sum()])


def test_momentum_is_conserved_in_contacts() -> None:
    """Linear momentum in an open arena; angular momentum but for the gaps across which robots brake each other."""
    engine = thrown(0.6, 3, 5, boundary="open")
    before = momentum(engine)
    size = np.abs(MASS_KG * np.hypot(engine.state[0, :, 3], engine.state[0, :, 4])).sum()
    onsets = sum(engine.tick(targets(engine)) for _ in range(30))
    assert np.array(onsets)[0, 0] > 50
    after = momentum(engine)
    assert after[:2] == pytest.approx(before[:2], abs=1e-12 * size)
    assert after[2] == pytest.approx(before[2], abs=0.01 * size)


@pytest.mark.parametrize("aside_m", [0.0, 0.02, 0.05])
def test_dead_robot_is_pushed_equally_far_in_both_engines(aside_m: float) -> None:
    ends: list[list[float]] = []
    for make in FLOOR:
        engine = build_engine(make, [[0.0, aside_m, 0.0], [2.0 * R + 0.05, 0.0, 1.0]], (6.0, 4.0))
        engine.braked[0, 1] = True
        for _ in range(100):
            engine.tick(targets(engine, [0.2, 0.0]))
        ends.append(engine.state[0, :, :2].ravel().tolist())
    assert ends[0] == pytest.approx(ends[1], abs=0.02)
    assert ends[0][2] > 2.0 * R + 0.2


@pytest.mark.parametrize("heading", [0.2, 0.5, 0.9, 1.2])
def test_robot_slides_equally_far_along_a_wall_in_both_engines(heading: float) -> None:
    ends: list[list[float]] = []
    for make in FLOOR:
        engine = build_engine(make, [[0.0, 1.7, heading]], (6.0, 4.0))
        for _ in range(60):
            engine.tick(targets(engine, 0.2))
        ends.append([*engine.state[0, 0, :3].tolist(), *engine.travel_m[0, 0].tolist()])
    assert ends[0] == pytest.approx(ends[1], abs=0.01)


def test_sine_and_cosine_equal_numpy_within_rounding() -> None:
    rng = np.random.default_rng(1)
    eighths = np.arange(-64, 65) * np.pi / 4
    for angles in (rng.uniform(-4.0, 4.0, 3000), rng.uniform(-1e4, 1e4, 3000), eighths, rng.normal(0.0, 1e-9, 100)):
        both = np.array([sine_cosine(angle) for angle in angles])
        assert np.abs(both - np.stack([np.sin(angles), np.cos(angles)], axis=1)).max() < 3e-16
    assert np.abs(np.array(sine_cosine(1e6)) - [np.sin(1e6), np.cos(1e6)]).max() < 1e-13
