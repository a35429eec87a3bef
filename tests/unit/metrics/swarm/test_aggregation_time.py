from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.metrics.swarm.aggregation_time import AggregationTime
from tests.support.metrics.swarm.swarms import stand, told

TICK_S = 0.1


def at_ticks(together, robots=5):
    """Truths in which so many robots of each arena stand in a heap, the others far apart: (ticks, arenas)."""
    table = np.atleast_2d(np.array(together).T).T
    place = np.zeros((*table.shape, robots, 2))
    place[..., 0] = np.where(np.arange(robots) < table[..., None], 0.01, 0.4) * np.arange(robots)
    swarms = [stand(*tick.reshape(-1, 2), arenas=table.shape[1]) for tick in place]
    return swarms[0].of, [swarm.seen(tick) for tick, swarm in enumerate(swarms)]


def time_s(together, robots=5, **parameters):
    of, ticks = at_ticks(together, robots)
    return told(AggregationTime(**parameters), *ticks, of=of)


def test_it_is_when_the_share_was_first_there():
    assert time_s([1, 2, 4, 1, 5]) == [pytest.approx(0.2)]
    assert np.isnan(time_s([1, 2, 3, 1, 3])).all()


def test_a_swarm_that_starts_together_has_zero():
    assert time_s([5, 1]) == [0.0]


def test_it_is_the_start_of_the_first_stretch_that_was_held():
    assert time_s([4, 1, 4, 4, 1, 4, 4, 4], hold_s=0.2) == [pytest.approx(0.5)]
    assert np.isnan(time_s([4, 1, 4, 4, 1, 4, 4], hold_s=0.2)).all()


@pytest.mark.parametrize(
    ("share", "robots", "least"), [(0.8, 5, 4), (0.6, 5, 3), (0.28, 25, 7), (0.81, 5, 5), (0.01, 5, 1)]
)
def test_the_share_is_rounded_up_to_robots(share, robots, least):
    assert time_s([least], robots, share=share) == [0.0]
    if least > 1:
        assert np.isnan(time_s([least - 1], robots, share=share)).all()


def test_it_stays_once_it_is_known():
    assert time_s([1, 5, 1, 1, 5]) == [pytest.approx(0.1)]


def test_by_one_hop_a_chain_is_not_together_and_a_star_is():
    apart_m = 3.9 * stand((0, 0)).of.groups[0].body.radius_m
    chain = stand(*((apart_m * k, 0) for k in range(5)))
    star = stand((0, 0), (apart_m, 0), (-apart_m, 0), (0, apart_m), (0, -apart_m))
    ticks = chain.seen(0), star.seen(1)
    assert told(AggregationTime(), *ticks, of=chain.of) == [0.0]
    assert told(AggregationTime(reading="hop"), *ticks, of=chain.of) == [pytest.approx(TICK_S)]
    assert told(AggregationTime(reading="hop", share=0.6), *ticks, of=chain.of) == [0.0]


def test_the_dead_are_not_asked_for():
    of, [seen] = at_ticks([1])
    assert np.isnan(told(AggregationTime(), seen, of=of)).all()
    assert told(AggregationTime(), replace(seen, alive=np.arange(5) == 3), of=of) == [0.0]
    assert np.isnan(told(AggregationTime(), replace(seen, alive=np.zeros(5, np.bool_)), of=of)).all()


@settings(max_examples=50)
@given(st.lists(st.tuples(*[st.integers(1, 5)] * 3), min_size=1, max_size=12), st.integers(0, 4))
def test_each_arena_has_the_start_of_its_own_first_long_stretch(together, hold):
    values = []
    for own in zip(*together, strict=True):
        starts = [k for k in range(len(own) - hold) if all(robots >= 4 for robots in own[k : k + hold + 1])]
        values.append(starts[0] * TICK_S if starts else np.nan)
    assert time_s(together, hold_s=hold * TICK_S) == pytest.approx(values, nan_ok=True)
