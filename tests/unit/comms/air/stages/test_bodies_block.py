"""Robots in between block the signal of a disk where the radio says so; both directions, and the dead as well."""

import numpy as np
import pytest

from swarmwire.comms.air.air import Air
from swarmwire.comms.air.presets.registry import PRESETS, with_preset
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.draws import derive_key
from swarmwire.comms.geometry.obstacles import obstacle_arrays
from tests.support.comms.air.runs import RATE_HZ, SIZE_M, at, everybody, run, scattered

RADIUS_M = 0.1
BLOCKING = Radio(9.0, send_offset="tick", bodies_block=True)


def air_of(radio: Radio, robots: int, arenas: int = 1) -> Air:
    """Without obstacles, every robot with the same radius."""
    keys = np.array([derive_key("bodies", arena) for arena in range(arenas)], np.uint64)
    radius_m = np.full(robots, RADIUS_M)
    return Air(radio, keys, robots, SIZE_M, obstacle_arrays(((),) * arenas), RATE_HZ, radius_m=radius_m)


@pytest.mark.parametrize(
    ("between_y_m", "fates"),
    [(0.0, {"HEARD": 4, "BLOCKED": 2}), (0.099, {"HEARD": 4, "BLOCKED": 2}), (0.101, {"HEARD": 6})],
)
def test_a_disc_on_the_line_between_two_centres_blocks_both_ways(between_y_m: float, fates: dict[str, int]):
    pose = at((-1, 0), (0, between_y_m), (1, 0))
    told = run(air_of(BLOCKING, 3), pose, everybody(3), 1)
    assert told.fates() == fates
    assert told.tally.in_range.tolist() == [fates["HEARD"]]


def test_bodies_do_not_block_unless_asked_to():
    told = run(air_of(Radio(9.0, send_offset="tick"), 3), at((-1, 0), (0, 0), (1, 0)), everybody(3), 1)
    assert told.fates() == {"HEARD": 6}


def test_the_dead_are_in_the_way_and_the_graph_has_no_edge_through_bodies():
    pose, alive = at((-1, 0), (0, 0), (1, 0)), np.array([True, False, True])
    air = air_of(BLOCKING, 3)
    assert air.edges(pose, np.ones(3, bool)).tolist() == [[0, 1], [1, 2]]
    assert air.edges(pose, alive).tolist() == []


def test_an_arena_among_others_is_blocked_as_it_is_alone():
    pose = scattered(60)
    together = run(air_of(BLOCKING, 30, 2), pose, everybody(60), 1).tally.fates
    alone = run(air_of(BLOCKING, 30), pose[:30], everybody(30), 1).tally.fates
    assert together[0].tolist() == alone[0].tolist()
    assert together[0].tolist() != together[1].tolist()


@pytest.mark.parametrize("name", ["argos-rab", "infrared-epuck"])
def test_infrared_presets_are_blocked_by_bodies(name: str):
    assert PRESETS[name].radio["bodies_block"]
    assert with_preset({"preset": name, "bodies_block": False})["bodies_block"] is False
