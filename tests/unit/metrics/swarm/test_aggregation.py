from dataclasses import replace

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.metrics.swarm.aggregation import Aggregation
from swarmwire.metrics.swarm.aggregation_hop import AggregationHop
from tests.support.metrics.swarm.swarms import mixed, said, stand, swarms

RADIUS_M = stand((0, 0)).of.groups[0].body.radius_m
gaps = st.sampled_from([None, 0.01, 0.4, 2.0])


def close(swarm, pose, radius_m, gap_m):
    """Who is close to whom, (n, n)."""
    gaps_m = swarm.apart_m(pose) - radius_m[:, None] - radius_m[None, :]
    return gaps_m < (radius_m[:, None] + radius_m[None, :] if gap_m is None else gap_m)


@given(swarms(), gaps)
def test_it_is_the_largest_component_of_the_graph_of_small_gaps(swarm, gap_m):
    values = []
    for pose, radius_m in swarm.arenas:
        graph = nx.from_numpy_array(close(swarm, pose, radius_m, gap_m))
        values.append(max(map(len, nx.connected_components(graph))) / len(pose) if len(pose) else np.nan)
    assert said(Aggregation(gap_m=gap_m), swarm) == pytest.approx(values, nan_ok=True)


@given(swarms(), gaps)
def test_within_one_hop_it_is_that_of_the_algorithm(swarm, gap_m):
    values = []
    for pose, radius_m in swarm.arenas:
        near, flocks = close(swarm, pose, radius_m, gap_m), []
        for robot in range(len(pose)):
            if not any(robot in flock for flock in flocks):
                flocks.append({robot} | {other for other in range(len(pose)) if near[robot, other]})
        values.append(max(map(len, flocks)) / len(pose) if flocks else np.nan)
    assert said(AggregationHop(gap_m=gap_m), swarm) == pytest.approx(values, nan_ok=True)


@given(swarms(), gaps)
def test_one_hop_reaches_no_more_than_many(swarm, gap_m):
    hop, all_hops = said(AggregationHop(gap_m=gap_m), swarm), said(Aggregation(gap_m=gap_m), swarm)
    assert all(np.isnan(few) or few <= many for few, many in zip(hop, all_hops, strict=True))


def test_a_star_is_one_flock_either_way_and_a_chain_is_not():
    apart_m = 3.9 * RADIUS_M
    star = [(0, 0), (apart_m, 0), (-apart_m, 0), (0, apart_m), (0, -apart_m)]
    assert said("aggregation", stand(*star)) == said("aggregation_hop", stand(*star)) == [1.0]
    chain = [(apart_m * k, 0) for k in range(5)]
    assert said("aggregation", stand(*chain)) == [1.0]
    assert said("aggregation_hop", stand(*chain)) == [pytest.approx(3 / 5)]  # {0, 1}, then {2, 1, 3}, then {4, 3}


def test_within_one_hop_the_numbers_of_robots_decide():
    apart_m = 3.9 * RADIUS_M
    assert said("aggregation_hop", stand((0, 0), (apart_m, 0), (-apart_m, 0))) == [1.0]
    assert said("aggregation_hop", stand((-apart_m, 0), (0, 0), (apart_m, 0))) == [pytest.approx(2 / 3)]


@pytest.mark.parametrize(("diameters", "share"), [(1.99, 1.0), (2.01, 0.5)])
def test_by_default_the_gap_is_a_diameter_from_surface_to_surface(diameters, share):
    two = stand((0, 0), (2.0 * RADIUS_M * diameters, 0))
    assert said("aggregation", two) == said("aggregation_hop", two) == [share]


def test_of_mixed_bodies_it_is_the_mean_of_both_diameters():
    two = stand((0, 0), (1, 0))
    both = replace(two, of=mixed(two.of, 1))
    sum_m = sum(group.body.radius_m for group in both.of.groups)
    for apart_m, share in ((1.99 * sum_m, 1.0), (2.01 * sum_m, 0.5)):
        pose = both.pose.copy()
        pose[1, 0] = apart_m
        assert said("aggregation", replace(both, pose=pose)) == [share]


def test_the_dead_neither_count_nor_join():
    chain = stand(*[(3.9 * RADIUS_M * k, 0) for k in range(5)])
    split = replace(chain, alive=np.array([True, True, False, True, True]))
    assert said("aggregation", split) == said("aggregation_hop", split) == [0.5]
