"""Lines of sight and lengths inside walls, found by cells: bit for bit those of a look at every obstacle."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.geometry.line_of_sight import is_blocked
from swarmwire.comms.base.geometry.obstacle_index import ObstacleIndices
from swarmwire.comms.base.geometry.obstacles import obstacle_arrays
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.radio.propagation.obstruction import crossed_and_inside_m
from tests.support.comms.lines import (
    Arenas,
    crossed_and_inside,
    crossed_on_floor,
    indexed,
    is_blocked_on_floor,
    touches_any,
    touches_any_on_torus,
)

SIZE_M = (6.0, 4.0)
LINES = 60
ON_GRID = st.integers(-12, 12).map(lambda quarters: quarters / 4.0)  # on the borders of cells and sides of boxes


@st.composite
def obstacles(draw: st.DrawFn) -> Obstacle:
    """A cylinder, a box, a long wall or a triangle; half of them on a grid, some beyond the arena's edge."""
    anywhere = st.floats(-4.0, 4.0)
    x, y = draw(st.tuples(ON_GRID, ON_GRID) | st.tuples(anywhere, anywhere))
    turn = draw(st.sampled_from([0.0, np.pi / 2]) | st.floats(-np.pi, np.pi))
    return draw(
        st.sampled_from(
            [
                Obstacle("cylinder", x, y, radius_m=0.25, height_m=0.1),
                Obstacle("cylinder", x, y, radius_m=1.1),
                Obstacle("box", x, y, turn, size_m=(0.5, 0.5)),
                Obstacle("box", x, y, turn, size_m=(5.0, 0.05), height_m=0.2),
                Obstacle("polygon", x, y, turn, points_m=((0.4, 0.0), (-0.2, 0.3), (-0.3, -0.3))),
            ]
        )
    )


MAPS = st.lists(st.lists(obstacles(), max_size=25).map(tuple), min_size=1, max_size=3).map(tuple)


def lines(seed: int, reach: float) -> FloatArray:
    """Lines x0, y0, x1, y1 (LINES, 4) in m over `reach` arenas: anywhere, along the axes, on a grid, and points."""
    rng, half = np.random.default_rng(seed), 0.5 * reach * np.array([*SIZE_M, *SIZE_M])
    line = rng.uniform(-half, half, (LINES, 4))
    line[::4] = np.rint(4.0 * line[::4]) / 4.0
    line[1::8, 2], line[5::8, 3] = line[1::8, 0], line[5::8, 1]
    line[9, 2:] = line[9, :2]
    return line


@given(MAPS, st.integers(0, 2**32 - 1), st.sampled_from([0.3, 1.0, 8.0]))
def test_line_of_sight_by_cells_equals_a_test_of_every_obstacle(arenas: Arenas, seed: int, reach: float) -> None:
    """Also far outside the arena, where robots get when it is open."""
    arrays, index = obstacle_arrays(arenas), indexed(arenas, SIZE_M)
    for arena in range(len(arenas)):
        for line in lines(seed, reach).tolist():
            assert is_blocked_on_floor(index, arena, *line) == touches_any(arrays, arena, *line)


@given(MAPS, st.integers(0, 2**32 - 1))
def test_line_of_sight_on_a_torus_crosses_the_seam(arenas: Arenas, seed: int) -> None:
    arrays, index = obstacle_arrays(arenas), indexed(arenas, SIZE_M)
    for arena in range(len(arenas)):
        for line in lines(seed, 1.0).tolist():
            assert is_blocked_on_floor(index, arena, *line, *SIZE_M) == touches_any_on_torus(
                arrays, arena, *line, SIZE_M
            )


@given(MAPS, st.integers(0, 2**32 - 1), st.sampled_from([0.3, 1.0, 8.0]))
def test_wall_lengths_add_up_in_the_order_of_obstacles(arenas: Arenas, seed: int, reach: float) -> None:
    arrays, index = obstacle_arrays(arenas), indexed(arenas, SIZE_M)
    for arena in range(len(arenas)):
        for line in lines(seed, reach).tolist():
            assert crossed_on_floor(index, arena, *line) == crossed_and_inside(arrays, arena, *line)


def test_line_of_sight_in_a_large_map_equals_a_test_of_every_box() -> None:
    rng = np.random.default_rng(27)
    positions, turns = rng.uniform(-20.0, 20.0, (2000, 2)).tolist(), rng.uniform(-3.0, 3.0, 2000).tolist()
    boxes = tuple(Obstacle("box", x, y, turn, size_m=(0.3, 0.1)) for (x, y), turn in zip(positions, turns, strict=True))
    arrays, index = obstacle_arrays((boxes,)), indexed((boxes,), (40.0, 40.0))
    blocked, inside_m = 0, 0.0
    for x, y, dx, dy in rng.uniform([-20.0, -20.0, -5.0, -5.0], [20.0, 20.0, 5.0, 5.0], (40, 4)).tolist():
        line = x, y, x + dx, y + dy
        is_shut, walls = is_blocked_on_floor(index, 0, *line), crossed_on_floor(index, 0, *line)
        assert is_shut == touches_any(arrays, 0, *line)
        assert walls == crossed_and_inside(arrays, 0, *line)
        blocked, inside_m = blocked + is_shut, inside_m + walls[1]
    assert 5 < blocked < 35
    assert inside_m > 5.0


@pytest.mark.parametrize("moves", [True, False])
def test_obstacle_index_follows_only_movable_obstacles(moves: bool) -> None:
    arrays = obstacle_arrays(((Obstacle("cylinder", 0.0, 0.0, radius_m=0.5),),))
    indices = ObstacleIndices(arrays, SIZE_M, 0.0, obstacles_move=moves)
    line = 2.0, -1.0, 2.0, 1.0
    before = indices.now()
    assert not is_blocked_on_floor(before, 0, *line)
    assert indices.now() is before
    arrays.circle[0, 0] = 2.0
    assert is_blocked_on_floor(indices.now(), 0, *line) is moves


def test_low_obstacles_block_a_radio_on_the_floor() -> None:
    low = replace(Obstacle("cylinder", 0.0, 0.0, radius_m=0.5), height_m=1e-3)
    assert is_blocked_on_floor(indexed(((low,),), SIZE_M), 0, -1.0, 0.0, 1.0, 0.0)


def depth(obstacle: Obstacle, points: FloatArray) -> FloatArray:
    """How far each point (k, 3) is from an obstacle in m, from its rim or its top; below 0 within it."""
    apart = points[:, :2] - (obstacle.x_m, obstacle.y_m)
    c, s = np.cos(obstacle.heading_rad), np.sin(obstacle.heading_rad)
    along, across = c * apart[:, 0] + s * apart[:, 1], c * apart[:, 1] - s * apart[:, 0]
    beyond = np.hypot(along, across) - obstacle.radius_m
    if obstacle.shape == "box":
        beyond = np.maximum(np.abs(along) - obstacle.size_m[0] / 2, np.abs(across) - obstacle.size_m[1] / 2)
    return np.maximum(beyond, points[:, 2] - obstacle.height_m)


def test_lines_in_space_enter_obstacles_where_points_along_them_do() -> None:
    """Against points along each line: the obstacles on it, and the length inside them."""
    placed = (
        Obstacle("cylinder", -1.0, 0.5, radius_m=0.6, height_m=0.7),
        Obstacle("box", 1.0, 0.0, 0.4, size_m=(0.5, 2.0), height_m=1.2),
        Obstacle("box", 0.0, -1.0, -0.2, size_m=(2.0, 0.3)),
    )
    index, entered, rng = indexed((placed,), SIZE_M), np.empty((3, 2)), np.random.default_rng(4)
    shares, overflown = np.linspace(0.0, 1.0, 20_001)[:, None], 0
    for a, b in rng.uniform([-3.0, -2.0, 0.0], [3.0, 2.0, 1.6], (140, 2, 3)):
        points = a + shares * (b - a)
        depths = [depth(obstacle, points) for obstacle in placed]
        if min(abs(min(each)) for each in depths) < 1e-3:  # within that of a rim the points might miss it
            continue
        on_line = [bool((each < 0.0).any()) for each in depths]
        inside_m = sum(float((each < 0.0).mean()) for each in depths) * np.linalg.norm(b - a)
        for ends in ((a, b), (b, a)):
            ax, ay, az, bx, by, bz = np.concatenate(ends).tolist()
            assert is_blocked(index, 0, ax, ay, az, bx, by, bz, 0.0, 0.0) == any(on_line)
            crossed, length_m = crossed_and_inside_m(index, entered, 0, ax, ay, az, bx, by, bz)
            assert crossed == sum(on_line)
            assert length_m == pytest.approx(inside_m, abs=1e-3)
        flat = [bool((depth(replace(each, height_m=np.inf), points) < 0.0).any()) for each in placed]
        overflown += sum(flat) - sum(on_line)
    assert overflown > 20
