"""Each kind of drive clips what it cannot follow in its own way, and clipped commands are counted."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.bodies.body import body_from
from swarmwire.comms.truth import Group
from swarmwire.world.actuation.actuators import drive_limits_of, take_commands

FORCES = {"max_force_n": 1.0, "max_torque_nm": 2.0}
DRIVES: dict[str, dict[str, Any]] = {
    "wheels": {"wheel_base_m": 0.1, "max_wheel_mps": 0.2, **FORCES},
    "twist": {"wheel_base_m": 0.16, "max_linear_mps": 0.22, "max_angular_radps": 2.5, **FORCES},
    "holonomic": {"max_speed_mps": 0.5, "max_angular_radps": 3.0, **FORCES},
}
SPEEDS = st.floats(-1e3, 1e3)


def group(kind: str, start: int = 0, robots: int = 1) -> Group:
    drive = {"kind": kind, **DRIVES[kind]}
    return Group(kind, body_from({"like": "footbot", "name": kind, "drive": drive}, kind), start, start + robots)


def taken(kind: str, linear_mps: float, angular_radps: float, lateral_mps: float) -> tuple[list[float], int]:
    """What becomes of one command, and how many were clipped."""
    command = np.full((1, 3), 9.0)
    asked = (np.array([speed]) for speed in (linear_mps, angular_radps, lateral_mps))
    alive, rows, drive = np.ones(1, np.bool_), np.zeros(1, np.int64), np.ones(1, np.bool_)
    clipped, not_finite = take_commands(drive_limits_of([group(kind)]), alive, rows, drive, *asked, command)
    assert not_finite.tolist() == [0]
    return command[0].tolist(), int(clipped[0])


@given(SPEEDS, SPEEDS)
def test_wheels_slow_both_speeds_so_that_the_curve_stays(linear: float, angular: float) -> None:
    (forward, turn, left), clipped = taken("wheels", linear, angular, 0.0)
    fastest = abs(linear) + 0.05 * abs(angular)
    assert abs(forward) + 0.05 * abs(turn) <= 0.2 * (1.0 + 1e-8)
    assert forward * angular == pytest.approx(turn * linear)
    assert left == 0.0
    assert clipped == (fastest > 0.2 * (1.0 + 1e-9))
    if fastest <= 0.2:
        assert (forward, turn) == (linear, angular)


@given(SPEEDS, SPEEDS)
def test_a_twist_drive_cuts_each_speed_to_its_own_limit(linear: float, angular: float) -> None:
    (forward, turn, left), clipped = taken("twist", linear, angular, 0.0)
    assert forward == pytest.approx(np.clip(linear, -0.22, 0.22), rel=2e-9)
    assert turn == pytest.approx(np.clip(angular, -2.5, 2.5), rel=2e-9)
    assert left == 0.0
    assert clipped == (abs(linear) > 0.22 * (1.0 + 1e-9) or abs(angular) > 2.5 * (1.0 + 1e-9))


@given(SPEEDS, SPEEDS, SPEEDS)
def test_a_holonomic_drive_keeps_the_direction_and_cuts_the_turn(linear: float, angular: float, lateral: float) -> None:
    (forward, turn, left), clipped = taken("holonomic", linear, angular, lateral)
    asked = np.hypot(linear, lateral)
    assert np.hypot(forward, left) == pytest.approx(min(asked, 0.5), rel=2e-9)
    assert forward * lateral == pytest.approx(left * linear)
    assert (forward * linear >= 0.0, left * lateral >= 0.0) == (True, True)
    assert turn == pytest.approx(np.clip(angular, -3.0, 3.0), rel=2e-9)
    assert clipped == (asked > 0.5 * (1.0 + 1e-9) or abs(angular) > 3.0 * (1.0 + 1e-9))


@pytest.mark.parametrize("kind", ["wheels", "twist"])
def test_wheels_do_not_move_sideways_and_say_so(kind: str) -> None:
    assert taken(kind, 0.1, 0.2, 0.05) == ([0.1, 0.2, 0.0], 1)


@pytest.mark.parametrize("kind", list(DRIVES))
def test_the_full_speed_of_the_sheet_is_not_clipped(kind: str) -> None:
    body = group(kind).body
    assert taken(kind, body.max_linear_mps, 0.0, 0.0) == ([body.max_linear_mps, 0.0, 0.0], 0)
    assert taken(kind, 0.0, -body.max_angular_radps, 0.0) == ([0.0, -body.max_angular_radps, 0.0], 0)


def test_each_robot_has_the_limits_of_its_own_drive_in_every_arena() -> None:
    limits = drive_limits_of([group("wheels"), group("holonomic", 1, 2)])
    command, rows, full = np.zeros((6, 3)), np.array([5, 3, 0, 1]), np.full(4, 1.0)
    every = np.ones(6, np.bool_)
    clipped, _ = take_commands(limits, every, rows, np.ones(4, np.bool_), full, 0.0 * full, full, command)
    share = 0.5 / np.sqrt(2.0)
    expected = [[0.2, 0, 0], [share, 0, share], [0, 0, 0], [0.2, 0, 0], [0, 0, 0], [share, 0, share]]
    np.testing.assert_allclose(command, expected)
    assert clipped.tolist() == [2, 2]


def test_no_command_a_dead_robot_and_what_is_not_finite_change_nothing() -> None:
    limits = drive_limits_of([group("holonomic", 0, 4)])
    command, rows = np.full((4, 3), 0.1), np.arange(4)
    alive, drive = np.array([True, False, True, True]), np.array([False, True, True, True])
    lateral = np.array([np.nan, np.nan, np.inf, 0.2])
    clipped, not_finite = take_commands(limits, alive, rows, drive, np.zeros(4), np.zeros(4), lateral, command)
    assert (clipped.tolist(), not_finite.tolist()) == (
        [0],
        [2],
    )  # the dead robot's, too; of robot 0 there is no command
    assert command.tolist() == [[0.1, 0.1, 0.1]] * 3 + [[0.0, 0.0, 0.2]]
