"""Who is near enough and in sight, also on a torus, and what a receiver learns of a sender."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.base.geometry.obstacles import obstacle_arrays, to_nearest
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.radio.config.impairments import BearingMeasure, Measures, RangeMeasure
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.medium import RadioMedium
from tests.support.comms.lines import indexed, is_blocked_on_floor
from tests.support.comms.radio import RATE_HZ, at, everybody, living, make_medium, packets, run, scattered

MEASURES = Measures(RangeMeasure(), BearingMeasure())
BETWEEN = {
    "cylinder": Obstacle("cylinder", 0.0, 0.0, radius_m=0.2),
    "box": Obstacle("box", 0.0, 0.0, np.pi / 4, size_m=(0.6, 0.1)),
    "polygon": Obstacle("polygon", 0.0, -0.1, 0.3, points_m=((-0.1, 0.0), (0.2, 0.0), (0.0, 0.3))),
}


@given(st.integers(0, 1000), st.floats(0.05, 9.0), st.integers(1, 40))
def test_reception_is_by_exactly_the_robots_within_range(seed: int, range_m: float, robots: int):
    pose = scattered(robots, seed) * [1.3, 1.3, 1.0]  # some outside the arena
    result = run(make_medium(Radio(range_m, send_offset="tick"), robots), pose, everybody(robots), 1)
    apart_m = np.hypot(*(pose[:, None, :2] - pose[None, :, :2]).transpose(2, 0, 1))
    near = np.argwhere((apart_m <= range_m) & ~np.eye(robots, dtype=bool))
    pairs = np.column_stack([result.finished("sender"), result.finished("receiver")])
    np.testing.assert_array_equal(pairs[np.lexsort(pairs.T[::-1])], near)
    assert result.fates().get("OUT_OF_RANGE", 0) == robots * (robots - 1) - len(near)


def test_range_is_inclusive():
    result = run(make_medium(Radio(2.0, send_offset="tick"), 3), at((-1, 0), (1, 0), (1, 2.0000001)), everybody(3), 1)
    assert result.fates() == {"RECEIVED": 2, "OUT_OF_RANGE": 4}


@pytest.mark.parametrize("to", [-3, 0, 3])
def test_addressed_packet_to_oneself_or_outside_is_refused(to: int):
    medium = make_medium(Radio(2.0, send_offset="tick"), 3)
    pose = at((0, 0), (1, 0), (0, 1))
    medium.step(0, pose)
    with pytest.raises(ValueError, match="to: expected the index of another robot"):
        medium.send(0, 0, packets([0, 0], [1, to]))
    medium.send(0, 0, packets([0], 1))
    news = medium.step(10**8, pose)
    assert news.received.sequence.tolist() == [0]
    assert news.tally.sent.tolist() == [1]


@pytest.mark.parametrize("shape", BETWEEN)
def test_obstacle_in_the_line_of_sight_blocks(shape: str):
    """Blocked receivers are not in range; without line of sight they hear."""
    pose = at((-1, 0), (1, 0), (-1, 1))
    for line_of_sight, fates, in_range in ((True, {"RECEIVED": 4, "BLOCKED": 2}, 4), (False, {"RECEIVED": 6}, 6)):
        radio = Radio(9.0, line_of_sight=line_of_sight, send_offset="tick")
        result = run(make_medium(radio, 3, [1], [[BETWEEN[shape]]]), pose, everybody(3), 1)
        assert result.fates() == fates
        assert result.tally.in_range.tolist() == [in_range]


def test_range_and_bearing_are_exact_without_noise():
    """Robot 1 looks along +y: robot 0, at its west, is at its left; robot 2, at its south, behind it."""
    radio = Radio(9.0, send_offset="tick", measures=MEASURES)
    result = run(make_medium(radio, 3), at((-2, 0, 0), (0, 0, np.pi / 2), (0, -1, 0)), lambda _: packets([0, 2]), 1)
    links = result.rows("received", "receiver", "sender_index")
    measured = zip(result.measured("range_m"), result.measured("bearing_rad"), strict=True)
    measures = dict(zip(links, measured, strict=True))
    assert measures[1, 0] == (2.0, np.pi / 2)
    assert measures[1, 2] == (1.0, np.pi)
    assert measures[0, 2] == pytest.approx((5**0.5, np.arctan2(-1, 2)))
    assert measures[2, 0] == pytest.approx((5**0.5, np.arctan2(1, -2)))


def test_measures_of_the_radio_come_with_each_packet():
    for measures in (Measures(), Measures(range=RangeMeasure()), Measures(bearing=BearingMeasure()), MEASURES):
        result = run(make_medium(Radio(9.0, measures=measures), 3), scattered(3), everybody(3), 2, 2)
        assert all(tuple(step.received.measured) == measures.columns for step in result.news)


def test_measurement_noise_has_its_standard_deviation_and_bounds():
    """10,920 draws each: the mean and the deviation lie within five standard errors (false alarm 1e-6 each)."""
    radio = Radio(99.0, measures=Measures(RangeMeasure(0.1), BearingMeasure(0.3)))
    pose = at(*[(3.0 * np.cos(a), 2.5 * np.sin(a), a) for a in np.linspace(-3, 3, 40)])
    result = run(make_medium(radio, 40), pose, everybody(40), 7, 2)
    way = pose[result.received("sender_index"), :2] - pose[result.received("receiver"), :2]
    bearing_rad = np.arctan2(way[:, 1], way[:, 0]) - pose[result.received("receiver"), 2]
    wrong_rad = np.angle(np.exp(1j * (result.measured("bearing_rad") - bearing_rad)))
    far = np.hypot(*way.T) > 1.0  # no cut at zero
    wrong_m = (result.measured("range_m") - np.hypot(*way.T))[far]
    for wrong, sigma in ((wrong_rad, 0.3), (wrong_m, 0.1)):
        assert abs(wrong.mean()) < 5 * sigma / len(wrong) ** 0.5
        assert abs(wrong.std() / sigma - 1.0) < 5 / (2 * len(wrong)) ** 0.5
    assert (result.measured("range_m") >= 0.0).all()
    assert (result.measured("bearing_rad") > -np.pi).all()
    assert (result.measured("bearing_rad") <= np.pi).all()


@given(st.integers(0, 1000), st.floats(0.3, 4.0))
def test_edges_are_links_received_both_ways(seed: int, range_m: float):
    obstacles = [*BETWEEN.values(), Obstacle("cylinder", 1.5, 1.0, radius_m=0.5)]
    medium = make_medium(Radio(range_m, send_offset="tick"), 12, [1, 2], [obstacles, []])
    pose = scattered(24, seed)
    edges = medium.step(0, pose).edges
    result = run(medium, pose, everybody(24), 1)
    sender = result.received("receiver") // 12 * 12 + result.received("sender_index")
    links = np.column_stack([sender, result.received("receiver")])
    both = np.unique(np.concatenate([edges, edges[:, ::-1]]), axis=0).reshape(-1, 2)
    np.testing.assert_array_equal(links[np.lexsort(links.T[::-1])], both)
    np.testing.assert_array_equal(edges, edges[np.lexsort(edges.T[::-1])])
    assert (edges[:, 0] < edges[:, 1]).all()


def test_edges_join_live_robots_with_enough_delivery():
    pose = at((0, 0), (1, 0), (2, 0))
    for loss, joined in ((0.0, 1), (0.9, 1), (0.91, 0)):
        medium = make_medium(Radio(1.5, loss=loss), 3)
        assert len(medium.step(0, pose, living([True, True, False])).edges) == joined
    assert make_medium(Radio(1.5), 3).step(0, pose, living([False] * 3)).edges.shape == (0, 2)


SIZE_M = (6.0, 4.0)
EXACT = Measures(RangeMeasure(0.0), BearingMeasure(0.0))


def torus(radio: Radio, robots: int, arenas: int = 1, obstacles: tuple[Obstacle, ...] = ()) -> RadioMedium:
    keys = np.array([derive_key(seed, "air") for seed in range(arenas)], np.uint64)
    context = ChannelContext.open_space(radio, keys, robots, SIZE_M, obstacle_arrays((obstacles,) * arenas))
    return RadioMedium(replace(context, is_torus=True), RATE_HZ)


def scattered_torus(rows: int) -> FloatArray:
    rng, half = np.random.default_rng(8), np.array(SIZE_M) / 2
    return np.column_stack([rng.uniform(-half, half, (rows, 2)), rng.uniform(-np.pi, np.pi, rows)])


def away(pose: FloatArray) -> FloatArray:
    """From each robot to each other, the shortest way, (rows, rows, 2)."""
    straight = pose[None, :, :2] - pose[:, None, :2]
    return straight - np.array(SIZE_M) * np.round(straight / SIZE_M)


def expected_pairs(pose: FloatArray, robots: int, range_m: float) -> set[tuple[int, int]]:
    near = np.hypot(*away(pose).transpose(2, 0, 1)) <= range_m
    arena = np.arange(len(pose)) // robots
    near &= (arena[:, None] == arena) & ~np.eye(len(pose), dtype=np.bool_)
    return set(zip(*map(np.ndarray.tolist, np.nonzero(near)), strict=True))


def pairs(receiver: IntArray, sender: IntArray) -> set[tuple[int, int]]:
    return set(zip(receiver.tolist(), sender.tolist(), strict=True))


@pytest.mark.parametrize("range_m", [0.35, 0.61, 0.9, 1.3, 2.1, 3.2, 5.0])
def test_torus_robots_hear_by_the_shortest_way_once(range_m: float) -> None:
    """Ranges make grids of one, two, four and more cells a side."""
    pose = scattered_torus(80)
    out = run(torus(Radio(range_m=range_m, measures=EXACT), 40, arenas=2), pose, everybody(80), ticks=1, quiet_ticks=2)
    receiver, sender = out.received("receiver"), out.received("sender_index")
    sender = sender + receiver // 40 * 40
    links = pairs(receiver, sender)
    assert links == expected_pairs(pose, 40, range_m)
    assert len(links) == len(receiver)
    shortest = away(pose)[receiver, sender]
    assert out.measured("range_m") == pytest.approx(np.hypot(*shortest.T), abs=1e-12)
    bearing = np.arctan2(shortest[:, 1], shortest[:, 0]) - pose[receiver, 2]
    assert np.cos(out.measured("bearing_rad") - bearing) == pytest.approx(1.0, abs=1e-12)
    edges = torus(Radio(range_m=range_m), 40, arenas=2).step(0, pose).edges
    assert pairs(*edges.T) == {pair for pair in links if pair[0] < pair[1]}


def test_torus_propagation_takes_the_shortest_way() -> None:
    pose = np.array([[2.9, 0.0, 0.0], [-2.9, 0.0, 0.0]])
    late_ns = []
    for speed_mps in (None, 340.0):
        radio = Radio(range_m=1.0, propagation_mps=speed_mps)
        out = run(torus(radio, 2), pose, lambda _: packets([0]), ticks=1, quiet_ticks=2)
        late_ns += out.received("received_at_ns").tolist()
    assert late_ns[1] - late_ns[0] == pytest.approx(0.2 / 340.0 * 1e9, abs=2)


def test_torus_obstacles_block_across_the_seam() -> None:
    """Against points along the shortest line, each put back into the arena."""
    obstacles = (
        Obstacle("box", 2.5, 0.3, 0.4, size_m=(0.4, 1.5)),
        Obstacle("cylinder", -2.6, -1.6, radius_m=0.3),
        Obstacle("box", 0.0, 1.8, size_m=(2.0, 0.2)),
    )
    index, pose, blocked = indexed((obstacles,), SIZE_M), scattered_torus(60), 0
    shortest, shares = away(pose), np.linspace(0.0, 1.0, 4001)[:, None]
    for a in range(60):
        for b in range(a):
            line = pose[a, :2] + shares * shortest[a, b]
            line -= np.array(SIZE_M) * np.round(line / SIZE_M)
            nearest = min(depth(obstacle, line) for obstacle in obstacles)
            if abs(nearest) > 0.002:  # within that of a rim the points might miss it
                assert is_blocked_on_floor(index, 0, *pose[a, :2], *pose[b, :2], *SIZE_M) == (nearest < 0.0)
                crosses = bool(np.any(np.abs(pose[b, :2] - pose[a, :2] - shortest[a, b]) > 1.0))
                blocked += crosses and nearest < 0.0
    assert blocked > 100
    radio = Radio(range_m=5.0, line_of_sight=True)
    edges = torus(radio, 60, obstacles=obstacles).step(0, pose).edges
    clear = {
        (a, b)
        for a, b in expected_pairs(pose, 60, 5.0)
        if a < b and not is_blocked_on_floor(index, 0, *pose[a, :2], *pose[b, :2], *SIZE_M)
    }
    assert pairs(*edges.T) == clear


def depth(obstacle: Obstacle, points: FloatArray) -> float:
    """How near to the obstacle, in m, the nearest of the points is; below 0 within it."""
    apart = points - (obstacle.x_m, obstacle.y_m)
    if obstacle.shape == "cylinder":
        return float(np.hypot(*apart.T).min()) - obstacle.radius_m
    c, s = np.cos(obstacle.heading_rad), np.sin(obstacle.heading_rad)
    along, across = c * apart[:, 0] + s * apart[:, 1], c * apart[:, 1] - s * apart[:, 0]
    beyond = np.maximum(np.abs(along) - obstacle.size_m[0] / 2, np.abs(across) - obstacle.size_m[1] / 2)
    return float(beyond.min())


def test_torus_offset_is_the_nearest_image() -> None:
    assert to_nearest(5.9, 0.0) == 0.0
    assert [x_m + to_nearest(x_m, 6.0) for x_m in (5.9, -3.5, 2.0)] == pytest.approx([-0.1, 2.5, 2.0])


@pytest.mark.parametrize("radio", [Radio(model="friis"), Radio(range_m=1.0, bodies_block=True)])
def test_torus_with_an_unsupported_radio_is_refused(radio: Radio) -> None:
    with pytest.raises(ValueError, match="expected a unit disk without bodies_block on a torus"):
        torus(radio, 2)
