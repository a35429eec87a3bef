"""Cells: whoever is near lies in the 3 x 3 around, also across the edge of a torus and far outside an arena."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.geometry.cells import MOST_PER_SIDE, cells_over, column_of, row_of, sort

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
    assert 1 <= min(cells.nx, cells.ny) <= max(cells.nx, cells.ny) <= MOST_PER_SIDE


def test_arenas_that_are_over_have_nobody_in_their_cells() -> None:
    state = np.zeros((3, 4, 2))
    cells = cells_over((2.0, 2.0), 0.5, 3, 12)
    sort(cells, state, np.array([True, False, True]))
    filled = np.diff(cells.start).reshape(3, -1).sum(axis=1)
    assert filled.tolist() == [4, 0, 4]
    assert cells.start[-1] == 8
