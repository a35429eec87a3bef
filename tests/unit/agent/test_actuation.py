from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.agent import Robot, Robots
from swarmwire.agent.agent_group import agent_group
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
from swarmwire.agent.testing import Trial, assert_equivalent, assert_rows_independent
from swarmwire.comms.base.errors import AgentFailed
from swarmwire.comms.robot.bodies.body import body_from, load_body
from swarmwire.comms.robot.packets import Payloads, ReceivedPackets
from swarmwire.comms.robot.sensors.rays import ProximityReading
from swarmwire.comms.robot.tick_io import Actions
from tests.support.agent.hosts import MEASURES, group, readings
from tests.support.agent.one_step import agent_doing, vector_agent_doing

ROWS = [1, 4, 6]
EPUCK_BASE_M = 0.053
FLOATING = {"kind": "holonomic", "max_speed_mps": 1, "max_angular_radps": 1, "max_force_n": 1, "max_torque_nm": 1}
angles = st.floats(-np.pi, np.pi)


def acted(kind: type[Any], **spec: Any) -> Actions:
    """What three robots of this body do in their first step."""
    body = body_from({"like": "epuck", "name": "mine", **spec}, "mine.toml")
    agents = agent_group(replace(group("", ROWS), body=body), kind)
    return agents.act((0, 0, 100_000_000), readings(0, ROWS), ReceivedPackets.none(MEASURES))


def colours(actions: Actions) -> dict[tuple[int, int], str]:
    table = actions.leds
    named = zip(table.rows.tolist(), table.slot.tolist(), table.integers.tolist(), strict=True)
    return {(row, which): f"{rgb:06x}" for row, which, rgb in named}


def test_lateral_speed_is_commanded_with_the_others_and_reset_by_a_later_drive() -> None:
    def twice(robot: Robot) -> None:
        robot.drive(0.1, 0.2, 0.3)
        robot.drive(0.1, 0.2)

    for kind in (
        agent_doing(lambda robot: robot.drive(0.1, 0.2, -0.3)),
        vector_agent_doing(lambda robots: robots.drive(0.1, 0.2, -0.3)),
    ):
        actions = acted(kind, drive=FLOATING)
        assert actions.drive.all()
        assert actions.lateral_mps.tolist() == [-0.3] * 3
    rows = np.array([True, False, True])
    masked = acted(vector_agent_doing(lambda robots: robots.drive(0.1, 0.2, np.arange(3.0), rows=rows)), drive=FLOATING)
    assert (masked.drive.tolist(), masked.lateral_mps.tolist()) == (rows.tolist(), [0.0, 0.0, 2.0])
    assert not acted(agent_doing(twice), drive=FLOATING).lateral_mps.any()


def test_wheel_speeds_become_forward_and_turn() -> None:
    all_robots = acted(agent_doing(lambda robot: robot.wheels(0.02, 0.05)))
    assert all_robots.drive.all()
    np.testing.assert_allclose(all_robots.linear_mps, 0.035)
    np.testing.assert_allclose(all_robots.angular_radps, 0.03 / EPUCK_BASE_M)
    rows = np.array([True, False, True])
    masked = acted(vector_agent_doing(lambda robots: robots.wheels([0.02, 0.0, 0.05], 0.05, rows=rows)))
    assert masked.drive.tolist() == rows.tolist()
    np.testing.assert_allclose(masked.linear_mps[rows], [0.035, 0.05])
    np.testing.assert_allclose(masked.angular_radps[rows], [0.03 / EPUCK_BASE_M, 0.0])
    assert not masked.linear_mps[1]


@pytest.mark.parametrize(
    ("kind", "fault"),
    [
        (agent_doing(lambda robot: robot.wheels(0.1, 0.1)), "the body mine has no wheels"),
        (vector_agent_doing(lambda robots: robots.wheels(0.1, 0.1)), "the body mine has no wheels"),
        (agent_doing(lambda robot: robot.led(1.0, 0.0, 0.0, index=8)), "LEDs 0 to 7, got 8"),
        (vector_agent_doing(lambda robots: robots.led(1.0, 0.0, 0.0, index=-1)), "LEDs 0 to 7, got -1"),
        (agent_doing(lambda robot: robot.led(255, 0, 0)), "expected numbers from 0 to 1, got 255"),
        (agent_doing(lambda robot: robot.led(0.0, -0.1, 0.0)), "expected numbers from 0 to 1, got -0.1"),
        (vector_agent_doing(lambda robots: robots.led(0.0, 0.0, [0.1, np.nan, 0.2])), "expected numbers from 0 to 1"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_actuation_that_the_body_lacks_is_refused(kind: type[Any], fault: str) -> None:
    with pytest.raises(AgentFailed) as caught:
        acted(kind, drive=FLOATING)
    assert fault in caught.value.traceback


def test_leds_of_a_body_without_them_are_refused() -> None:
    bare = replace(group("", ROWS), body=replace(group("", ROWS).body, leds=None))
    agents = agent_group(bare, agent_doing(lambda robot: robot.led(1.0, 0.0, 0.0)))
    with pytest.raises(AgentFailed, match="IncompatibleBody: the body epuck has no LEDs"):
        agents.act((0, 0, 100_000_000), readings(0, ROWS), ReceivedPackets.none(MEASURES))


def test_leds_take_the_last_colour_all_or_one() -> None:
    def paint(robot: Robot) -> None:
        robot.led(0.0, 1.0, 0.5)
        robot.led(1.0, 0.0, 0.0, index=3)

    for kind in (agent_doing(paint), vector_agent_doing(paint)):
        shown = colours(acted(kind))
        assert set(shown) == {(row, led) for row in ROWS for led in range(8)}
        assert {led: shown[4, led] for led in range(8)} == {**dict.fromkeys(range(8), "00ff80"), 3: "ff0000"}


def test_led_colours_differ_by_robot_within_a_mask_and_dark_is_a_colour() -> None:
    def paint(robots: Robots) -> None:
        robots.led(np.array([0.0, 0.5, 1.0]), 0.0, 1.0, index=2, rows=np.array([False, True, True]))
        robots.led(0.0, 0.0, 0.0, index=7, rows=np.array([True, False, False]))

    assert colours(acted(vector_agent_doing(paint))) == {(4, 2): "8000ff", (6, 2): "ff00ff", (1, 7): "000000"}
    assert len(acted(vector_agent_doing(lambda robots: robots.drive(0.1, 0.0))).leds) == 0


def test_leds_are_part_of_equivalence_and_independence() -> None:
    """A colour by the compass, on an LED by the tick."""

    def blink(handle: Any) -> None:
        handle.led(0.0, 0.5 + handle.compass.heading_rad / 8.0, 0.0, index=round(10.0 * handle.time_s) % 8)

    def blink_alike(robots: Any) -> None:
        heading = np.full(robots.n, robots.compass.heading_rad.mean())
        robots.led(0.0, 0.5 + heading / 8.0, 0.0, index=round(10.0 * robots.time_s) % 8)

    single = agent_doing(blink, "compass")
    many, alike = (vector_agent_doing(deed, "compass") for deed in (blink, blink_alike))
    assert_equivalent(single, many)
    assert_rows_independent(many, Trial(body="footbot"))
    with pytest.raises(AssertionError, match=r"in tick 0, robot 0:\n  led 0: 0x"):
        assert_equivalent(single, alike)
    with pytest.raises(AssertionError, match=r"in tick 0, robot 0:\n  led 0: 0x"):
        assert_rows_independent(alike)


def parts(vectors: Vectors) -> list[tuple[float, float]]:
    return list(zip(vectors.x.tolist(), vectors.y.tolist(), strict=True))


@pytest.mark.parametrize(
    ("range_m", "pull", "push"), [(0.0, 0.0, 1.0), (0.25, 0.0, 0.5), (0.5, 0.0, 0.0), (0.75, 0.5, 0.0), (9.0, 1.0, 0.0)]
)
def test_attraction_acts_from_far_and_repulsion_from_near(range_m: float, pull: float, push: float) -> None:
    """Along the bearing, in proportion to the distance from where nothing acts, and at most 1."""
    far, bearing = np.array([range_m]), np.array([0.7])
    assert parts(attraction(far, bearing, 0.5))[0] == pytest.approx((pull * np.cos(0.7), pull * np.sin(0.7)))
    assert parts(repulsion(far, bearing, 0.5))[0] == pytest.approx((-push * np.cos(0.7), -push * np.sin(0.7)))


@given(st.floats(0.0, 10.0), angles)
def test_spacing_is_attraction_and_repulsion_in_one(range_m: float, bearing_rad: float) -> None:
    neighbour = np.array([range_m]), np.array([bearing_rad]), 0.4
    assert parts(spacing(*neighbour)) == parts(attraction(*neighbour) + repulsion(*neighbour))


@given(angles, angles)
def test_alignment_is_the_neighbours_heading_in_the_robots_frame(theirs: float, heading: float) -> None:
    turned = alignment(np.array([theirs]), np.array([heading])).turned(np.array([heading]))
    assert parts(turned)[0] == pytest.approx((np.cos(theirs), np.sin(theirs)))


def test_mean_received_is_per_robot_and_zero_without_packets() -> None:
    zeros = np.zeros(3, np.int64)
    table = ReceivedPackets(
        np.array([0, 0, 2]), np.arange(3), zeros, zeros, {}, np.arange(3), Payloads.from_rows([b""] * 3)
    )
    received = Packets[Any](3, table, {}, ())
    mean = mean_received(received, Vectors(np.array([1.0, 2.0, 5.0]), np.array([0.0, 4.0, 6.0])))
    assert parts(mean) == [(1.5, 2.0), (0.0, 0.0), (5.0, 6.0)]


def test_repulsion_of_rays_points_away_from_answers() -> None:
    spec = load_body("epuck").proximity
    assert spec is not None
    value = np.zeros((2, 8))
    value[1, 1] = 0.5  # at 50 degrees
    away = repulsion_of_rays(ProximityReading(value, spec))
    assert away.length.tolist() == pytest.approx([0.0, 0.5])
    assert away.angle_rad[1] == pytest.approx(np.deg2rad(-130.0))


@pytest.mark.parametrize("rays", [36, 360])
def test_repulsion_of_ranges_does_not_depend_on_the_number_of_rays(rays: int) -> None:
    angle = 2.0 * np.pi * (np.arange(rays) + 0.5) / rays
    touching = np.where(np.cos(angle) > 0.0, 0.0, np.inf)  # a wall that fills the half ahead
    away = repulsion_of_ranges(touching[None, :], angle, 0.5)
    assert parts(away)[0] == pytest.approx((-1.0 / np.pi, 0.0), abs=2e-3)
    for range_m in (0.5, 3.0, np.inf):
        assert parts(repulsion_of_ranges(np.full((1, rays), range_m), angle, 0.5)) == [(0.0, 0.0)]


def test_vectors_are_added_and_weighted() -> None:
    first, other = Vectors(np.array([1.0, 2.0]), np.array([3.0, 4.0])), ahead(2)
    assert parts(2.0 * first - other) == [(1.0, 6.0), (3.0, 8.0)]
    assert parts(np.array([1.0, 0.5]) * first - other) == [(0.0, 3.0), (0.0, 2.0)]
    assert parts(first * np.array([0.0, 1.0])) == [(0.0, 0.0), (2.0, 4.0)]
    assert along(np.array([np.pi / 2.0])).angle_rad.tolist() == [np.pi / 2.0]


@pytest.mark.parametrize(
    ("wanted_rad", "speed", "turn"),
    [(0.0, 1.0, 0.0), (1.0, np.cos(1.0), 1.0), (-1.0, np.cos(1.0), -1.0), (2.5, 0.0, 2.5)],
)
def test_steered_drives_more_slowly_with_a_larger_turn(wanted_rad: float, speed: float, turn: float) -> None:
    linear, angular = steered(3.0 * along(np.array([wanted_rad])), speed_mps=0.2, turn_gain_per_s=1.5)
    assert (linear[0], angular[0]) == pytest.approx((0.2 * speed, 1.5 * turn))
    straight = steered(0.0 * ahead(1), 0.2, 1.5)
    assert (straight[0].item(), straight[1].item()) == (0.2, 0.0)


@pytest.mark.parametrize("period_s", [0.001, 0.01])
def test_low_pass_reaches_63_percent_after_its_time_constant(period_s: float) -> None:
    y = np.zeros(1)
    for _ in range(round(0.5 / period_s)):
        y = low_pass(y, np.ones(1), period_s, 0.5)
    assert y[0] == pytest.approx(1.0 - np.exp(-1.0), abs=period_s)
    assert low_pass(np.array([3.0]), np.array([-1.0]), 0.1, 0.0).tolist() == [-1.0]


def test_hysteresis_switches_on_above_off_below_and_stays_in_between() -> None:
    on, states = np.array([False]), list[bool]()
    for value in (0.5, 0.9, 1.0, 0.5, 0.3, np.nan, 0.2, 0.5, np.nan):
        on = hysteresis(on, np.array([value]), rises_to=1.0, falls_to=0.2)
        states.append(bool(on[0]))
    assert states == [False, False, True, True, True, True, False, False, False]
