"""Partitions by name and by place: as many islands as the script says, and nothing crosses between them."""

from typing import Any

import numpy as np
import pytest

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.clock import tick_start_ns
from swarmwire.comms.events.effects import ActiveEffects
from swarmwire.comms.events.partition import Partition, Region
from swarmwire.comms.events.selection import Swarm
from swarmwire.comms.radio.config.radio import Radio
from tests.support.comms.radio.runs import RATE_HZ, Run, at, everybody, make_medium

# Robots a-0 to a-3 and b-0 to b-1, all in reach of one another.
POSE = at((-1, 0.5), (-0.5, -0.5), (-0.2, 0.3), (0.3, -0.2), (0.6, 0.7), (1, -0.7))
SWARM = Swarm({"a": range(4), "b": range(4, 6)}, 6, np.array([7], np.uint64), POSE)
EVERYBODY = {0, 1, 2, 3, 4, 5}


def partition(**keys: Any) -> Partition:
    return Partition(at_s=0.0, **keys)


def held(event: Partition, swarm: Swarm = SWARM) -> ActiveEffects:
    conditions = ActiveEffects(swarm.rows)
    event.check(swarm.groups)
    event.begin(0, swarm, conditions)
    return conditions


def broadcasts(conditions: ActiveEffects, pose: FloatArray = POSE) -> Run:
    """Everybody broadcasts once under these conditions."""
    medium = make_medium(Radio(9.0, send_offset="tick"), len(pose))
    told = Run(medium)
    for tick in range(3):
        told.news.append(medium.step(tick_start_ns(tick, RATE_HZ), pose, conditions.disruption()))
        if tick == 1:
            medium.send(tick_start_ns(tick, RATE_HZ), tick, everybody(len(pose))(tick))
    told.last = medium.end()
    return told


def islands(edges: IntArray, robots: int) -> set[frozenset[int]]:
    """The connected components of a graph of pairs."""
    island = {robot: frozenset({robot}) for robot in range(robots)}
    for a, b in edges.tolist():
        both = island[a] | island[b]
        island.update(dict.fromkeys(both, both))
    return set(island.values())


def received_pairs(told: Run) -> set[tuple[int, int]]:
    return set(zip(told.received("sender").tolist(), told.received("receiver").tolist(), strict=True))


SCRIPTS: list[tuple[dict[str, Any], list[set[int]]]] = [
    ({"between": (("a",), ("b",))}, [{0, 1, 2, 3}, {4, 5}]),
    ({"between": (("a-0", "a-1"), ("a-2", "a-3"), ("b",))}, [{0, 1}, {2, 3}, {4, 5}]),
    ({"halves": "x"}, [{0, 1, 2}, {3, 4, 5}]),
    ({"halves": "y"}, [{1, 3, 5}, {0, 2, 4}]),
    ({"isolate": ("a-2",)}, [{2}, EVERYBODY - {2}]),
    ({"isolate": ("b", "a-0")}, [{4}, {5}, {0}, {1, 2, 3}]),
    ({"isolate": ("a", "b")}, [{robot} for robot in EVERYBODY]),
    ({"region": Region(radius_m=0.6)}, [{2, 3}, {0, 1, 4, 5}]),
    ({"region": Region(at=(1.0, 0.0), size_m=(1.0, 2.0))}, [{4, 5}, {0, 1, 2, 3}]),
]


@pytest.mark.parametrize(("keys", "sets"), SCRIPTS)
def test_there_are_as_many_islands_as_the_script_says_and_nothing_crosses(keys: dict[str, Any], sets: list[set[int]]):
    told = broadcasts(held(partition(**keys)))
    assert islands(told.edges, 6) == {frozenset(own) for own in sets}
    assert received_pairs(told) == {(a, b) for own in sets for a in own for b in own if a != b}
    received = sum(len(own) * (len(own) - 1) for own in sets)
    assert told.fates() == {fate: n for fate, n in (("RECEIVED", received), ("PARTITIONED", 30 - received)) if n}


def test_nothing_is_apart_any_more_once_it_is_over():
    for keys, _ in SCRIPTS:
        event = partition(**keys, for_s=1.0)
        conditions = held(event)
        event.end(0, conditions)
        assert broadcasts(conditions).fates() == {"RECEIVED": 30}


def test_a_bridge_hears_all_and_two_halves_hear_one_another_only_through_it():
    for keys, halves in (
        ({"bridge": ("a-2", "b-1")}, ({0, 1}, {3, 4})),
        ({"bridge": ("a-2",)}, ({0, 1, 3}, {4, 5})),
        ({"bridge": ("a-2", "b-1"), "halves": "y"}, ({1, 3}, {0, 4})),
    ):
        told = broadcasts(held(partition(**keys)))
        crossing = {(a, b) for a in halves[0] for b in halves[1]}
        crossing |= {(b, a) for a, b in crossing}
        assert received_pairs(told) == {(a, b) for a in range(6) for b in range(6) if a != b} - crossing
        assert islands(told.edges, 6) == {frozenset(EVERYBODY)}


@pytest.mark.parametrize(
    ("keys", "first"),
    [
        ({"between": (("b",), ("a",))}, {4, 5}),
        ({"halves": "x"}, {0, 1, 2}),
        ({"region": Region(radius_m=0.6)}, {2, 3}),
    ],
)
def test_one_way_the_second_set_does_not_hear_the_first_and_no_edge_joins_them(keys: dict[str, Any], first: set[int]):
    told = broadcasts(held(partition(**keys, one_way=True)))
    second = EVERYBODY - first
    unheard = {(a, b) for a in first for b in second}
    assert received_pairs(told) == {(a, b) for a in range(6) for b in range(6) if a != b} - unheard
    assert told.fates() == {"RECEIVED": 30 - len(unheard), "PARTITIONED": len(unheard)}
    assert islands(told.edges, 6) == {frozenset(first), frozenset(second)}


def test_sides_by_place_are_each_arenas_own_and_stay_those_of_the_beginning():
    two = Swarm(SWARM.groups, 6, np.array([7, 8], np.uint64), np.concatenate([POSE, -POSE]))
    conditions = held(partition(halves="x"), two)
    assert conditions.disruption().sides.tolist() == [[1, 1, 1, 2, 2, 2, 2, 2, 2, 1, 1, 1]]


def test_the_edge_of_a_region_belongs_to_it():
    pose = at((1, 0), (1.01, 0), (0, -2), (0, -2.01))
    assert Region(radius_m=1.0).holds(pose).tolist() == [True, False, False, False]
    assert Region(size_m=(2.0, 4.0)).holds(pose).tolist() == [True, False, True, False]
