"""Who is together: clusters, flocks of one hop, and when most of the swarm had come together."""

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.metrics.measures.swarm.aggregation import AggregationHop, AggregationRatio, AggregationTime
from tests.support.metrics.swarms import last_values, measure, stand, swarms

RADIUS_M = stand((0, 0)).static.groups[0].body.radius_m
gaps = st.sampled_from([None, 0.01, 0.4, 2.0])


def close(swarm, pose, radius_m, gap_m):
    """Who is close to whom, (n, n)."""
    gaps_m = swarm.apart_m(pose) - radius_m[:, None] - radius_m[None, :]
    return gaps_m < (radius_m[:, None] + radius_m[None, :] if gap_m is None else gap_m)


@given(swarms(), gaps)
def test_aggregation_is_the_largest_component_of_small_gaps(swarm, gap_m):
    values = []
    for pose, radius_m in swarm.arenas:
        graph = nx.from_numpy_array(close(swarm, pose, radius_m, gap_m))
        values.append(max(map(len, nx.connected_components(graph))) / len(pose) if len(pose) else np.nan)
    assert measure(AggregationRatio(gap_m=gap_m), swarm) == pytest.approx(values, nan_ok=True)


@given(swarms(), gaps)
def test_within_one_hop_it_is_that_of_the_algorithm(swarm, gap_m):
    values = []
    for pose, radius_m in swarm.arenas:
        near, flocks = close(swarm, pose, radius_m, gap_m), []
        for robot in range(len(pose)):
            if not any(robot in flock for flock in flocks):
                flocks.append({robot} | {other for other in range(len(pose)) if near[robot, other]})
        values.append(max(map(len, flocks)) / len(pose) if flocks else np.nan)
    assert measure(AggregationHop(gap_m=gap_m), swarm) == pytest.approx(values, nan_ok=True)


def test_within_one_hop_the_numbers_of_robots_decide():
    apart_m = 3.9 * RADIUS_M
    assert measure("aggregation_hop", stand((0, 0), (apart_m, 0), (-apart_m, 0))) == [1.0]
    assert measure("aggregation_hop", stand((-apart_m, 0), (0, 0), (apart_m, 0))) == [pytest.approx(2 / 3)]


@pytest.mark.parametrize(("diameters", "share"), [(1.99, 1.0), (2.01, 0.5)])
def test_by_default_the_gap_is_a_diameter_from_surface_to_surface(diameters, share):
    two = stand((0, 0), (2.0 * RADIUS_M * diameters, 0))
    assert measure("aggregation", two) == measure("aggregation_hop", two) == [share]


TICK_S = 0.1


def at_ticks(together, robots=5):
    """Truths in which so many robots of each arena stand in a heap, the others far apart: (ticks, arenas)."""
    table = np.atleast_2d(np.array(together).T).T
    position = np.zeros((*table.shape, robots, 2))
    position[..., 0] = np.where(np.arange(robots) < table[..., None], 0.01, 0.4) * np.arange(robots)
    swarms = [stand(*tick.reshape(-1, 2), arenas=table.shape[1]) for tick in position]
    return swarms[0].static, [swarm.truth(tick) for tick, swarm in enumerate(swarms)]


def time_s(together, robots=5, **parameters):
    run, ticks = at_ticks(together, robots)
    return last_values(AggregationTime(**parameters), *ticks, run=run)


@pytest.mark.parametrize(
    ("share", "robots", "least"), [(0.8, 5, 4), (0.6, 5, 3), (0.28, 25, 7), (0.81, 5, 5), (0.01, 5, 1)]
)
def test_aggregation_share_is_rounded_up_to_robots(share, robots, least):
    assert time_s([least], robots, share=share) == [0.0]
    if least > 1:
        assert np.isnan(time_s([least - 1], robots, share=share)).all()


def test_by_one_hop_a_chain_is_not_together_and_a_star_is():
    apart_m = 3.9 * stand((0, 0)).static.groups[0].body.radius_m
    chain = stand(*((apart_m * k, 0) for k in range(5)))
    star = stand((0, 0), (apart_m, 0), (-apart_m, 0), (0, apart_m), (0, -apart_m))
    ticks = chain.truth(0), star.truth(1)
    assert last_values(AggregationTime(), *ticks, run=chain.static) == [0.0]
    assert last_values(AggregationTime(reading="hop"), *ticks, run=chain.static) == [pytest.approx(TICK_S)]
    assert last_values(AggregationTime(reading="hop", share=0.6), *ticks, run=chain.static) == [0.0]


@settings(max_examples=50)
@given(st.lists(st.tuples(*[st.integers(1, 5)] * 3), min_size=1, max_size=12), st.integers(0, 4))
def test_aggregation_time_of_each_arena_is_that_of_its_own_stretch(together, hold):
    values = []
    for own in zip(*together, strict=True):
        starts = [k for k in range(len(own) - hold) if all(robots >= 4 for robots in own[k : k + hold + 1])]
        values.append(starts[0] * TICK_S if starts else np.nan)
    assert time_s(together, hold_s=hold * TICK_S) == pytest.approx(values, nan_ok=True)
