"""Each drive moves its body as far and in the direction that it was asked for."""

from typing import Any

import numpy as np
import pytest

from swarmwire.comms.bodies.body import body_from
from swarmwire.world import world as world_module
from swarmwire.world.world import World
from tests.support.world.samples import commanded, posed

FORCES = {"max_force_n": 1.5, "max_torque_nm": 1.5}
HOLONOMIC = {"kind": "holonomic", "max_speed_mps": 0.5, "max_angular_radps": 3.0, **FORCES}
TWIST = {"kind": "twist", "wheel_base_m": 0.05, "max_linear_mps": 0.1, "max_angular_radps": 2.0, **FORCES}
RATE_HZ = 10


def driven(monkeypatch: pytest.MonkeyPatch, drive: dict[str, Any], pose: list[float]) -> World:
    body = body_from({"like": "epuck", "name": "mine", "drive": drive}, "mine.toml")
    monkeypatch.setattr(world_module, "bodies_of", lambda *_: {"a": body})
    return World(posed([pose]), [1], {})


def after(world: World, seconds: float, linear: float, angular: float, lateral: float = 0.0) -> Any:
    for _ in range(round(seconds * RATE_HZ)):
        world.move(commanded(world, linear, angular, lateral))
    return world.pose[0]


def test_a_holonomic_body_moves_sideways_in_its_own_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    heading = 0.7
    x_m, y_m, turned = after(driven(monkeypatch, HOLONOMIC, [0.0, 0.0, heading]), 4.0, 0.0, 0.0, 0.2)
    assert turned == pytest.approx(heading, abs=1e-6)
    left = np.array([-np.sin(heading), np.cos(heading)])
    np.testing.assert_allclose([x_m, y_m], 0.8 * left, atol=0.01)  # less what it takes to reach its speed


def test_a_holonomic_body_that_turns_circles_with_the_speed_that_it_keeps_in_its_frame(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    world = driven(monkeypatch, HOLONOMIC, [0.0, 0.0, 0.0])
    speeds: list[float] = []
    for _ in range(40):
        after(world, 0.1, 0.1, 1.5, 0.1)
        speeds.append(float(np.hypot(*world.velocity[0, :2])))
    np.testing.assert_allclose(speeds[10:], np.hypot(0.1, 0.1), rtol=0.02)
    assert world.velocity[0, 2] == pytest.approx(1.5, rel=1e-3)


def test_a_twist_drive_turns_and_drives_at_both_limits_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    world = driven(monkeypatch, TWIST, [0.0, 0.0, 0.0])
    after(world, 2.0, 9.0, 9.0)
    assert world.command.tolist() == [[0.1, 2.0, 0.0]]
    assert np.hypot(*world.velocity[0, :2]) == pytest.approx(0.1, rel=0.02)
    assert world.velocity[0, 2] == pytest.approx(2.0, rel=1e-3)
    assert world.counts()["clipped_commands"].tolist() == [20]


def test_a_body_with_wheels_that_is_asked_to_go_sideways_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    world = driven(monkeypatch, TWIST, [0.0, 0.0, 0.0])
    pose = after(world, 1.0, 0.0, 0.0, 0.3)
    np.testing.assert_allclose(pose, 0.0, atol=1e-9)
    assert world.counts()["clipped_commands"].tolist() == [10]


def test_noise_of_the_wheels_bends_the_way_and_repeats(monkeypatch: pytest.MonkeyPatch) -> None:
    wheels = {"wheel_base_m": 0.053, "max_wheel_mps": 0.1287, **FORCES, "noise": {"factor_std": 0.2}}
    one, again = (after(driven(monkeypatch, wheels, [0.0, 0.0, 0.0]), 2.0, 0.1, 0.0) for _ in range(2))
    assert one.tolist() == again.tolist()
    assert abs(one[2]) > 1e-3
    straight = after(driven(monkeypatch, {**wheels, "noise": {}}, [0.0, 0.0, 0.0]), 2.0, 0.1, 0.0)
    assert straight[2] == pytest.approx(0.0, abs=1e-9)
