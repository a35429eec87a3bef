"""On a torus a disk's radio knows shortest distances alone: where the seam lies makes no difference."""

import numpy as np
import pytest

from swarmwire.comms.air.air import Air
from swarmwire.comms.air.parameters.gives import BearingGiven, Gives, RangeGiven
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.draws import derive_key
from swarmwire.comms.geometry.obstacles import is_blocked_on, obstacle_arrays, to_nearest
from swarmwire.comms.truth import Obstacle
from tests.support.comms.air.runs import RATE_HZ, everybody, packets, run

SIZE_M = (6.0, 4.0)
GIVES = Gives(RangeGiven(0.0), BearingGiven(0.0))


def torus(radio: Radio, robots: int, arenas: int = 1, obstacles: tuple[Obstacle, ...] = ()) -> Air:
    keys = np.array([derive_key(seed, "air") for seed in range(arenas)], np.uint64)
    return Air(radio, keys, robots, SIZE_M, obstacle_arrays((obstacles,) * arenas), RATE_HZ, boundary="torus")


def scattered(rows: int) -> FloatArray:
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
def test_robots_hear_those_within_range_the_shortest_way_each_once(range_m: float) -> None:
    """Ranges make grids of one, two, four and more cells a side."""
    pose = scattered(80)
    out = run(torus(Radio(range_m=range_m, gives=GIVES), 40, arenas=2), pose, everybody(80), ticks=1, quiet_ticks=2)
    receiver, sender = out.heard("receiver"), out.heard("sender")
    sender = sender + receiver // 40 * 40
    found = pairs(receiver, sender)
    assert found == expected_pairs(pose, 40, range_m)
    assert len(found) == len(receiver)
    shortest = away(pose)[receiver, sender]
    assert out.given("range_m") == pytest.approx(np.hypot(*shortest.T), abs=1e-12)
    bearing = np.arctan2(shortest[:, 1], shortest[:, 0]) - pose[receiver, 2]
    assert np.cos(out.given("bearing_rad") - bearing) == pytest.approx(1.0, abs=1e-12)
    edges = torus(Radio(range_m=range_m), 40, arenas=2).edges(pose, np.ones(80, np.bool_))
    assert pairs(*edges.T) == {pair for pair in found if pair[0] < pair[1]}


def test_an_addressed_packet_crosses_the_seam() -> None:
    pose = np.array([[2.9, 1.9, 0.0], [-2.9, -1.9, 0.0], [0.0, 0.0, 0.0]])
    radio = Radio(range_m=1.0, gives=GIVES)
    out = run(torus(radio, 3), pose, lambda _: packets([0, 0], [1, 2]), ticks=1, quiet_ticks=2)
    assert (out.heard("receiver").tolist(), out.heard("sender").tolist()) == ([1], [0])
    assert out.given("range_m") == pytest.approx([np.hypot(0.2, 0.2)])
    assert out.given("bearing_rad") == pytest.approx([-0.75 * np.pi])
    assert out.fates() == {"HEARD": 1, "OUT_OF_RANGE": 1}


def test_slow_waves_take_the_shortest_way() -> None:
    pose = np.array([[2.9, 0.0, 0.0], [-2.9, 0.0, 0.0]])
    late_ns = []
    for speed_mps in (None, 340.0):
        radio = Radio(range_m=1.0, propagation_mps=speed_mps)
        out = run(torus(radio, 2), pose, lambda _: packets([0]), ticks=1, quiet_ticks=2)
        late_ns += out.heard("heard_at_ns").tolist()
    assert late_ns[1] - late_ns[0] == pytest.approx(0.2 / 340.0 * 1e9, abs=2)


def test_obstacles_block_across_the_seam() -> None:
    """Against points along the shortest line, each put back into the arena."""
    obstacles = (
        Obstacle("box", 2.5, 0.3, 0.4, size_m=(0.4, 1.5)),
        Obstacle("cylinder", -2.6, -1.6, radius_m=0.3),
        Obstacle("box", 0.0, 1.8, size_m=(2.0, 0.2)),
    )
    arrays, pose, blocked = obstacle_arrays((obstacles,)), scattered(60), 0
    shortest, shares = away(pose), np.linspace(0.0, 1.0, 4001)[:, None]
    for a in range(60):
        for b in range(a):
            line = pose[a, :2] + shares * shortest[a, b]
            line -= np.array(SIZE_M) * np.round(line / SIZE_M)
            nearest = min(depth(obstacle, line) for obstacle in obstacles)
            if abs(nearest) > 0.002:  # within that of a rim the points might miss it
                assert is_blocked_on(arrays, 0, *pose[a, :2], *pose[b, :2], *SIZE_M) == (nearest < 0.0)
                crosses = bool(np.any(np.abs(pose[b, :2] - pose[a, :2] - shortest[a, b]) > 1.0))
                blocked += crosses and nearest < 0.0
    assert blocked > 100
    radio = Radio(range_m=5.0, line_of_sight=True)
    edges = torus(radio, 60, obstacles=obstacles).edges(pose, np.ones(60, np.bool_))
    clear = {
        (a, b)
        for a, b in expected_pairs(pose, 60, 5.0)
        if a < b and not is_blocked_on(arrays, 0, *pose[a, :2], *pose[b, :2], *SIZE_M)
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


def test_without_a_torus_nothing_is_added() -> None:
    assert to_nearest(5.9, 0.0) == 0.0
    assert [5.9 + to_nearest(5.9, 6.0), -3.5 + to_nearest(-3.5, 6.0), 2.0 + to_nearest(2.0, 6.0)] == pytest.approx(
        [-0.1, 2.5, 2.0]
    )


@pytest.mark.parametrize("radio", [Radio(model="friis"), Radio(range_m=1.0, bodies_block=True)])
def test_what_no_torus_can_have_is_refused(radio: Radio) -> None:
    with pytest.raises(ValueError, match="expected a disk without bodies_block on a torus"):
        torus(radio, 2)
