"""Tasks: what robots have found and covered, and when."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.observe.truth import Light
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.measures.task.coverage import CoverageRatio, CoverageTime
from swarmwire.metrics.measures.task.target import FindTime
from tests.support.metrics.truths import in_each_tick, measured, static, truth

numbers = st.floats(-1e6, 1e6) | st.just(np.nan)


def both(run, values, alive=None):
    """Both metrics in each tick, (ticks, 2, arenas)."""
    truths = []
    for tick, value in enumerate(values):
        given_alive = {} if alive is None else {"alive": np.array(alive[tick])}
        truths.append(truth(run, tick, value=None if value is None else np.array(value, np.float64), **given_alive))
    return in_each_tick(run, truths, "consensus_error", "consensus_bias")


def test_consensus_error_is_the_deviation_of_living_robots_with_a_value():
    nan = np.nan
    alive = [[True, True, True, False]] * 3
    values = both(static(4), [None, [1.0, nan, nan, 9.0], [1.0, nan, 5.0, 9.0]], alive)
    assert values[:, 0, 0].tolist() == pytest.approx([nan, 0.0, 2.0], nan_ok=True)


@given(st.integers(1, 3), st.integers(1, 6), st.data())
def test_consensus_error_and_bias_are_those_of_numpy(arenas, robots, data):
    rows = arenas * robots
    ticks = data.draw(st.lists(st.lists(numbers, min_size=rows, max_size=rows), min_size=1, max_size=4))
    alive = [data.draw(st.lists(st.booleans() | st.just(True), min_size=rows, max_size=rows)) for _ in ticks]
    measures, first = both(static(robots, arenas), ticks, alive), {}
    for tick, values in enumerate(ticks):
        first = {row: value for row, value in enumerate(values) if not np.isnan(value)} | first
        for arena in range(arenas):
            own = range(arena * robots, (arena + 1) * robots)
            living = [values[row] for row in own if alive[tick][row] and not np.isnan(values[row])]
            began = [first[row] for row in own if row in first]
            expected = [np.std(living), np.mean(living) - np.mean(began)] if living else [np.nan, np.nan]
            assert measures[tick, :, arena].tolist() == pytest.approx(expected, rel=1e-9, abs=1e-8, nan_ok=True)


def test_disagreement_along_the_second_eigenvector_dies_out_at_the_rate_of_its_eigenvalue():
    """On a ring of n, x' = (I - eps L) x shrinks a wave once around it by 1 - eps 2 (1 - cos 2 pi / n) a step."""
    n, eps = 12, 0.2
    wave = np.cos(2 * np.pi * np.arange(n) / n)
    steps = [5.0 + wave]
    for _ in range(20):
        x = steps[-1]
        steps.append(x + eps * (np.roll(x, 1) + np.roll(x, -1) - 2 * x))
    error, bias = both(static(n), steps)[:, :, 0].T
    rate = 1 - eps * 2 * (1 - np.cos(2 * np.pi / n))
    np.testing.assert_allclose(error, np.sqrt(0.5) * rate ** np.arange(21), rtol=1e-9)
    np.testing.assert_allclose(bias, 0.0, atol=1e-12)


LIGHTS_OF_ARENAS = [[Light(2.0, 0.0, 1.0), Light(-3.0, 0.0, 1.0)], [Light(0.0, 0.0, 1.0)], []]


def find_times(x_m, alive=None, within_m=0.5, lights=LIGHTS_OF_ARENAS, share=0.0, robots=2):
    """The metric in each tick, of robots at x (ticks, rows) in arenas of so many."""
    run = static(robots, arenas=len(x_m[0]) // robots, lights=lights)
    metrics, values = Metrics([FindTime(within_m=within_m, share=share)]), []
    metrics.begin(run)
    for tick, at in enumerate(x_m):
        pose = np.zeros((len(at), 3))
        pose[:, 0] = at
        living = np.ones(len(at), np.bool_) if alive is None else np.array(alive[tick])
        metrics.see(truth(run, tick, pose=pose, alive=living))
        values.append(metrics.latest["find_time_s"].tolist())
    return values, metrics.end(None)["metrics"]


def test_find_time_is_when_the_first_robot_reached_a_light_and_stays():
    values, summary = find_times(
        [[0, 0, 4, 1, 0, 0], [1, 1.5, 4, 4, 0, 0], [1, 0, 0.51, 4, 0, 0], [2, -3, 0.49, 4, 0, 0]]
    )
    nan = np.nan
    expected = [[nan, nan, nan], [0.1, nan, nan], [0.1, nan, nan], [0.1, 0.3, nan]]
    np.testing.assert_allclose(values, expected)
    assert [arena["find_time_s"]["final"] for arena in summary] == [0.1, 0.3, None]


def test_dead_robots_find_nothing_and_finds_outlast_deaths():
    alive = [[False, True], [True, True], [False, False]]
    values, _ = find_times([[2, 0], [2, 0], [0, 0]], alive, lights=LIGHTS_OF_ARENAS[:1])
    assert values == [[pytest.approx(np.nan, nan_ok=True)], [0.1], [0.1]]


def test_find_share_needs_that_many_living_robots_at_once():
    x_m = [[2, 0, 0, 0, 0], [0, 2, 2, 0, 0], [2, 2, 2, 0, 0]]
    ticks = [find_times(x_m, lights=LIGHTS_OF_ARENAS[:1], share=share, robots=5)[0] for share in (0.2, 0.4, 0.6)]
    assert [values[-1] for values in ticks] == [[0.0], [0.1], [0.2]]
    three_alive = [[True, True, False, True, False]] * 3
    assert find_times(x_m, three_alive, lights=LIGHTS_OF_ARENAS[:1], share=0.6, robots=5)[0][-1] == [0.2]


LIGHTS = [Light(0.0, 0.0, 1.0), Light(3.0, 0.0, 1.0)]


def targets(lights, *at, arenas=1):
    run = static(len(at) // arenas, arenas=arenas, lights=lights)
    pose = np.zeros((len(at), 3))
    pose[:, :2] = at
    tick = truth(run, pose=pose)
    return measured("target_best", run, tick), measured("target_mean", run, tick)


def test_robot_counts_to_its_nearest_light():
    assert targets([LIGHTS], (0.3, 0.4), (3.0, 1.0), (5.0, 0.0)) == ([0.5], [pytest.approx(3.5 / 3)])


@pytest.mark.parametrize(("lights", "exact"), [([LIGHTS, [], LIGHTS[1:]], [1.0, np.nan, 2.0]), ([], [np.nan] * 3)])
def test_arenas_have_lights_of_their_own_or_none(lights, exact):
    for distances in targets(lights, (1.0, 0.0), (1.0, 0.0), (1.0, 0.0), arenas=3):
        assert distances == pytest.approx(exact, nan_ok=True)


BOX = Obstacle("box", 1.0, 0.5, 0.3, size_m=(1.5, 0.7))
POLYGON = Obstacle("polygon", -2.0, 1.0, 0.5, points_m=((0.0, 0.0), (1.0, 0.0), (0.3, 1.2)))
CYLINDER = Obstacle("cylinder", -1.0, -1.5, radius_m=0.6)


def shares(run, ticks, alive=None, **parameters):
    """Coverage in each tick, (ticks, arenas), of robots at places (ticks, rows, 2)."""
    truths = []
    for tick, at in enumerate(ticks):
        pose = np.concatenate([at, np.zeros((len(at), 1))], axis=1)
        given_alive = {} if alive is None else {"alive": np.array(alive[tick])}
        truths.append(truth(run, tick, pose=pose, **given_alive))
    return in_each_tick(run, truths, CoverageRatio(**parameters))[:, 0]


def is_free(x, y, obstacles):
    for one in obstacles:
        if one.shape == "cylinder":
            if np.hypot(x - one.x_m, y - one.y_m) <= one.radius_m:
                return False
        else:
            corners = one.corners_m
            along = np.roll(corners, -1, axis=0) - corners
            left_of = along[:, 0] * (y - corners[:, 1]) - along[:, 1] * (x - corners[:, 0])
            if (left_of >= 0).all():
                return False
    return True


def brute_force(run, ticks, alive, sensing_m, cell_m):
    """Each cell asked about each robot, with all images of the robot on a torus."""
    (width, height), torus = run.arena_size_m, run.boundary == "torus"
    nx, ny = int(np.ceil(width / cell_m)), int(np.ceil(height / cell_m))
    ratios = np.empty((len(ticks), run.arenas))
    for arena in range(run.arenas):
        centres = [
            ((i + 0.5) * width / nx - width / 2, (j + 0.5) * height / ny - height / 2)
            for i in range(nx)
            for j in range(ny)
        ]
        free = [cell for cell in centres if is_free(*cell, run.obstacles[arena])]
        covered = set()
        for tick, at in enumerate(ticks):
            for robot in range(arena * run.robots, (arena + 1) * run.robots):
                for shift_x, shift_y in [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)] if torus else [(0, 0)]:
                    x, y = at[robot] + (shift_x * width, shift_y * height)
                    if alive[tick][robot]:
                        covered |= {cell for cell in free if (cell[0] - x) ** 2 + (cell[1] - y) ** 2 <= sensing_m**2}
            ratios[tick, arena] = len(covered) / len(free) if free else np.nan
    return ratios


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 10_000),
    st.sampled_from(["walls", "open", "torus"]),
    st.floats(0.05, 2.5),
    st.sampled_from([0.31, 0.5, 0.77]),
    st.lists(st.sampled_from([BOX, POLYGON, CYLINDER]), max_size=3, unique=True),
)
def test_coverage_is_that_of_testing_every_cell_against_every_robot(seed, boundary, sensing_m, cell_m, obstacles):
    rng = np.random.default_rng(seed)
    run = replace(static(3, arenas=2, obstacles=obstacles), arena_size_m=(6.0, 4.4), boundary=boundary)
    beyond = 0.0 if boundary == "walls" else 0.4
    ticks = rng.uniform((-3 - beyond, -2.2 - beyond), (3 + beyond, 2.2 + beyond), (3, 6, 2))
    alive = rng.random((3, 6)) < 0.7
    ratios = shares(run, ticks, alive, sensing_m=sensing_m, cell_m=cell_m)
    np.testing.assert_array_equal(ratios, brute_force(run, ticks, alive, sensing_m, cell_m))


def test_coverage_of_a_large_sensing_range_is_all_at_once():
    for boundary in ("walls", "torus"):
        run = replace(static(1), boundary=boundary)
        assert shares(run, [[(1.0, 1.0)]], sensing_m=1e6).tolist() == [[1.0]]


def test_cells_of_fixed_obstacles_are_not_free_and_those_of_movable_ones_are():
    half = Obstacle("box", 0.5, 0.0, size_m=(1.0, 2.0))
    at = [[(-0.75, 0.75)]]
    for obstacle, free in ((half, 8), (replace(half, mass_kg=1.0), 16)):
        run = replace(static(1, obstacles=[obstacle]), arena_size_m=(2.0, 2.0))
        assert shares(run, at, sensing_m=0.1, cell_m=0.5).tolist() == [[1 / free]]


def test_coverage_is_nan_where_no_cell_is_free():
    run = replace(static(1, obstacles=[Obstacle("box", 0.0, 0.0, size_m=(2.0, 2.0))]), arena_size_m=(2.0, 2.0))
    assert np.isnan(shares(run, [[(0.0, 0.0)]])).all()


def test_more_cells_than_memory_should_hold_are_refused():
    run = replace(static(1), arena_size_m=(5000.0, 5000.0))
    with pytest.raises(BadInput, match=r"^metrics\.coverage\.cell_m: .*134217728.*25000000"):
        shares(run, [[(0.0, 0.0)]])


def test_coverage_time_is_when_the_share_was_reached():
    run = replace(static(1, arenas=2), arena_size_m=(4.0, 1.0))
    metrics, values = Metrics([CoverageTime(sensing_m=0.1, cell_m=1.0, share=0.75)]), []
    metrics.begin(run)
    for tick, x in enumerate((-1.5, -0.5, -0.5, 0.5, 1.5)):
        pose = np.array([(x, 0.0, 0.0), (-1.5, 0.0, 0.0)])
        metrics.see(truth(run, tick, pose=pose))
        values.append(metrics.latest["coverage_time_s"].tolist())
    nan = np.nan
    np.testing.assert_allclose(values, [[nan, nan]] * 3 + [[0.3, nan]] * 2)
    assert [arena["coverage_time_s"]["final"] for arena in metrics.end(None)["metrics"]] == [0.3, None]


def test_straight_movers_on_a_torus_cover_what_koopman_says():
    """Of 20 arenas the mean; its deviation from the formula is a few thousandths, so 0.02 never fails by chance."""
    rng, arenas, robots, radius_m, step_m = np.random.default_rng(7), 20, 8, 0.4, 0.05
    run = replace(static(robots, arenas), arena_size_m=(10.0, 10.0), boundary="torus")
    at = rng.uniform(-5, 5, (arenas * robots, 2))
    angle = rng.uniform(0, 2 * np.pi, arenas * robots)
    step = step_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    ratios = shares(run, [at + tick * step for tick in range(200)], sensing_m=radius_m, cell_m=0.1).mean(axis=1)
    gone_m = step_m * np.arange(200)
    expected = 1 - np.exp(-robots * (np.pi * radius_m**2 + 2 * radius_m * gone_m) / 100)
    np.testing.assert_allclose(ratios, expected, atol=0.02)
