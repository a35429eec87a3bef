"""Coverage: known values, every cell asked about every robot, and Koopman's formula."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.comms.errors import BadInput
from swarmwire.comms.truth import Obstacle
from swarmwire.metrics.measure import Metrics
from swarmwire.metrics.task.coverage import Coverage, CoverageTime
from tests.support.metrics.truths import in_each_tick, static, truth

BOX = Obstacle("box", 1.0, 0.5, 0.3, size_m=(1.5, 0.7))
POLYGON = Obstacle("polygon", -2.0, 1.0, 0.5, points_m=((0.0, 0.0), (1.0, 0.0), (0.3, 1.2)))
CYLINDER = Obstacle("cylinder", -1.0, -1.5, radius_m=0.6)


def shares(of, ticks, alive=None, **parameters):
    """Coverage in each tick, (ticks, arenas), of robots at places (ticks, rows, 2)."""
    seen = []
    for tick, at in enumerate(ticks):
        pose = np.concatenate([at, np.zeros((len(at), 1))], axis=1)
        given_alive = {} if alive is None else {"alive": np.array(alive[tick])}
        seen.append(truth(of, tick, pose=pose, **given_alive))
    return in_each_tick(of, seen, Coverage(**parameters))[:, 0]


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


def brute_force(of, ticks, alive, sensing_m, cell_m):
    """Each cell asked about each robot, with all images of the robot on a torus."""
    (width, height), torus = of.arena_size_m, of.boundary == "torus"
    nx, ny = int(np.ceil(width / cell_m)), int(np.ceil(height / cell_m))
    found = np.empty((len(ticks), of.arenas))
    for arena in range(of.arenas):
        places = [
            ((i + 0.5) * width / nx - width / 2, (j + 0.5) * height / ny - height / 2)
            for i in range(nx)
            for j in range(ny)
        ]
        free = [place for place in places if is_free(*place, of.obstacles[arena])]
        seen = set()
        for tick, at in enumerate(ticks):
            for robot in range(arena * of.robots, (arena + 1) * of.robots):
                for shift_x, shift_y in [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)] if torus else [(0, 0)]:
                    x, y = at[robot] + (shift_x * width, shift_y * height)
                    if alive[tick][robot]:
                        seen |= {cell for cell in free if (cell[0] - x) ** 2 + (cell[1] - y) ** 2 <= sensing_m**2}
            found[tick, arena] = len(seen) / len(free) if free else np.nan
    return found


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 10_000),
    st.sampled_from(["walls", "open", "torus"]),
    st.floats(0.05, 2.5),
    st.sampled_from([0.31, 0.5, 0.77]),
    st.lists(st.sampled_from([BOX, POLYGON, CYLINDER]), max_size=3, unique=True),
)
def test_it_is_what_asking_every_cell_about_every_robot_gives(seed, boundary, sensing_m, cell_m, obstacles):
    rng = np.random.default_rng(seed)
    of = replace(static(3, arenas=2, obstacles=obstacles), arena_size_m=(6.0, 4.4), boundary=boundary)
    beyond = 0.0 if boundary == "walls" else 0.4
    ticks = rng.uniform((-3 - beyond, -2.2 - beyond), (3 + beyond, 2.2 + beyond), (3, 6, 2))
    alive = rng.random((3, 6)) < 0.7
    found = shares(of, ticks, alive, sensing_m=sensing_m, cell_m=cell_m)
    np.testing.assert_array_equal(found, brute_force(of, ticks, alive, sensing_m, cell_m))


def test_a_robot_covers_a_disc():
    of = replace(static(1), arena_size_m=(10.0, 10.0))
    assert shares(of, [[(0.3, -0.2)]], sensing_m=2.0, cell_m=0.05)[0, 0] == pytest.approx(np.pi * 4 / 100, rel=0.01)
    assert shares(of, [[(5.0, 5.0)]], sensing_m=2.0, cell_m=0.05)[0, 0] == pytest.approx(np.pi / 100, rel=0.01)
    torus = replace(of, boundary="torus")
    assert shares(torus, [[(5.0, 5.0)]], sensing_m=2.0, cell_m=0.05)[0, 0] == pytest.approx(np.pi * 4 / 100, rel=0.01)


def test_it_only_rises_whoever_dies_and_the_dead_cover_nothing():
    of = replace(static(2), arena_size_m=(4.0, 1.0))
    ticks = [[(-1.5, 0), (1.5, 0)], [(-1.5, 0), (-0.5, 0)], [(0.5, 0), (1.5, 0)], [(0.5, 0), (1.5, 0)]]
    alive = [[True, False], [True, True], [True, False], [False, False]]
    found = shares(of, ticks, alive, sensing_m=0.1, cell_m=1.0)
    assert found.ravel().tolist() == [0.25, 0.5, 0.75, 0.75]


def test_a_large_sensing_range_covers_all_at_once():
    for boundary in ("walls", "torus"):
        of = replace(static(1), boundary=boundary)
        assert shares(of, [[(1.0, 1.0)]], sensing_m=1e6).tolist() == [[1.0]]


def test_cells_of_fixed_obstacles_are_not_free_and_those_of_movable_ones_are():
    half = Obstacle("box", 0.5, 0.0, size_m=(1.0, 2.0))
    at = [[(-0.75, 0.75)]]
    for obstacle, free in ((half, 8), (replace(half, mass_kg=1.0), 16)):
        of = replace(static(1, obstacles=[obstacle]), arena_size_m=(2.0, 2.0))
        assert shares(of, at, sensing_m=0.1, cell_m=0.5).tolist() == [[1 / free]]


def test_where_nothing_is_free_there_is_none():
    of = replace(static(1, obstacles=[Obstacle("box", 0.0, 0.0, size_m=(2.0, 2.0))]), arena_size_m=(2.0, 2.0))
    assert np.isnan(shares(of, [[(0.0, 0.0)]])).all()


def test_more_cells_than_memory_should_hold_are_refused():
    of = replace(static(1), arena_size_m=(5000.0, 5000.0))
    with pytest.raises(BadInput, match=r"^metrics\.coverage\.cell_m: .*134217728.*25000000"):
        shares(of, [[(0.0, 0.0)]])


def test_the_time_is_when_the_share_was_reached():
    of = replace(static(1, arenas=2), arena_size_m=(4.0, 1.0))
    metrics, found = Metrics([CoverageTime(sensing_m=0.1, cell_m=1.0, share=0.75)]), []
    metrics.begin(of)
    for tick, x in enumerate((-1.5, -0.5, -0.5, 0.5, 1.5)):
        pose = np.array([(x, 0.0, 0.0), (-1.5, 0.0, 0.0)])
        metrics.see(truth(of, tick, pose=pose))
        found.append(metrics.latest["coverage_time_s"].tolist())
    nan = np.nan
    np.testing.assert_allclose(found, [[nan, nan]] * 3 + [[0.3, nan]] * 2)
    assert [arena["coverage_time_s"]["final"] for arena in metrics.end(None)["metrics"]] == [0.3, None]


def test_straight_movers_on_a_torus_cover_what_koopman_says():
    """Of 20 arenas the mean; its deviation from the formula is a few thousandths, so 0.02 never fails by chance."""
    rng, arenas, robots, radius_m, step_m = np.random.default_rng(7), 20, 8, 0.4, 0.05
    of = replace(static(robots, arenas), arena_size_m=(10.0, 10.0), boundary="torus")
    at = rng.uniform(-5, 5, (arenas * robots, 2))
    angle = rng.uniform(0, 2 * np.pi, arenas * robots)
    step = step_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    found = shares(of, [at + tick * step for tick in range(200)], sensing_m=radius_m, cell_m=0.1).mean(axis=1)
    gone_m = step_m * np.arange(200)
    expected = 1 - np.exp(-robots * (np.pi * radius_m**2 + 2 * radius_m * gone_m) / 100)
    np.testing.assert_allclose(found, expected, atol=0.02)
