"""Spatial indexes and the floor: whoever is near lies in the 3 x 3 cells around; the shade at a point."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.geometry.floor import Floor, Patch, packed_image
from swarmwire.comms.geometry.ground import ground_of, shade_at, shades_over
from swarmwire.comms.geometry.robot_index import (
    MAX_CELLS_PER_SIDE,
    Grid,
    build,
    cell_of,
    cells_around,
    cells_over,
    column_of,
    is_empty,
    row_of,
    sort,
)

SIDES = st.floats(0.1, 50.0)


@given(st.integers(0, 2**32 - 1), SIDES, SIDES, st.floats(0.01, 60.0), st.booleans())
def test_all_within_reach_are_in_the_cells_around(
    seed: int, width_m: float, height_m: float, reach_m: float, torus: bool
) -> None:
    random = np.random.default_rng(seed)
    x, y = (random.uniform(-2.0, 2.0, 60) * side for side in (width_m, height_m))
    cells = cells_over((width_m, height_m), reach_m, 1, 60)
    apart_x, apart_y = x[:, None] - x, y[:, None] - y
    if torus:
        apart_x, apart_y = (d - side * np.rint(d / side) for d, side in ((apart_x, width_m), (apart_y, height_m)))
    near = np.hypot(apart_x, apart_y) <= reach_m
    i, j = (np.array([of(cells, at) for at in axis]) for of, axis in ((column_of, x), (row_of, y)))
    columns, rows = (i[:, None] - i) % cells.nx, (j[:, None] - j) % cells.ny
    around = np.isin(columns, (0, 1, cells.nx - 1)) & np.isin(rows, (0, 1, cells.ny - 1))
    assert not np.any(near & ~around)
    listed = np.empty(9, np.int64)
    for robot in range(60):
        cell = listed[: cells_around(listed, cells, 2, x[robot], y[robot])] - 2 * cells.ny * cells.nx
        assert len(cell) == len(set(cell.tolist()))
        assert np.array_equal(np.isin(j * cells.nx + i, cell), around[robot])
    assert 0 <= i.min() <= i.max() < cells.nx
    assert 0 <= j.min() <= j.max() < cells.ny


@given(st.integers(0, 2**32 - 1), st.integers(1, 4), st.integers(1, 20))
def test_every_robot_is_in_the_one_cell_of_its_place_and_arena(seed: int, arenas: int, robots: int) -> None:
    state = np.random.default_rng(seed).uniform(-3.0, 3.0, (arenas, robots, 6))
    cells = cells_over((4.0, 3.0), 0.7, arenas, arenas * robots)
    for _ in range(2):  # sorting again starts afresh
        sort(cells, state, np.ones(len(state), np.bool_))
    held = {
        (a, j, i): cells.item[cells.start[c] : cells.start[c + 1]].tolist()
        for c, (a, j, i) in enumerate(np.ndindex(arenas, cells.ny, cells.nx))
    }
    expected = {key: list[int]() for key in held}
    for a in range(arenas):
        for robot in range(robots):
            expected[a, row_of(cells, state[a, robot, 1]), column_of(cells, state[a, robot, 0])].append(robot)
    assert held == expected


@pytest.mark.parametrize("reach_m", [1e-6, 1e6])
def test_there_are_neither_too_many_cells_nor_none(reach_m: float) -> None:
    cells = cells_over((100.0, 50.0), reach_m, 1, 1)
    assert 1 <= min(cells.nx, cells.ny) <= max(cells.nx, cells.ny) <= MAX_CELLS_PER_SIDE


def test_arenas_that_are_over_have_nobody_in_their_cells() -> None:
    state = np.zeros((3, 4, 2))
    cells = cells_over((2.0, 2.0), 0.5, 3, 12)
    sort(cells, state, np.array([True, False, True]))
    filled = np.diff(cells.start).reshape(3, -1).sum(axis=1)
    assert filled.tolist() == [4, 0, 4]
    assert cells.start[-1] == 8


def cells_of(grid: Grid, x: FloatArray, y: FloatArray) -> tuple[np.ndarray, np.ndarray]:
    i = np.array([cell_of(at, grid.left_m, grid.cell_m, grid.nx) for at in x], np.int64)
    j = np.array([cell_of(at, grid.bottom_m, grid.cell_m, grid.ny) for at in y], np.int64)
    return i, j


@given(st.integers(0, 2**32 - 1), SIDES, SIDES, st.floats(0.01, 60.0))
def test_of_a_grid_all_within_reach_are_in_the_cells_around_also_outside_the_arena(
    seed: int, width_m: float, height_m: float, reach_m: float
) -> None:
    random = np.random.default_rng(seed)
    x, y = (random.uniform(-0.75, 0.75, 60) * side for side in (width_m, height_m))  # a third is outside
    grid = build(x, y, 1, (width_m, height_m), reach_m)
    i, j = cells_of(grid, x, y)
    near = np.hypot(x[:, None] - x, y[:, None] - y) <= reach_m
    around = (np.abs(i[:, None] - i) <= 1) & (np.abs(j[:, None] - j) <= 1)
    assert not np.any(near & ~around)


@pytest.mark.parametrize("reach_m", [0.5, 0.3, 1.0])
def test_points_on_the_lines_between_cells_find_one_another(reach_m: float) -> None:
    x = np.repeat(np.arange(-8, 9) * reach_m / 2, 17)
    y = np.tile(np.arange(-8, 9) * reach_m / 2, 17)
    grid = build(x, y, 1, (4.0, 4.0), reach_m)
    i, j = cells_of(grid, x, y)
    near = np.hypot(x[:, None] - x, y[:, None] - y) <= reach_m * (1.0 - 1e-12)
    assert not np.any(near & ((np.abs(i[:, None] - i) > 1) | (np.abs(j[:, None] - j) > 1)))


@given(st.integers(0, 2**32 - 1), st.lists(st.booleans(), min_size=1, max_size=4), st.integers(0, 20))
def test_robots_of_running_arenas_are_in_the_one_cell_of_their_place(seed: int, are: list[bool], robots: int) -> None:
    random, arenas, running = np.random.default_rng(seed), len(are), np.array(are)
    x, y = random.uniform(-3.0, 3.0, (2, arenas * robots))
    grid = build(x, y, arenas, (4.0, 3.0), 0.7, None if running.all() else running)
    i, j = cells_of(grid, x, y)
    arena = np.arange(arenas * robots) // max(robots, 1)
    cell = (arena * grid.ny + j) * grid.nx + i
    here = np.repeat(running, robots)
    assert sorted(grid.order.tolist()) == np.flatnonzero(here).tolist()
    assert [is_empty(grid, a) for a in range(arenas)] == [not (running[a] and robots) for a in range(arenas)]
    for c in range(arenas * grid.ny * grid.nx):
        assert grid.order[grid.start[c] : grid.start[c + 1]].tolist() == np.flatnonzero((cell == c) & here).tolist()


def test_a_tiny_reach_does_not_make_a_huge_table() -> None:
    grid = build(np.zeros(1), np.zeros(1), 1, (100.0, 50.0), 1e-6)
    assert max(grid.nx, grid.ny) <= MAX_CELLS_PER_SIDE


SIZE_M = (4.0, 2.0)
DISC = Patch("disc", 1.0, 0.0, 0.2, radius_m=0.5)
TRIANGLE = Patch("polygon", 1.0, 0.0, 0.4, points_m=((-0.2, -0.2), (0.2, -0.2), (0.0, 0.3)))
GREY = np.array([[0, 51, 102, 153], [255, 204, 153, 102]], np.uint8)  # each a square metre


def test_without_a_floor_all_is_white():
    assert shade_at(ground_of(None, SIZE_M, "walls"), 0.3, 0.4) == 1.0


def test_the_last_patch_wins_and_its_rim_belongs_to_it():
    ground = ground_of(Floor(0.9, (DISC, TRIANGLE)), SIZE_M, "walls")
    at = {(1.0, 0.0): 0.4, (1.0, 0.3): 0.4, (1.2, -0.2): 0.4, (1.15, 0.2): 0.2, (1.5, 0.0): 0.2, (1.6, 0.0): 0.9}
    assert {point: shade_at(ground, *point) for point in at} == at
    assert shade_at(ground_of(Floor(0.9, (TRIANGLE, DISC)), SIZE_M, "walls"), 1.0, 0.0) == 0.2


def test_a_picture_is_stretched_over_the_arena_top_row_at_the_greatest_y():
    ground = ground_of(Floor(0.5, (), packed_image(GREY)), SIZE_M, "walls")
    x, y = np.arange(-1.5, 2.0), (0.5, -0.5)
    assert [[shade_at(ground, at, up) for at in x] for up in y] == pytest.approx(GREY / 255.0)
    assert shades_over(ground, x, np.array(y)) == pytest.approx(GREY / 255.0)
    corners = [shade_at(ground, at, up) for at, up in ((-2.0, 1.0), (2.0, 1.0), (-2.0, -1.0), (2.0, -1.0))]
    assert corners == pytest.approx([0.0, 0.6, 1.0, 0.4])
    assert [shade_at(ground, 2.01, 0.0), shade_at(ground, 0.0, -1.01)] == [0.5, 0.5]
    assert shade_at(ground_of(Floor(0.5, (DISC,), packed_image(GREY)), SIZE_M, "walls"), 1.1, 0.1) == 0.2


def test_on_a_torus_patch_and_picture_go_on_at_the_other_side():
    disc = Patch("disc", 1.9, 0.9, 0.2, radius_m=0.3)
    wrapped, cut = (ground_of(Floor(1.0, (disc,)), SIZE_M, boundary) for boundary in ("torus", "open"))
    for x, y in ((-1.9, 0.9), (1.9, -0.9), (-1.95, -0.95), (2.05, 1.05)):
        assert shade_at(wrapped, x, y) == 0.2
    assert [shade_at(cut, -1.9, 0.9), shade_at(cut, 2.05, 1.05)] == [1.0, 0.2]
    picture = ground_of(Floor(1.0, (), packed_image(GREY)), SIZE_M, "torus")
    for x, y in ((-1.5, 0.5), (0.5, -0.5)):
        assert {shade_at(picture, x + 4.0 * i, y + 2.0 * j) for i in (-1, 0, 1) for j in (-1, 0, 1)} == {
            shade_at(picture, x, y)
        }
