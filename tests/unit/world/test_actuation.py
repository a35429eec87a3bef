"""Actuation: drives, limits, noise, LEDs."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.observe.truth import Group
from swarmwire.comms.robot.bodies.body import body_from, load_body
from swarmwire.comms.robot.bodies.drives import twist_of_wheels, wheels_of_twist
from swarmwire.comms.robot.tick_io import Actions, SparseTable
from swarmwire.world import world as world_module
from swarmwire.world.actuation.actuators import Actuators, LedStates, NewCommands, drive_limits_of, limit_commands
from swarmwire.world.world import World
from tests.support.world.scenes import commanded, posed

FORCES = {"max_force_n": 1.5, "max_torque_nm": 1.5}
HOLONOMIC = {"kind": "holonomic", "max_speed_mps": 0.5, "max_angular_radps": 3.0, **FORCES}
TWIST = {"kind": "twist", "wheel_base_m": 0.05, "max_linear_mps": 0.1, "max_angular_radps": 2.0, **FORCES}
RATE_HZ = 10
LIMIT_FORCES = {"max_force_n": 1.0, "max_torque_nm": 2.0}
DRIVES: dict[str, dict[str, Any]] = {
    "wheels": {"wheel_base_m": 0.1, "max_wheel_mps": 0.2, **LIMIT_FORCES},
    "twist": {"wheel_base_m": 0.16, "max_linear_mps": 0.22, "max_angular_radps": 2.5, **LIMIT_FORCES},
    "holonomic": {"max_speed_mps": 0.5, "max_angular_radps": 3.0, **LIMIT_FORCES},
}
SPEEDS = st.floats(-1e3, 1e3)
BASE_M = 0.053  # the e-puck's
ROBOTS = 2000
KEYS = np.array([derive_key("arena", seed) for seed in (4, 5)], np.uint64)
GROUPS = (Group("a", load_body("epuck"), 0, 2), Group("b", load_body("footbot"), 2, 3))
EVERYBODY = np.ones(6, np.bool_)


def driven(monkeypatch: pytest.MonkeyPatch, drive: dict[str, Any], pose: list[float]) -> World:
    body = body_from({"like": "epuck", "name": "mine", "drive": drive}, "mine.toml")
    monkeypatch.setattr(world_module, "bodies_of", lambda *_: {"a": body})
    return World(posed([pose]), [1], {})


def after(world: World, seconds: float, linear: float, angular: float, lateral: float = 0.0) -> Any:
    for _ in range(round(seconds * RATE_HZ)):
        world.move(commanded(world, linear, angular, lateral))
    return world.pose[0]


def test_holonomic_body_moves_sideways_in_its_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    heading = 0.7
    x_m, y_m, turned = after(driven(monkeypatch, HOLONOMIC, [0.0, 0.0, heading]), 4.0, 0.0, 0.0, 0.2)
    assert turned == pytest.approx(heading, abs=1e-6)
    left = np.array([-np.sin(heading), np.cos(heading)])
    np.testing.assert_allclose([x_m, y_m], 0.8 * left, atol=0.01)  # minus the time to reach its speed


def test_twist_drive_turns_and_drives_at_both_limits_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    world = driven(monkeypatch, TWIST, [0.0, 0.0, 0.0])
    after(world, 2.0, 9.0, 9.0)
    assert world.command.tolist() == [[0.1, 2.0, 0.0]]
    assert np.hypot(*world.velocity[0, :2]) == pytest.approx(0.1, rel=0.02)
    assert world.velocity[0, 2] == pytest.approx(2.0, rel=1e-3)
    assert world.counts()["clipped_commands"].tolist() == [20]


def group(kind: str, start: int = 0, robots: int = 1) -> Group:
    drive = {"kind": kind, **DRIVES[kind]}
    return Group(kind, body_from({"like": "footbot", "name": kind, "drive": drive}, kind), start, start + robots)


def limited(kind: str, linear_mps: float, angular_radps: float, lateral_mps: float) -> tuple[list[float], int]:
    """One command within the limits of a drive, and the number of clipped commands."""
    command = np.full((1, 3), 9.0)
    speeds = (np.array([speed]) for speed in (linear_mps, angular_radps, lateral_mps))
    alive, rows, drive = np.ones(1, np.bool_), np.zeros(1, np.int64), np.ones(1, np.bool_)
    clipped, not_finite = limit_commands(
        drive_limits_of([group(kind)]), alive, NewCommands(rows, drive, *speeds), command
    )
    assert not_finite.tolist() == [0]
    return command[0].tolist(), int(clipped[0])


@given(SPEEDS, SPEEDS)
def test_wheel_limit_scales_both_speeds_on_the_same_curve(linear: float, angular: float) -> None:
    (forward, turn, left), clipped = limited("wheels", linear, angular, 0.0)
    fastest = abs(linear) + 0.05 * abs(angular)
    assert abs(forward) + 0.05 * abs(turn) <= 0.2 * (1.0 + 1e-8)
    assert forward * angular == pytest.approx(turn * linear)
    assert left == 0.0
    assert clipped == (fastest > 0.2 * (1.0 + 1e-9))
    if fastest <= 0.2:
        assert (forward, turn) == (linear, angular)


@given(SPEEDS, SPEEDS)
def test_twist_drive_clips_each_speed_to_its_limit(linear: float, angular: float) -> None:
    (forward, turn, left), clipped = limited("twist", linear, angular, 0.0)
    assert forward == pytest.approx(np.clip(linear, -0.22, 0.22), rel=2e-9)
    assert turn == pytest.approx(np.clip(angular, -2.5, 2.5), rel=2e-9)
    assert left == 0.0
    assert clipped == (abs(linear) > 0.22 * (1.0 + 1e-9) or abs(angular) > 2.5 * (1.0 + 1e-9))


@given(SPEEDS, SPEEDS, SPEEDS)
def test_holonomic_drive_keeps_the_direction_and_clips_the_turn(linear: float, angular: float, lateral: float) -> None:
    (forward, turn, left), clipped = limited("holonomic", linear, angular, lateral)
    speed = np.hypot(linear, lateral)
    assert np.hypot(forward, left) == pytest.approx(min(speed, 0.5), rel=2e-9)
    assert forward * lateral == pytest.approx(left * linear)
    assert (forward * linear >= 0.0, left * lateral >= 0.0) == (True, True)
    assert turn == pytest.approx(np.clip(angular, -3.0, 3.0), rel=2e-9)
    assert clipped == (speed > 0.5 * (1.0 + 1e-9) or abs(angular) > 3.0 * (1.0 + 1e-9))


@pytest.mark.parametrize("kind", ["wheels", "twist"])
def test_lateral_speed_of_wheels_is_clipped_and_counted(kind: str) -> None:
    assert limited(kind, 0.1, 0.2, 0.05) == ([0.1, 0.2, 0.0], 1)


@pytest.mark.parametrize("kind", list(DRIVES))
def test_full_speed_of_the_sheet_is_not_clipped(kind: str) -> None:
    body = group(kind).body
    assert limited(kind, body.max_linear_mps, 0.0, 0.0) == ([body.max_linear_mps, 0.0, 0.0], 0)
    assert limited(kind, 0.0, -body.max_angular_radps, 0.0) == ([0.0, -body.max_angular_radps, 0.0], 0)


def test_limits_are_those_of_the_drive_of_each_robot_in_every_arena() -> None:
    limits = drive_limits_of([group("wheels"), group("holonomic", 1, 2)])
    command, rows, full = np.zeros((6, 3)), np.array([5, 3, 0, 1]), np.full(4, 1.0)
    every = np.ones(6, np.bool_)
    new = NewCommands(rows, np.ones(4, np.bool_), full, 0.0 * full, full)
    clipped, _ = limit_commands(limits, every, new, command)
    share = 0.5 / np.sqrt(2.0)
    expected = [[0.2, 0, 0], [share, 0, share], [0, 0, 0], [0.2, 0, 0], [0, 0, 0], [share, 0, share]]
    np.testing.assert_allclose(command, expected)
    assert clipped.tolist() == [2, 2]


def test_commands_of_dead_robots_or_not_finite_change_nothing() -> None:
    limits = drive_limits_of([group("holonomic", 0, 4)])
    command, rows = np.full((4, 3), 0.1), np.arange(4)
    alive, drive = np.array([True, False, True, True]), np.array([False, True, True, True])
    lateral = np.array([np.nan, np.nan, np.inf, 0.2])
    new = NewCommands(rows, drive, np.zeros(4), np.zeros(4), lateral)
    clipped, not_finite = limit_commands(limits, alive, new, command)
    assert (clipped.tolist(), not_finite.tolist()) == ([0], [2])  # including the dead robot; robot 0 has no command
    assert command.tolist() == [[0.1, 0.1, 0.1]] * 3 + [[0.0, 0.0, 0.2]]


def noisy(robots: int = ROBOTS, keys: Any = KEYS, **noise: float) -> Actuators:
    body = body_from({"like": "epuck", "name": "noisy", "drive": {"noise": noise}}, "noisy.toml")
    return Actuators([Group("a", body, 0, robots)], keys)


def wheels_of(actuators: Actuators, left_mps: float, right_mps: float) -> Any:
    """Speeds of the wheels in the next tick, (arenas, robots, 2)."""
    rows = np.arange(len(actuators.command))
    ahead_mps, turn_radps = twist_of_wheels(left_mps, right_mps, BASE_M)
    command = np.full(len(rows), ahead_mps), np.full(len(rows), turn_radps), np.zeros(len(rows))
    actuators.apply(Actions(rows, np.ones(len(rows), np.bool_), *command), np.ones(len(rows), np.bool_))
    assert not actuators.target[..., 2].any()
    return np.stack(wheels_of_twist(actuators.target[..., 0], actuators.target[..., 1], BASE_M), axis=2)


def test_noise_bias_is_added_before_the_factor() -> None:
    got = wheels_of(noisy(factor=0.5, bias_mps=0.02), 0.1, -0.05)
    np.testing.assert_allclose(got[1, 3], [0.06, -0.015])


def test_noise_factors_are_normal_and_new_for_each_wheel_and_tick() -> None:
    noise = noisy(factor_std=0.05)
    factors = np.stack([wheels_of(noise, 0.1, 0.1) / 0.1 for _ in range(5)])
    count = factors.size  # 40,000: five standard errors, a false alarm in two million
    assert abs(factors.mean() - 1.0) < 5 * 0.05 / np.sqrt(count)
    assert abs(factors.std() - 0.05) < 5 * 0.05 / np.sqrt(2 * count)
    assert len(np.unique(factors.round(12))) > 0.999 * count


def test_noise_biases_are_drawn_once_for_each_wheel() -> None:
    noise = noisy(bias_std_mps=0.01)
    first, later = wheels_of(noise, 0.1, 0.12), wheels_of(noise, 0.1, 0.12)
    np.testing.assert_array_equal(first, later)
    bias = first - [0.1, 0.12]
    assert abs(bias.mean()) < 5 * 0.01 / np.sqrt(bias.size)
    assert abs(bias.std() - 0.01) < 5 * 0.01 / np.sqrt(2 * bias.size)
    assert abs(np.corrcoef(bias[..., 0].ravel(), bias[..., 1].ravel())[0, 1]) < 5 / np.sqrt(bias.size / 2)


def test_noise_does_not_move_wheels_that_stand_still() -> None:
    noise = noisy(bias_mps=0.1, factor_std=0.5)
    assert not wheels_of(noise, 0.0, 0.0).any()
    assert wheels_of(noise, 0.0, 1e-6).all()


def test_noise_is_equal_for_an_arena_alone_and_with_fewer_robots() -> None:
    both = wheels_of(noisy(bias_std_mps=0.01, factor_std=0.1), 0.1, 0.1)
    alone = wheels_of(noisy(bias_std_mps=0.01, factor_std=0.1, keys=KEYS[1:], robots=7), 0.1, 0.1)
    np.testing.assert_array_equal(alone[0], both[1, :7])


@pytest.mark.parametrize("kind", ["noisy", "still"])
def test_truth_has_the_command_while_noise_makes_robots_drift(kind: str) -> None:
    world = World(posed([[0.0, 0.0, 0.0]]), [1], {})
    if kind == "noisy":
        world.actuators = noisy(robots=1, keys=world.keys, bias_std_mps=0.02)
    for _ in range(20):
        world.move(commanded(world, 0.05, 0.0))
    assert world.command.tolist() == [[0.05, 0.0, 0.0]]
    assert (abs(world.pose[0, 2]) > 0.01) == (kind == "noisy")
    assert (world.actuators.target[0, 0].tolist() == [0.05, 0.0, 0.0]) == (kind == "still")


def changes(*listed: tuple[int, int, int]) -> SparseTable:
    rows, slot, rgb = np.array(listed, np.int64).reshape(-1, 3).T
    return SparseTable(rows, slot, rgb.astype(float))


def test_led_holds_its_colour_until_it_is_switched_again() -> None:
    leds = LedStates(GROUPS, 2)
    inside = leds.rgb
    leds.apply(changes((4, 7, 0xFF0000), (2, 12, 0x00FF00)), EVERYBODY)
    before = leds.published
    leds.apply(changes(), EVERYBODY)
    assert leds.published is before
    assert (leds.rgb[1, 1, 7], leds.rgb[0, 2, 12], np.count_nonzero(leds.rgb)) == (0xFF0000, 0x00FF00, 2)
    leds.apply(changes((4, 7, 1), (4, 7, 0x0000FF), (2, 12, 0)), EVERYBODY)
    assert leds.rgb is inside
    assert (leds.published[4, 7], np.count_nonzero(leds.published)) == (0x0000FF, 1)
    assert before[4, 7] == 0xFF0000  # published arrays do not change


def test_led_that_a_robot_does_not_have_is_counted() -> None:
    leds = LedStates(GROUPS, 2)
    leds.apply(changes((0, 8, 5), (0, 7, 6), (2, 12, 7), (2, 2**40, 7)), EVERYBODY)
    assert leds.missing.tolist() == [2, 0]
    assert np.count_nonzero(leds.rgb) == 2


def test_bodies_without_leds_need_no_room() -> None:
    world = World(posed([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), [1, 2], {})
    assert world.actuators.leds.rgb.shape == (2, 2, 8)
    dark = LedStates([Group("a", replace(load_body("epuck"), leds=None), 0, 3)], 2)
    assert dark.published.shape == (6, 0)
    dark.apply(changes((0, 0, 5)), EVERYBODY)
    dark.darken(EVERYBODY)
    assert dark.missing.tolist() == [1, 0]


def test_world_switches_leds_and_darkens_dead_robots() -> None:
    world = World(posed([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), [1], {})

    def switch(*listed: tuple[int, int, int]) -> IntArray:
        still, rows = np.zeros(2), np.arange(2)
        world.move(Actions(rows, np.zeros(2, np.bool_), still, still, still, leds=changes(*listed)))
        return world.actuators.leds.published

    assert switch((0, 0, 5), (1, 3, 6), (1, 8, 9))[[0, 1], [0, 3]].tolist() == [5, 6]
    world.set_alive(np.array([True, False]))
    assert not world.actuators.leds.published[1].any()
    assert switch((0, 1, 7), (1, 1, 8))[:, :2].tolist() == [[5, 7], [0, 0]]
    world.set_alive(np.array([True, True]))
    assert np.count_nonzero(world.actuators.leds.published) == 2
    assert world.counts()["leds_not_there"].tolist() == [1]
