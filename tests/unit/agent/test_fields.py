"""Fields: their formulas, their directions, and that what smooths a command does it."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.agent.fields import (
    Vectors,
    ahead,
    alignment,
    along,
    attraction,
    hysteresis,
    low_pass,
    mean_received,
    repulsion,
    repulsion_of_ranges,
    repulsion_of_rays,
    spacing,
    steered,
)
from swarmwire.agent.packet import Packets
from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.packets import Payloads, ReceivedPackets
from swarmwire.comms.sensors.rays import ProximityReading

angles = st.floats(-np.pi, np.pi)


def parts(of: Vectors) -> list[tuple[float, float]]:
    return list(zip(of.x.tolist(), of.y.tolist(), strict=True))


@pytest.mark.parametrize(
    ("range_m", "pull", "push"), [(0.0, 0.0, 1.0), (0.25, 0.0, 0.5), (0.5, 0.0, 0.0), (0.75, 0.5, 0.0), (9.0, 1.0, 0.0)]
)
def test_who_is_far_attracts_and_who_is_near_repels(range_m: float, pull: float, push: float) -> None:
    """Along the bearing, in proportion to the distance from where nothing acts, and at most 1."""
    far, bearing = np.array([range_m]), np.array([0.7])
    assert parts(attraction(far, bearing, 0.5))[0] == pytest.approx((pull * np.cos(0.7), pull * np.sin(0.7)))
    assert parts(repulsion(far, bearing, 0.5))[0] == pytest.approx((-push * np.cos(0.7), -push * np.sin(0.7)))


@given(st.floats(0.0, 10.0), angles)
def test_spacing_is_attraction_and_repulsion_in_one(range_m: float, bearing_rad: float) -> None:
    place = np.array([range_m]), np.array([bearing_rad]), 0.4
    assert parts(spacing(*place)) == parts(attraction(*place) + repulsion(*place))


@given(angles, angles)
def test_alignment_points_where_the_other_heads_seen_from_the_robot(theirs: float, own: float) -> None:
    turned = alignment(np.array([theirs]), np.array([own])).turned(np.array([own]))
    assert parts(turned)[0] == pytest.approx((np.cos(theirs), np.sin(theirs)))


def test_the_mean_is_over_the_packets_of_each_robot_and_nothing_without_any() -> None:
    zeros = np.zeros(3, np.int64)
    table = ReceivedPackets(np.array([0, 0, 2]), np.arange(3), zeros, zeros, {}, np.arange(3), Payloads.of([b""] * 3))
    received = Packets[Any](3, table, {}, ())
    mean = mean_received(received, Vectors(np.array([1.0, 2.0, 5.0]), np.array([0.0, 4.0, 6.0])))
    assert parts(mean) == [(1.5, 2.0), (0.0, 0.0), (5.0, 6.0)]


def test_rays_push_away_from_what_answers() -> None:
    spec = load_body("epuck").proximity
    assert spec is not None
    value = np.zeros((2, 8))
    value[1, 1] = 0.5  # at 50 degrees
    away = repulsion_of_rays(ProximityReading(value, spec))
    assert away.length.tolist() == pytest.approx([0.0, 0.5])
    assert away.angle_rad[1] == pytest.approx(np.deg2rad(-130.0))


@pytest.mark.parametrize("rays", [36, 360])
def test_a_scan_pushes_as_much_by_few_rays_as_by_many(rays: int) -> None:
    angle = 2.0 * np.pi * (np.arange(rays) + 0.5) / rays
    touching = np.where(np.cos(angle) > 0.0, 0.0, np.inf)  # a wall that fills the half ahead
    away = repulsion_of_ranges(touching[None, :], angle, 0.5)
    assert parts(away)[0] == pytest.approx((-1.0 / np.pi, 0.0), abs=2e-3)
    for range_m in (0.5, 3.0, np.inf):
        assert parts(repulsion_of_ranges(np.full((1, rays), range_m), angle, 0.5)) == [(0.0, 0.0)]


def test_vectors_add_up_and_are_weighed() -> None:
    one, other = Vectors(np.array([1.0, 2.0]), np.array([3.0, 4.0])), ahead(2)
    assert parts(2.0 * one - other) == [(1.0, 6.0), (3.0, 8.0)]
    assert parts(np.array([1.0, 0.5]) * one - other) == [(0.0, 3.0), (0.0, 2.0)]
    assert parts(one * np.array([0.0, 1.0])) == [(0.0, 0.0), (2.0, 4.0)]
    assert along(np.array([np.pi / 2.0])).angle_rad.tolist() == [np.pi / 2.0]


@pytest.mark.parametrize(
    ("wanted_rad", "speed", "turn"),
    [(0.0, 1.0, 0.0), (1.0, np.cos(1.0), 1.0), (-1.0, np.cos(1.0), -1.0), (2.5, 0.0, 2.5)],
)
def test_the_more_a_robot_has_to_turn_the_slower_it_drives(wanted_rad: float, speed: float, turn: float) -> None:
    linear, angular = steered(3.0 * along(np.array([wanted_rad])), speed_mps=0.2, turn_gain_per_s=1.5)
    assert (linear[0], angular[0]) == pytest.approx((0.2 * speed, 1.5 * turn))


def test_a_robot_that_wants_nothing_drives_straight_on() -> None:
    linear, angular = steered(0.0 * ahead(1), 0.2, 1.5)
    assert (linear[0], angular[0]) == (0.2, 0.0)


@pytest.mark.parametrize("period_s", [0.001, 0.01])
def test_a_low_pass_has_gone_63_percent_of_the_way_after_its_time_constant(period_s: float) -> None:
    y = np.zeros(1)
    for _ in range(round(0.5 / period_s)):
        y = low_pass(y, np.ones(1), period_s, 0.5)
    assert y[0] == pytest.approx(1.0 - np.exp(-1.0), abs=period_s)


def test_without_a_time_constant_a_low_pass_lets_all_through() -> None:
    assert low_pass(np.array([3.0]), np.array([-1.0]), 0.1, 0.0).tolist() == [-1.0]


def test_hysteresis_goes_on_above_and_off_below_and_stays_in_between() -> None:
    on, seen = np.array([False]), list[bool]()
    for value in (0.5, 0.9, 1.0, 0.5, 0.3, np.nan, 0.2, 0.5, np.nan):
        on = hysteresis(on, np.array([value]), rises_to=1.0, falls_to=0.2)
        seen.append(bool(on[0]))
    assert seen == [False, False, True, True, True, True, False, False, False]
