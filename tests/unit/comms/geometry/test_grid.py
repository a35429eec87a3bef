"""The grid: whoever is within reach lies in the 3 x 3 cells around, also outside the arena."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.geometry.grid import MOST_CELLS_PER_SIDE, Grid, build, cell_of, is_empty

SIDES = st.floats(0.1, 50.0)


def cells_of(grid: Grid, x: FloatArray, y: FloatArray) -> tuple[np.ndarray, np.ndarray]:
    i = np.array([cell_of(at, grid.left_m, grid.cell_m, grid.nx) for at in x], np.int64)
    j = np.array([cell_of(at, grid.bottom_m, grid.cell_m, grid.ny) for at in y], np.int64)
    return i, j


@given(st.integers(0, 2**32 - 1), SIDES, SIDES, st.floats(0.01, 60.0))
def test_all_within_reach_are_in_the_cells_around(seed: int, width_m: float, height_m: float, reach_m: float) -> None:
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
    assert max(grid.nx, grid.ny) <= MOST_CELLS_PER_SIDE
