"""Path loss, with obstacles and walls in the way."""

import math
from decimal import Decimal, getcontext
from functools import cache

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.geometry.obstacle_index import ObstacleIndex
from swarmwire.comms.base.geometry.robot_index import grid_over, sort
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.radio.config.path_loss_models import (
    Friis,
    ItuIndoor,
    LogDistance,
    LossCurve,
    TwoRay,
    loss_at_1_m_db,
)
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.propagation.decibels import from_db
from swarmwire.comms.radio.propagation.obstruction import BodyParams, bodies_between, is_on_line, wall_loss_db
from swarmwire.comms.radio.propagation.path_loss import loss_db, reach_m, rssi_dbm
from swarmwire.comms.radio.reception.receiver import chunk_success, ieee802154
from tests.support.comms.lines import crossed_on_floor, indexed, is_blocked_on_floor

getcontext().prec = 40
PI = Decimal("3.1415926535897932384626433832795028841972")
LIGHT = Decimal(299_792_458)
EXACT = 1e-12
NS3_HZ, NS3_W = 2_398_339_664.0, 0.05035702
MODELS = (
    Friis(),
    LogDistance(2.7),
    LogDistance(3.0, 46.6777),
    LogDistance(2.0, 0.0, absorption_db_per_m=0.0074),
    TwoRay(),
    TwoRay(0.2, 0.2),
    TwoRay(0.05, 0.05),
    ItuIndoor("residential", floors=2),
    ItuIndoor("office"),
    ItuIndoor("commercial", distance_coefficient_db=25.0),
)
DISTANCES = st.floats(0.0, 1e5)
FREQUENCIES = st.floats(4e8, 6e9)
CYLINDER = Obstacle("cylinder", 0.0, 0.0, radius_m=1.0)
BOX = Obstacle("box", 5.0, 0.0, size_m=(2.0, 4.0))
TURNED = Obstacle("box", -4.0, 3.0, heading_rad=0.6, size_m=(1.0, 3.0))
SIZE_M = (16.0, 16.0)
COORDINATES = st.floats(-8.0, 8.0)


@cache  # not as the file is imported: every worker would compile it then
def walls() -> ObstacleIndex:
    return indexed(((CYLINDER, BOX, TURNED), (), (BOX, BOX)), SIZE_M)


def friis_db(distance_m: float, frequency_hz: float) -> Decimal:
    return 20 * (4 * PI * Decimal(distance_m) * Decimal(frequency_hz) / LIGHT).log10()


def received_w(model, distance_m: float) -> float:
    """As ns-3's tests of propagation have it."""
    return NS3_W / from_db(loss_db(model.curve(NS3_HZ), distance_m))


@pytest.mark.parametrize(
    ("frequency_hz", "stated_db"),
    [
        (868e6, 31.218), (915e6, 31.676), (2.400e9, 40.052), (2.412e9, 40.095), (2.437e9, 40.185),
        (2.440e9, 40.196), (2.450e9, 40.231), (5.150e9, 46.684), (5.180e9, 46.734),
    ],
)  # fmt: skip
def test_free_space_loss_at_one_metre_matches_the_table(frequency_hz: float, stated_db: float):
    assert loss_at_1_m_db(frequency_hz) == pytest.approx(stated_db, abs=5e-4)
    assert loss_db(Friis().curve(frequency_hz), 1.0) == loss_at_1_m_db(frequency_hz)


@given(st.floats(1.0, 1e5), FREQUENCIES)
def test_friis_is_exact(distance_m: float, frequency_hz: float):
    assert loss_db(Friis().curve(frequency_hz), distance_m) == pytest.approx(
        float(friis_db(distance_m, frequency_hz)), rel=EXACT
    )


@given(st.floats(1.0, 1e5), FREQUENCIES, st.floats(1.5, 6.0))
def test_log_distance_is_exact(distance_m: float, frequency_hz: float, exponent: float):
    expected = friis_db(1.0, frequency_hz) + 10 * Decimal(exponent) * Decimal(distance_m).log10()
    curve = LogDistance(exponent).curve(frequency_hz)
    assert loss_db(curve, distance_m) == pytest.approx(float(expected), rel=EXACT)


@given(st.floats(1.0, 1e5), FREQUENCIES, st.floats(0.2, 30.0), st.floats(0.2, 30.0))
def test_path_loss_of_two_ray_is_exact(distance_m: float, frequency_hz: float, sender_m: float, receiver_m: float):
    heights = Decimal(sender_m) * Decimal(receiver_m)
    near = Decimal(distance_m) <= 4 * PI * heights * Decimal(frequency_hz) / LIGHT
    ground = 40 * Decimal(distance_m).log10() - 20 * heights.log10()
    expected = float(friis_db(distance_m, frequency_hz) if near else ground)
    curve = TwoRay(sender_m, receiver_m).curve(frequency_hz)
    assert loss_db(curve, distance_m) == pytest.approx(expected, rel=EXACT, abs=1e-12)


@given(FREQUENCIES, st.floats(0.05, 30.0), st.floats(0.05, 30.0))
def test_crossover_of_two_ray_is_exact_and_continuous(frequency_hz: float, sender_m: float, receiver_m: float):
    model = TwoRay(sender_m, receiver_m)
    expected = 4 * PI * Decimal(sender_m) * Decimal(receiver_m) * Decimal(frequency_hz) / LIGHT
    assert model.crossover_m(frequency_hz) == pytest.approx(float(expected), rel=EXACT)
    curve = model.curve(frequency_hz)
    ground_db = float(40 * expected.log10() - 20 * (Decimal(sender_m) * Decimal(receiver_m)).log10())
    assert friis_db(float(expected), frequency_hz) == pytest.approx(Decimal(ground_db), abs=Decimal("1e-11"))
    assert curve.break_m == model.crossover_m(frequency_hz)


@given(st.floats(1.0, 1e5), FREQUENCIES, st.integers(0, 4))
def test_itu_indoor_is_exact(distance_m: float, frequency_hz: float, floors: int):
    floor_db = 15 + 4 * (floors - 1) if floors else 0
    expected = 20 * (Decimal(frequency_hz) / 10**6).log10() + 30 * Decimal(distance_m).log10() + floor_db - 28
    curve = ItuIndoor("office", floors=floors).curve(frequency_hz)
    assert loss_db(curve, distance_m) == pytest.approx(float(expected), rel=EXACT)


@pytest.mark.parametrize(
    ("model", "distance_m", "stated_w", "tolerance"),
    [
        *((Friis(), distance_m, stated_w, 2e-6) for distance_m, stated_w in (
            (100, 4.98265e-10), (500, 1.99306e-11), (1000, 4.98265e-12), (2000, 1.24566e-12),
        )),
        (TwoRay(), 100, 4.98265e-10, 2e-6),  # below its crossover
        *((TwoRay(1.5, height_m), distance_m, stated_w, 1e-9) for height_m, distance_m, stated_w in (
            (1.5, 500, 4.07891862e-12), (1.5, 1000, 2.5493241375e-13), (1.5, 2000, 1.593327585938e-14),
            (2.5, 500, 1.13303295e-11), (5.5, 1000, 3.42742467375e-12), (11.5, 2000, 9.36522547734e-13),
        )),
        *((LogDistance(3.0, 40.045997), distance_m, stated_w, 3e-6) for distance_m, stated_w in (
            (10, 4.98265e-9), (20, 6.22831e-10), (40, 7.78539e-11), (80, 9.73173e-12),
        )),
    ],
)  # fmt: skip
def test_received_power_matches_ns3(model, distance_m: float, stated_w: float, tolerance: float):
    assert received_w(model, distance_m) == pytest.approx(stated_w, rel=tolerance)


def test_crossover_of_two_ray_follows_from_the_heights():
    assert TwoRay().crossover_m(NS3_HZ) == pytest.approx(226.19, abs=0.005)
    assert TwoRay(0.2, 0.2).crossover_m(NS3_HZ) == pytest.approx(4.02, abs=0.005)


def test_itu_indoor_matches_ns3():
    """Two floors and (0, 30, 9) m apart in a residential building."""
    curve = ItuIndoor("residential", floors=2).curve(2.114e9)
    assert loss_db(curve, (30.0**2 + 9.0**2) ** 0.5) == pytest.approx(88.3855, abs=1e-4)


def test_frames_of_802_15_4_cross_95_m_as_in_ns3():
    """Of 1000 frames with 20 octets of payload (37 on air), ns-3's own test wants 990 to 1000."""
    assert rssi_dbm(10.0, 2.0, -1.0, 60.0) == -49.0  # antenna gains add up
    power_dbm = rssi_dbm(0.0, 0.0, 0.0, loss_db(LogDistance(3.0, 46.6777).curve(2.4e9), 95.0))
    assert chunk_success(ieee802154(), from_db(power_dbm + 106.987), 37 * 8) > 0.99


@pytest.mark.parametrize("model", MODELS)
@given(DISTANCES, DISTANCES, FREQUENCIES)
def test_path_loss_never_falls_with_distance(model, one_m: float, other_m: float, frequency_hz: float):
    curve = model.curve(frequency_hz)
    # At a crossover the two lines meet but for rounding.
    assert loss_db(curve, min(one_m, other_m)) <= loss_db(curve, max(one_m, other_m)) + 1e-12


@pytest.mark.parametrize("model", MODELS)
def test_path_loss_is_constant_below_one_metre(model):
    curve = model.curve(2.44e9)
    assert loss_db(curve, 0.0) == loss_db(curve, 0.5) == loss_db(curve, 1.0)
    assert reach_m(curve, loss_db(curve, 1.0) - 1e-6) == 0.0


@pytest.mark.parametrize("model", MODELS)
@given(st.floats(1.0, 1e5), FREQUENCIES)
def test_reach_is_the_inverse_of_path_loss(model, distance_m: float, frequency_hz: float):
    curve = model.curve(frequency_hz)
    assert reach_m(curve, loss_db(curve, distance_m) + 1e-12) == pytest.approx(distance_m, rel=EXACT, abs=2e-12)


def test_reach_stops_at_a_jump_of_path_loss():
    """A steeper line from 16 m on that starts 12.04 dB higher, as wmediumd has ITU-R P.1238."""
    curve = LossCurve(40.0, 28.0, 16.0, 40.0, 38.0)
    at_break_db = loss_db(curve, 16.0)
    assert loss_db(curve, 16.000001) - at_break_db == pytest.approx(12.04, abs=0.005)
    for spare_db in (0.0, 6.0, 12.0):
        assert reach_m(curve, at_break_db + spare_db) == pytest.approx(16.0, rel=EXACT)
    assert reach_m(curve, loss_db(curve, 30.0)) == pytest.approx(30.0, rel=EXACT)


def test_path_loss_model_has_default_parameters_and_a_unit_disk_none():
    laws = {"log-distance": LogDistance(), "friis": Friis(), "two-ray": TwoRay(), "itu-indoor": ItuIndoor()}
    assert {name: Radio(model=name).path_loss_model for name in laws} == laws
    with pytest.raises(ValueError, match="model: a unit disk has no path loss"):
        _ = Radio(2.0).path_loss_model


def through(obstacles: ObstacleIndex, *line: float, arena: int = 0) -> tuple[int, float]:
    return crossed_on_floor(obstacles, arena, *line)


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
def test_wall_chords_are_exact(line: tuple[float, ...], crossed: int, inside_m: float):
    count, length_m = through(walls(), *line)
    assert count == crossed
    assert length_m == pytest.approx(inside_m, rel=1e-12, abs=1e-12)


def test_wall_loss_counts_obstacles_and_metres_of_its_arena_and_overlaps_twice():
    loss = wall_loss_db(walls(), np.empty((5, 2)), 0, 5.0, 3.0, -2.0, 0.0, 0.0, 8.0, 0.0, 0.0)
    assert loss == pytest.approx(2 * 5.0 + 4.0 * 3.0, rel=1e-12)
    assert through(walls(), -2.0, 0.0, 8.0, 0.0, arena=1) == (0, 0.0)
    assert through(walls(), -2.0, 0.0, 8.0, 0.0, arena=2) == (2, pytest.approx(4.0, rel=1e-12))


@given(COORDINATES, COORDINATES, COORDINATES, COORDINATES)
def test_wall_chords_are_equal_in_both_directions(ax: float, ay: float, bx: float, by: float):
    assert through(walls(), ax, ay, bx, by) == through(walls(), bx, by, ax, ay)


@given(COORDINATES, COORDINATES, COORDINATES, COORDINATES, st.floats(0.0, 1.0))
def test_wall_chords_of_parts_add_up(ax: float, ay: float, bx: float, by: float, share: float):
    mx, my = ax + share * (bx - ax), ay + share * (by - ay)
    parts_m = through(walls(), ax, ay, mx, my)[1] + through(walls(), mx, my, bx, by)[1]
    # A point in the middle is off the line by rounding; a chord that grazes a circle changes by the root of that.
    assert parts_m == pytest.approx(through(walls(), ax, ay, bx, by)[1], abs=1e-6)


@given(COORDINATES, COORDINATES, COORDINATES, COORDINATES)
def test_line_with_a_wall_chord_is_blocked(ax: float, ay: float, bx: float, by: float):
    crossed, inside_m = through(walls(), ax, ay, bx, by)
    assert inside_m <= math.hypot(bx - ax, by - ay) + 1e-12
    assume(inside_m == 0.0 or inside_m > 1e-9)  # `is_blocked` has other roundings
    assert not crossed or is_blocked_on_floor(walls(), 0, ax, ay, bx, by)


@given(COORDINATES, COORDINATES, COORDINATES, COORDINATES, st.floats(-math.pi, math.pi), COORDINATES, COORDINATES)
def test_wall_chords_are_invariant_under_rigid_motion(ax, ay, bx, by, turn, dx, dy):
    c, s = math.cos(turn), math.sin(turn)

    def moved(x: float, y: float) -> tuple[float, float]:
        return c * x - s * y + dx, s * x + c * y + dy

    x, y = moved(BOX.x_m, BOX.y_m)
    box = Obstacle("box", x, y, heading_rad=turn, size_m=BOX.size_m)
    moved_m = through(indexed(((box,),), SIZE_M), *moved(ax, ay), *moved(bx, by))[1]
    original_m = through(indexed(((BOX,),), SIZE_M), ax, ay, bx, by)[1]
    near_a_side = abs(abs(ax - 5.0) - 1.0) < 1e-6 and abs(ax - bx) < 1e-6
    near_a_side |= abs(abs(ay) - 2.0) < 1e-6 and abs(ay - by) < 1e-6
    assume(not near_a_side)  # along a side, rounding decides which side of it the line is
    assert moved_m == pytest.approx(original_m, abs=1e-6)


def bodies_on_floor(x: FloatArray, y: FloatArray, radius_m: FloatArray, cell_m: float, arenas: int) -> BodyParams:
    grid = grid_over((10.0, 10.0), cell_m, arenas, len(x), clamps=True)
    sort(grid, np.column_stack([x, y]).reshape(arenas, -1, 2), np.ones(arenas, np.bool_))
    height_m = np.full(len(x), 0.1)
    return BodyParams(x, y, np.zeros(len(x)), radius_m, height_m, float(radius_m.max()), grid, len(x) // arenas)


def test_bodies_on_the_line_are_counted_but_not_its_ends():
    x, y = np.array([0.0, 1.0, 2.0, 3.0, 1.5, 4.0]), np.array([0.0, 0.05, 0.2, 0.0, -0.09, 0.0])
    bodies = bodies_on_floor(x, y, np.full(6, 0.1), 5.0, 1)
    # Robot 1 and robot 4 are on it, robot 2 is beside it, robot 5 behind it.
    a, b = np.array([0, 3, 0]), np.array([3, 0, 1])
    assert bodies_between(bodies, a, b).tolist() == [2, 2, 0]


@pytest.mark.parametrize("cell_m", [0.2, 1.0, 30.0])
def test_bodies_by_grid_equal_a_test_of_all(cell_m: float):
    draws = np.random.default_rng(3)
    arenas, robots = 2, 60
    x, y = draws.uniform(-5.5, 5.5, (2, arenas * robots))
    radius_m = draws.uniform(0.05, 0.4, arenas * robots)
    bodies = bodies_on_floor(x, y, radius_m, cell_m, arenas)
    pairs, expected = draws.integers(0, robots, (200, 2)) + robots * draws.integers(0, arenas, (200, 1)), []
    for a, b in pairs:
        others = [k for k in range(a - a % robots, a - a % robots + robots) if k not in (a, b)]
        expected.append(sum(is_on_line(x[a], y[a], x[b], y[b], x[k], y[k], radius_m[k]) for k in others))
    assert bodies_between(bodies, *pairs.T.copy()).tolist() == expected
    assert sum(expected) > 100


@given(COORDINATES, COORDINATES, COORDINATES, COORDINATES, COORDINATES, COORDINATES, st.floats(0.05, 2.0))
def test_body_is_on_the_line_where_a_cylinder_has_a_chord(ax, ay, bx, by, cx, cy, radius_m):
    disc = indexed(((Obstacle("cylinder", cx, cy, radius_m=radius_m),),), SIZE_M)
    chord_m = through(disc, ax, ay, bx, by)[1]
    assume(math.hypot(bx - ax, by - ay) > 1e-3)
    assume(chord_m == 0.0 or chord_m > 1e-4)  # between, the two have other roundings
    if is_on_line(ax, ay, bx, by, cx, cy, radius_m - 1e-7):
        assert chord_m > 0.0
    if chord_m > 0.0:
        assert is_on_line(ax, ay, bx, by, cx, cy, radius_m + 1e-7)
