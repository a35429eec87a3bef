import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.metrics.moment import Moment
from swarmwire.metrics.swarm.near_pairs import NearPairs
from tests.support.metrics.swarm.swarms import Swarm, rolled, stand, swarms


def found(swarm: Swarm, reach_m, finder=None):
    pairs = (finder or NearPairs(swarm.of, reach_m)).of(Moment(swarm.of, swarm.seen()))
    return sorted(tuple(sorted(pair)) for pair in pairs.tolist())


def expected(swarm: Swarm, reach_m):
    n = swarm.of.robots
    pairs = []
    for first in range(0, len(swarm.pose), n):
        apart_m = swarm.apart_m(swarm.pose[first : first + n])
        near = apart_m < reach_m[:, None] + reach_m[None, :]
        living = swarm.alive[first : first + n]
        pairs += [(first + i, first + j) for j in range(n) for i in range(j) if near[i, j] and living[i] and living[j]]
    return sorted(pairs)


@settings(max_examples=400)
@given(swarms(least=5), st.sampled_from([0.02, 0.2, 0.9, 1.3, 2.1, 9.0]), st.integers(0, 1000))
def test_they_are_those_of_all_pairs_each_once_whatever_the_reaches(swarm, reach_m, seed):
    reaches_m = reach_m * np.random.default_rng(seed).choice([0.3, 1.0, 1.01], swarm.of.robots)
    assert found(swarm, reaches_m) == expected(swarm, reaches_m)


@pytest.mark.parametrize("boundary", ["walls", "torus"])
def test_of_many_robots_that_move_they_are_found_tick_by_tick(boundary):
    rng = np.random.default_rng(1)
    place = rng.uniform([-4.0, -3.0], [4.0, 3.0], (200, 2))
    reach_m = rng.choice([0.02, 0.3], 200)
    finder = NearPairs(stand(*place, boundary=boundary).of, reach_m)
    for _ in range(5):
        place = rolled(place + rng.normal(0.0, 0.2, place.shape))
        swarm = stand(*place, boundary=boundary)
        assert found(swarm, reach_m, finder) == expected(swarm, reach_m)


@pytest.mark.parametrize("x", [-4.0, -3.0, -1.0, 0.0])
def test_half_a_torus_apart_is_one_pair_not_two(x):
    half = stand((x, 1.0), (x + 4.0, 1.0), boundary="torus")
    assert found(half, np.full(2, 2.5)) == [(0, 1)]


def test_robots_far_outside_an_open_arena_are_found():
    swarm = stand((0.0, 0.0), (900.0, -500.0), (900.1, -500.0), (-7.0, 2.0), boundary="open")
    assert found(swarm, np.full(4, 0.1)) == [(1, 2)]


def test_robots_of_different_arenas_are_no_pair():
    assert found(stand((0.0, 0.0), (0.0, 0.0), arenas=2), np.ones(1)) == []


def test_they_are_found_once_a_tick_for_all_who_ask_by_the_same_reaches_alone():
    swarm = stand((0.0, 0.0), (1.0, 0.0))
    wide, as_wide, narrow = (NearPairs(swarm.of, np.full(2, reach_m)) for reach_m in (0.6, 0.6, 0.4))
    moment = Moment(swarm.of, swarm.seen())
    assert as_wide.of(moment) is wide.of(moment)
    assert (len(wide.of(moment)), len(narrow.of(moment))) == (1, 0)
    assert wide.of(Moment(swarm.of, swarm.seen(1))) is not wide.of(moment)
