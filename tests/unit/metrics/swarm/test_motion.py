"""How robots move and are ordered, and how a swarm stands around its centroid: formulas and known values."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from swarmwire.metrics.measures.swarm.motion import Oscillation
from swarmwire.metrics.measures.swarm.order import OrderLocal
from tests.support.metrics.swarms import away_m, last_values, measure, rolled, stand, swarms
from tests.support.metrics.truths import measured, poses, static, truth


def speed(velocity, **fields) -> float:
    run = static(len(velocity))
    return measured("speed", run, truth(run, velocity=np.array(velocity, float), **fields))[0]


def test_speed_is_the_mean_over_robots_in_any_direction():
    assert speed([[0.3, 0.4, 0.0], [-0.1, 0.0, 0.0], [0.0, 0.0, 9.0]]) == pytest.approx(0.2)


def efficiency(position, alive=None, boundary="open", arenas=1):
    """What is told at the last of ticks with places (ticks, rows, 2)."""
    swarms = [stand(*tick, boundary=boundary, arenas=arenas) for tick in np.asarray(position, float)]
    alive = np.ones((len(swarms), len(swarms[0].pose)), np.bool_) if alive is None else alive
    ticks = [
        replace(swarm, alive=living).truth(tick) for tick, (swarm, living) in enumerate(zip(swarms, alive, strict=True))
    ]
    return last_values("path_efficiency", *ticks, run=swarms[0].static)


def test_path_efficiency_of_line_return_and_half_circle_is_known():
    straight = np.linspace([0.0, 0.0], [3.0, 4.0], 201)
    angle = np.linspace(0.0, np.pi, 201)
    half = np.column_stack([np.cos(angle), np.sin(angle)])
    assert efficiency(straight[:, None]) == [pytest.approx(1.0)]
    assert efficiency(np.concatenate([straight, straight[::-1]])[:, None]) == [pytest.approx(0.0, abs=1e-12)]
    assert efficiency(half[:, None]) == [pytest.approx(2.0 / np.pi, rel=1e-4)]


def test_path_efficiency_of_a_random_walk_has_the_known_mean():
    """sqrt(pi / (4 n)) of n steps, as the order of n headings at random; its variance is below 0.22 / n.

    5 standard errors of 500 walks: false alarm 6e-7.
    """
    walks, steps = 500, 100
    turn = np.random.default_rng(1).uniform(-np.pi, np.pi, (steps, walks))
    position = np.concatenate([np.zeros((1, walks, 2)), np.cumsum(np.stack([np.cos(turn), np.sin(turn)], -1), axis=0)])
    assert efficiency(position) == [pytest.approx(0.0887, abs=5 * np.sqrt(0.22 / steps / walks) + 5e-5)]


@given(st.integers(0, 1000), st.integers(1, 20), st.sampled_from(["open", "torus"]))
def test_path_efficiency_is_that_of_the_formula(seed, ticks, boundary):
    rng = np.random.default_rng(seed)
    unrolled = np.cumsum(rng.normal(0.0, rng.choice([0.5, 0.003]), (ticks, 6, 2)), axis=0)
    alive = rng.random((ticks, 6)) < rng.choice([1.0, 0.6, 0.1])
    values = []
    for own in (slice(0, 3), slice(3, 6)):
        shares = []
        for robot in np.arange(6)[own]:
            length_m = sum(np.hypot(*step) for step in np.diff(unrolled[:, robot], axis=0))
            if alive[-1, robot] and length_m >= 0.01:
                shares.append(np.hypot(*(unrolled[-1, robot] - unrolled[0, robot])) / length_m)
        values.append(np.mean(shares) if shares else np.nan)
    position = rolled(unrolled) if boundary == "torus" else unrolled
    efficiencies = efficiency(position, alive, boundary, arenas=2)
    assert efficiencies == pytest.approx(values, rel=1e-6, nan_ok=True)
    assert all(np.isnan(value) or 0.0 <= value <= 1.0 for value in efficiencies)


PER_MIN = 60 * 10  # ticks


def oscillation(turn_radps, alive=None, arenas=1, **parameters):
    """What is told at the last of ticks with these turning commands, (ticks, rows)."""
    turn = np.asarray(turn_radps, float)
    alive = np.ones(turn.shape, np.bool_) if alive is None else alive
    run = static(turn.shape[1] // arenas, arenas=arenas)
    command = np.stack([0 * turn, turn, 0 * turn], axis=-1)
    ticks = [truth(run, tick, command=command[tick], alive=alive[tick]) for tick in range(len(turn))]
    return last_values(Oscillation(**parameters), *ticks, run=run)


@pytest.mark.parametrize(
    ("turn_radps", "dead_band_radps", "changes_per_tick"),
    [
        ([1.0, -1.0, 1.0, -1.0], 0.05, 3 / 4),
        ([1.0, 0.0, 1.0, -0.04, 0.3], 0.05, 0.0),
        ([1.0, 0.0, 0.0, -1.0], 0.05, 1 / 4),  # going straight in between does not hide a change
        ([0.2, -0.2], 0.2, 0.0),
        ([0.2, -0.2], 0.1, 1 / 2),
    ],
)
def test_changes_of_side_beyond_the_dead_band_count(turn_radps, dead_band_radps, changes_per_tick):
    rates = oscillation([[turn] for turn in turn_radps], dead_band_radps=dead_band_radps)
    assert rates == [pytest.approx(changes_per_tick * PER_MIN)]


@given(st.integers(0, 1000), st.integers(1, 25))
def test_oscillation_is_that_of_the_definition(seed, ticks):
    rng = np.random.default_rng(seed)
    turn, alive = rng.normal(0.0, 0.1, (ticks, 6)), rng.random((ticks, 6)) < rng.choice([1.0, 0.8, 0.1])
    values = []
    for own in (slice(0, 3), slice(3, 6)):
        changes = 0
        for robot in np.arange(6)[own]:
            sides = ("0" if abs(w) <= 0.05 else "+" if w > 0 else "-" for w in turn[:, robot])
            lives = "".join(side if alive[k, robot] else " " for k, side in enumerate(sides)).replace("0", "").split()
            changes += sum(life.count("+-") + life.count("-+") for life in lives)
        living = np.count_nonzero(alive[:, own])
        values.append(changes / living * PER_MIN if living else np.nan)
    assert oscillation(turn, alive=alive, arenas=2) == pytest.approx(values, nan_ok=True)


@pytest.mark.parametrize(
    ("heading_rad", "exact"),
    [([0.7] * 9, 1.0), ([0.3, 0.3 + np.pi, -1.0, -1.0 - np.pi], 0.0), ([0.0, np.pi / 2], np.sqrt(0.5))],
)
def test_headings_that_agree_cancel_or_stand_at_a_right_angle_have_the_known_order(heading_rad, exact):
    run = static(len(heading_rad))
    assert measured("order", run, truth(run, pose=poses(heading_rad))) == [pytest.approx(exact, abs=1e-15)]


@pytest.mark.parametrize(("robots", "exact"), [(5, 0.402), (10, 0.282), (40, 0.1404), (100, 0.0887), (400, 0.0445)])
def test_headings_at_random_have_the_known_mean_order(robots, exact):
    """E[order^2] = 1/N gives a variance below 0.22/N; 5 standard errors of 2000 samples: false alarm 6e-7."""
    samples = 2000
    run = static(robots, arenas=samples)
    heading_rad = np.random.default_rng(1).uniform(-np.pi, np.pi, samples * robots)
    order = np.array(measured("order", run, truth(run, pose=poses(heading_rad))))
    tolerance = 5 * np.sqrt(0.22 / robots / samples) + 0.0005  # and the rounding of the table
    assert order.mean() == pytest.approx(exact, abs=tolerance)
    assert np.square(order).mean() == pytest.approx(1 / robots, rel=5 / np.sqrt(samples))


ranges = st.sampled_from([0.1, 1.0, 3.5])


@given(swarms(), ranges)
def test_local_order_is_that_of_the_formula(swarm, range_m):
    values = []
    for pose, _ in swarm.arenas:
        near = swarm.apart_m(pose) < range_m
        means = []
        for i in range(len(pose)):
            others = [j for j in range(len(pose)) if j != i and near[i, j]]
            means.append(np.mean([np.cos(pose[i, 2] - pose[j, 2]) for j in others]) if others else 1.0)
        values.append(np.mean(means) if means else np.nan)
    assert measure(OrderLocal(range_m=range_m), swarm) == pytest.approx(values, abs=1e-12, nan_ok=True)


def test_headings_at_random_have_no_local_order():
    """A mean of 400 x 190 cosines of pairs, variance 1/2 each and uncorrelated: 5 standard errors, false alarm 6e-7."""
    rng, arenas, robots = np.random.default_rng(1), 400, 20
    pose = np.column_stack([np.zeros((arenas * robots, 2)), rng.uniform(-np.pi, np.pi, arenas * robots)])
    order = np.array(measure("order_local", stand(*pose, arenas=arenas)))
    assert order.mean() == pytest.approx(0.0, abs=5 * np.sqrt(0.5 / (arenas * robots * (robots - 1) / 2)))


def order_of_velocities(*velocity):
    run = static(len(velocity))
    table = np.zeros((len(velocity), 3))
    table[:, :2] = velocity
    return measured("order_velocity", run, truth(run, velocity=table))[0]


def test_robots_count_by_their_speed():
    assert order_of_velocities((0.1, 0.1), (0.2, 0.2), (0.0, 0.0)) == pytest.approx(1.0)
    assert order_of_velocities((0.3, 0.0), (-0.1, 0.0)) == pytest.approx(0.5)
    assert order_of_velocities((0.1, 0.0), (0.0, 0.1)) == pytest.approx(np.sqrt(0.5))
    assert order_of_velocities((0.0, 0.0), (0.0, 0.0)) == 0.0


@given(swarms())
def test_cohesion_is_the_largest_distance_to_the_centroid(swarm):
    values = [np.hypot(*away_m(swarm, pose).T).max() if len(pose) else np.nan for pose, _ in swarm.arenas]
    assert measure("cohesion", swarm) == pytest.approx(values, abs=1e-9, nan_ok=True)


@pytest.mark.parametrize("name", ["cohesion", "dispersion", "rotation"])
def test_places_spread_evenly_over_a_torus_have_no_centroid(name):
    at = (-4, 0), (-2, 0), (0, 0), (2, 0)
    assert np.isnan(measure(name, stand(*at, boundary="torus"))).all()
    assert np.isfinite(measure(name, stand(*at))).all()


RADIUS_M = stand((0, 0)).static.groups[0].body.radius_m


def hexagon(rings, apart_m):
    """A hexagonal packing of so many rings around one robot."""
    cells = range(-rings, rings + 1)
    return [((q + 0.5 * r) * apart_m, 0.75**0.5 * r * apart_m) for q in cells for r in cells if abs(q + r) <= rings]


@given(swarms())
def test_dispersion_is_that_of_the_formula(swarm):
    values = [
        np.sum(away_m(swarm, pose) ** 2) / (4.0 * np.mean(radius_m**2)) if len(pose) else np.nan
        for pose, radius_m in swarm.arenas
    ]
    assert measure("dispersion", swarm) == pytest.approx(values, rel=1e-6, abs=1e-9, nan_ok=True)


@pytest.mark.parametrize(("rings", "least"), [(0, 0.0), (1, 6.0), (2, 48.0), (3, 186.0)])
def test_hexagonal_packing_has_its_known_second_moment(rings, least):
    """Squares of distances in diameters: 6 x 1, then 6 x 4 + 6 x 3, then 6 x 9 + 12 x 7."""
    packed = stand(*hexagon(rings, 2.0 * RADIUS_M))
    assert measure("dispersion", packed) == [pytest.approx(least, abs=1e-12)]
    assert measure("dispersion", stand(*hexagon(rings, 4.0 * RADIUS_M))) == [pytest.approx(4.0 * least, abs=1e-12)]


def ring(robots, heading_offset_rad, at=(0.0, 0.0)):
    angle = np.linspace(0.0, 2.0 * np.pi, robots, endpoint=False)
    return np.column_stack([at[0] + np.cos(angle), at[1] + np.sin(angle), angle + heading_offset_rad])


@given(swarms())
def test_rotation_is_that_of_the_formula(swarm):
    values = []
    for pose, _ in swarm.arenas:
        away = away_m(swarm, pose) if len(pose) else np.empty((0, 2))
        length_m = np.hypot(*away.T)
        # Who is nearly at the centroid is a matter of rounding.
        assume(not np.any((length_m > 1e-12) & (length_m < 1e-6)))
        unit = away / np.where(length_m > 1e-12, length_m, np.inf)[:, None]
        crosses = unit[:, 0] * np.sin(pose[:, 2]) - unit[:, 1] * np.cos(pose[:, 2])
        values.append(abs(crosses.sum()) / len(pose) if len(pose) else np.nan)
    assert measure("rotation", swarm) == pytest.approx(values, abs=1e-6, nan_ok=True)


HALF_TURNED = np.arange(12) % 2 * np.pi


@pytest.mark.parametrize(
    ("offset_rad", "exact"), [(np.pi / 2, 1.0), (-np.pi / 2, 1.0), (0.0, 0.0), (np.pi / 2 + HALF_TURNED, 0.0)]
)
def test_rotation_of_a_ring_is_one_only_if_it_mills_one_way(offset_rad, exact):
    assert measure("rotation", stand(*ring(12, offset_rad, at=(1.0, -0.5)))) == [pytest.approx(exact, abs=1e-12)]


def test_robot_at_the_centroid_adds_nothing_to_rotation():
    assert measure("rotation", stand((1.0, 1.0, 0.3))) == [0.0]
    assert measure("rotation", stand(*ring(4, np.pi / 2), (0.0, 0.0, 1.0))) == [pytest.approx(0.8)]
