"""Walls and bodies: exact chords, both directions alike."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from swarmwire.comms.geometry import robot_index
from swarmwire.comms.geometry.obstacles import Obstacles, is_blocked, obstacle_arrays
from swarmwire.comms.radio.propagation.obstruction import bodies_between, crossed_and_inside_m, is_on_line, wall_loss_db
from swarmwire.comms.truth import Obstacle

CYLINDER = Obstacle("cylinder", 0.0, 0.0, radius_m=1.0)
BOX = Obstacle("box", 5.0, 0.0, size_m=(2.0, 4.0))
TURNED = Obstacle("box", -4.0, 3.0, heading_rad=0.6, size_m=(1.0, 3.0))
ARENAS = obstacle_arrays(((CYLINDER, BOX, TURNED), (), (BOX, BOX)))
PLACES = st.floats(-8.0, 8.0)


def through(obstacles: Obstacles, *line: float, arena: int = 0) -> tuple[int, float]:
    return crossed_and_inside_m(obstacles, arena, *line)


@pytest.mark.parametrize(
    ("line", "crossed", "inside_m"),
    [
        ((-2.0, 0.0, 2.0, 0.0), 1, 2.0),  # through the middle of the cylinder
        ((-2.0, 0.6, 2.0, 0.6), 1, 1.6),  # 2 sqrt(1 - 0.36)
        ((-2.0, -2.0, 2.0, 2.0), 1, 2.0),
        ((0.0, 0.0, 0.5, 0.0), 1, 0.5),  # within it
        ((0.0, 0.0, 2.0, 0.0), 1, 1.0),  # out of it
        ((-2.0, 1.0, 2.0, 1.0), 0, 0.0),  # touches
        ((-3.0, 0.0, -2.0, 0.0), 0, 0.0),  # stops before it
        ((2.0, 1.0, 8.0, 1.0), 1, 2.0),  # through the box
        ((5.0, -8.0, 5.0, 8.0), 1, 4.0),
        ((4.0, -2.0, 6.0, 2.0), 1, math.sqrt(20.0)),  # its diagonal
        ((3.0, 2.0, 7.0, 2.0), 0, 0.0),  # along its side
        ((3.0, 0.0, 4.0, 0.0), 0, 0.0),  # ends at it
        ((4.5, 0.0, 5.5, 1.0), 1, math.sqrt(2.0)),  # within it
        ((-2.0, 0.0, 8.0, 0.0), 2, 4.0),  # both
        ((3.0, 3.0, 3.0, 3.0), 0, 0.0),
    ],
)
def test_chords_are_exact(line: tuple[float, ...], crossed: int, inside_m: float):
    found, found_m = through(ARENAS, *line)
    assert found == crossed
    assert found_m == pytest.approx(inside_m, rel=1e-12, abs=1e-12)


def test_loss_counts_obstacles_and_metres():
    assert wall_loss_db(ARENAS, 0, 5.0, 3.0, -2.0, 0.0, 8.0, 0.0) == pytest.approx(2 * 5.0 + 4.0 * 3.0, rel=1e-12)


def test_an_arena_has_its_own_obstacles_and_overlapping_ones_count_each():
    assert through(ARENAS, -2.0, 0.0, 8.0, 0.0, arena=1) == (0, 0.0)
    assert through(ARENAS, -2.0, 0.0, 8.0, 0.0, arena=2) == (2, pytest.approx(4.0, rel=1e-12))


@given(PLACES, PLACES, PLACES, PLACES)
def test_both_directions_agree_to_the_last_bit(ax: float, ay: float, bx: float, by: float):
    assert through(ARENAS, ax, ay, bx, by) == through(ARENAS, bx, by, ax, ay)


@given(PLACES, PLACES, PLACES, PLACES, st.floats(0.0, 1.0))
def test_chords_of_parts_add_up(ax: float, ay: float, bx: float, by: float, share: float):
    mx, my = ax + share * (bx - ax), ay + share * (by - ay)
    whole, parts = (
        through(ARENAS, ax, ay, bx, by)[1],
        (through(ARENAS, ax, ay, mx, my), through(ARENAS, mx, my, bx, by)),
    )
    # A point in the middle is off the line by rounding; a chord that grazes a circle changes by the root of that.
    assert parts[0][1] + parts[1][1] == pytest.approx(whole, abs=1e-6)


@given(PLACES, PLACES, PLACES, PLACES)
def test_who_enters_an_obstacle_is_blocked_by_it(ax: float, ay: float, bx: float, by: float):
    crossed, inside_m = through(ARENAS, ax, ay, bx, by)
    assert inside_m <= math.hypot(bx - ax, by - ay) + 1e-12
    assume(inside_m == 0.0 or inside_m > 1e-9)  # `is_blocked` has other roundings
    assert not crossed or is_blocked(ARENAS, 0, ax, ay, bx, by)


@given(PLACES, PLACES, PLACES, PLACES, st.floats(-math.pi, math.pi), PLACES, PLACES)
def test_turning_and_moving_everything_changes_nothing(ax, ay, bx, by, turn, dx, dy):
    c, s = math.cos(turn), math.sin(turn)

    def moved(x: float, y: float) -> tuple[float, float]:
        return c * x - s * y + dx, s * x + c * y + dy

    x, y = moved(BOX.x_m, BOX.y_m)
    box = Obstacle("box", x, y, heading_rad=turn, size_m=BOX.size_m)
    there = through(obstacle_arrays(((box,),)), *moved(ax, ay), *moved(bx, by))[1]
    here = through(obstacle_arrays(((BOX,),)), ax, ay, bx, by)[1]
    near_a_side = abs(abs(ax - 5.0) - 1.0) < 1e-6 and abs(ax - bx) < 1e-6
    near_a_side |= abs(abs(ay) - 2.0) < 1e-6 and abs(ay - by) < 1e-6
    assume(not near_a_side)  # along a side, rounding decides which side of it the line is
    assert there == pytest.approx(here, abs=1e-6)


def test_bodies_on_the_line_are_counted_but_not_its_ends():
    x, y = np.array([0.0, 1.0, 2.0, 3.0, 1.5, 4.0]), np.array([0.0, 0.05, 0.2, 0.0, -0.09, 0.0])
    cells = robot_index.build(x, y, 1, (10.0, 10.0), 5.0)
    radius_m = np.full(6, 0.1)
    # Robot 1 and robot 4 are on it, robot 2 is beside it, robot 5 behind it.
    a, b = np.array([0, 3, 0]), np.array([3, 0, 1])
    assert bodies_between(x, y, radius_m, cells, 6, a, b).tolist() == [2, 2, 0]


@pytest.mark.parametrize("cell_m", [0.2, 1.0, 30.0])
def test_the_grid_finds_the_bodies_that_a_look_at_all_finds(cell_m: float):
    places = np.random.default_rng(3)
    arenas, robots = 2, 60
    x, y = places.uniform(-5.5, 5.5, (2, arenas * robots))
    radius_m = places.uniform(0.05, 0.4, arenas * robots)
    cells = robot_index.build(x, y, arenas, (10.0, 10.0), cell_m)
    pairs, expected = places.integers(0, robots, (200, 2)) + robots * places.integers(0, arenas, (200, 1)), []
    for a, b in pairs:
        others = [k for k in range(a - a % robots, a - a % robots + robots) if k not in (a, b)]
        expected.append(sum(is_on_line(x[a], y[a], x[b], y[b], x[k], y[k], radius_m[k]) for k in others))
    assert bodies_between(x, y, radius_m, cells, robots, *pairs.T.copy()).tolist() == expected
    assert sum(expected) > 100


@given(PLACES, PLACES, PLACES, PLACES, PLACES, PLACES, st.floats(0.05, 2.0))
def test_a_disc_is_on_the_line_where_the_line_has_a_chord_in_it(ax, ay, bx, by, cx, cy, radius_m):
    disc = obstacle_arrays(((Obstacle("cylinder", cx, cy, radius_m=radius_m),),))
    chord_m = through(disc, ax, ay, bx, by)[1]
    assume(math.hypot(bx - ax, by - ay) > 1e-3)
    assume(chord_m == 0.0 or chord_m > 1e-4)  # between, the two have other roundings
    if is_on_line(ax, ay, bx, by, cx, cy, radius_m - 1e-7):
        assert chord_m > 0.0
    if chord_m > 0.0:
        assert is_on_line(ax, ay, bx, by, cx, cy, radius_m + 1e-7)
