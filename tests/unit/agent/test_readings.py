"""Both kinds of agent read the same of every sense, custom sensors too, and set custom actuators alike."""

from collections.abc import Callable
from dataclasses import astuple, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.agent.agent_group import agent_group
from swarmwire.agent.testing import Trial, assert_equivalent, assert_rows_independent
from swarmwire.comms.base.errors import AgentFailed
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.comms.robot.bodies.custom import CustomActuatorSpec, CustomSensorSpec
from swarmwire.comms.robot.packets import ReceivedPackets
from swarmwire.comms.robot.sensors.camera import Blob
from swarmwire.comms.robot.sensors.imu import ImuSpec
from swarmwire.comms.robot.sensors.rays import RadialReading, RadialSpec
from swarmwire.comms.robot.sensors.simple import BatterySpec
from tests.support.agent.hosts import MEASURES, group, readings
from tests.support.agent.one_step import agent_doing, vector_agent_doing


def assert_alike(step: Callable[[Any], None], vector_step: Callable[[Any], None], trial: Trial, *needs: str) -> None:
    """Require that a step of one robot equals a step of n robots, whose rows are independent."""
    vector_agent = vector_agent_doing(vector_step, *needs)
    assert_equivalent(agent_doing(step, *needs), vector_agent, trial)
    assert_rows_independent(vector_agent, trial)


def test_light_bumper_and_position_are_equal_for_one_robot_and_many() -> None:
    """To the light, away from what it bumped into, and home."""

    def step(robot) -> None:
        x, y = robot.light.vector_sum()
        assert type(x) is type(robot.positioning.x_m) is float
        assert type(robot.bumper.pressed) is bool
        assert robot.light.value.shape == robot.light.angle_rad.shape == (8,)
        back = -0.05 if robot.bumper.pressed else 0.01 * x
        robot.drive(back, 0.1 * y + 0.01 * (robot.positioning.x_m - robot.positioning.y_m))

    def vector_step(robots) -> None:
        x, y = robots.light.vector_sum()
        assert robots.light.value.shape == (robots.n, 8)
        assert robots.light.angle_rad.shape == (8,)
        back = np.where(robots.bumper.pressed == 1.0, -0.05, 0.01 * x)
        robots.drive(back, 0.1 * y + 0.01 * (robots.positioning.x_m - robots.positioning.y_m))

    assert_alike(step, vector_step, Trial(body="epuck-gps"), "light", "bumper", "positioning")


def test_camera_and_ground_are_equal_for_one_robot_and_many() -> None:
    """To the nearest blob, slower on dark ground."""

    def step(robot) -> None:
        blobs = robot.camera.blobs
        assert robot.ground.shade.shape == (4,)
        if blobs:
            assert isinstance(blobs[0], Blob)
            assert [type(value) for value in astuple(blobs[0])] == [float, float, int]
            robot.drive(0.1 * blobs[0].distance_m * robot.ground.shade[0], blobs[0].bearing_rad + 1e-9 * len(blobs))
            robot.led(*((blobs[-1].colour >> shift & 255) / 255 for shift in (16, 8, 0)))

    def vector_step(robots) -> None:
        camera, count = robots.camera, robots.camera.count
        last = np.where(count > 0, camera.colour[np.arange(robots.n), count - 1], 0.0).astype(np.int64)
        speed = 0.1 * camera.distance_m[:, 0] * robots.ground.shade[:, 0]
        robots.drive(speed, camera.bearing_rad[:, 0] + 1e-9 * count, rows=count > 0)
        robots.led(*((last >> shift & 255) / 255 for shift in (16, 8, 0)), rows=count > 0)

    assert_alike(step, vector_step, Trial(body="footbot"), "camera", "ground")


def test_infrared_is_equal_for_one_robot_and_many() -> None:
    """Away from walls, which are what proximity sees and passive infrared does not."""

    def step(robot) -> None:
        wall = robot.proximity.value * (robot.infrared.value == 0.0)
        assert wall.shape == robot.infrared.angle_rad.shape == (12,)
        robot.drive(robot.infrared.distance_m[1], float(wall.max()))

    def vector_step(robots) -> None:
        wall = robots.proximity.value * (robots.infrared.value == 0.0)
        robots.drive(robots.infrared.distance_m[:, 1], wall.max(axis=1))

    assert_alike(step, vector_step, Trial(body="flockbot"), "proximity", "infrared")


def test_scan_is_equal_for_one_robot_and_many() -> None:
    """Away from the nearest return of the laser."""

    def step(robot) -> None:
        robot.drive(0.1, -float(robot.scan.angle_rad[int(robot.scan.range_m.argmin())]))

    def vector_step(robots) -> None:
        assert robots.scan.range_m.shape == (robots.n, 360)
        robots.drive(0.1, -robots.scan.angle_rad[robots.scan.range_m.argmin(axis=1)])

    assert_alike(step, vector_step, Trial(body="turtlebot3-burger"), "scan")


EPUCK = load_body("epuck")
BODY = replace(
    EPUCK,
    sensors={
        **EPUCK.sensors,
        "gas": CustomSensorSpec(kind="a:B", params={}, fields={"level": 0, "cells": 3}),
        "imu": ImuSpec(),
        "battery": BatterySpec(capacity_wh=1.0),
    },
    actuators={"horn": CustomActuatorSpec("a:C", {}, 1), "arm": CustomActuatorSpec("a:D", {}, 3)},
)
TRIAL = Trial(body=BODY)


def test_custom_parts_imu_and_battery_are_equal_for_one_robot_and_many() -> None:
    def step(robot) -> None:
        gas, imu = robot.sensor("gas"), robot.imu
        assert type(gas.level) is type(imu.turn_radps) is type(robot.battery.charge) is float
        assert gas.cells.shape == (3,)
        robot.drive(0.01 * gas.level * robot.battery.voltage_v, imu.forward_mps2 + imu.left_mps2 + imu.turn_radps)
        if gas.level > 0.5:
            robot.actuate("horn", gas.level)
        robot.actuate("arm", gas.cells * robot.battery.charge)

    def vector_step(robots) -> None:
        gas, imu = robots.sensor("gas"), robots.imu
        assert gas.cells.shape == (robots.n, 3)
        turn = imu.forward_mps2 + imu.left_mps2 + imu.turn_radps
        robots.drive(0.01 * gas.level * robots.battery.voltage_v, turn)
        robots.actuate("horn", gas.level, rows=gas.level > 0.5)
        robots.actuate("arm", gas.cells * robots.battery.charge[:, None])

    assert_alike(step, vector_step, TRIAL, "gas", "imu", "battery")


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda robots: robots.sensor("gas").colour, "the sensor gas has the fields level, cells, not colour"),
        (lambda robots: robots.sensor("compass"), "NotDeclared"),
        (lambda robots: robots.actuate("leg", 1.0), "IncompatibleBody.* no custom actuator 'leg': it has horn, arm"),
        (lambda robots: robots.actuate("arm", [1.0, 2.0]), "expected 3 numbers, got the shape"),
        (lambda robots: robots.actuate("horn", np.zeros((2, 2))), "expected 1 numbers, got the shape"),
        (lambda robots: robots.actuate("horn", np.nan), "expected finite numbers, got nan"),
        *(
            (lambda robots, values=values: robots.actuate("arm", values, rows=np.arange(robots.n) > 0), message)
            for values, message in (
                ([1.0, 2.0], r"expected 3 numbers, got the shape \(2,\)"),
                (np.zeros((2, 3)), r"expected 3 numbers, got the shape \(2, 3\)"),
                (np.zeros((2, 2, 3)), r"expected 3 numbers, got the shape \(2, 2, 3\)"),
                ([1.0, 2.0, np.inf], "expected finite numbers"),
            )
        ),
        (
            lambda robots: robots.actuate("horn", np.zeros(robots.n + 1), rows=np.arange(robots.n) > 0),
            "expected 1 numb",
        ),
    ],
)
def test_actions_of_a_wrong_form_are_refused(call, message: str) -> None:
    with pytest.raises(AgentFailed, match=message):
        assert_rows_independent(vector_agent_doing(call, "gas"), TRIAL)


def test_setting_of_one_number_or_a_vector_applies_to_all_robots() -> None:
    def each(handle) -> None:
        handle.actuate("horn", 0.5)
        handle.actuate("arm", (1.0, 2.0, 3.0))

    def in_rows(robots) -> None:
        robots.actuate("horn", np.full(robots.n, 0.5))
        robots.actuate("arm", np.tile([1.0, 2.0, 3.0], (robots.n, 1)))

    for deed in (each, in_rows):
        assert_equivalent(agent_doing(each), vector_agent_doing(deed), TRIAL)


def test_mask_accepts_full_vectors_and_checks_only_its_rows() -> None:
    def acted(values) -> list[tuple[int, int, float]]:
        rows, masked = [2, 3, 5], lambda robots: robots.actuate("arm", values, rows=np.arange(robots.n) != 1)
        agents = agent_group(replace(group("", rows), body=BODY), vector_agent_doing(masked))
        actuated = agents.act((0, 0, 100_000_000), readings(0, rows), ReceivedPackets.none(MEASURES)).actuators
        return list(zip(actuated.rows.tolist(), actuated.slot.tolist(), actuated.value.tolist(), strict=True))

    arm = [1.0, 2.0, 3.0]
    each = [(row, 1 + k, arm[k]) for row in (2, 5) for k in range(3)]
    assert acted(arm) == each  # three numbers, and three robots: never a number for each robot
    assert acted(np.array([arm, [np.nan] * 3, arm])) == each
    assert acted(1.0) == [(row, 1 + k, 1.0) for row in (2, 5) for k in range(3)]


RAYS = st.tuples(st.sampled_from((0.0, 1e-300, 0.1)) | st.floats(0.0, 1.0), st.floats(-360.0, 360.0))


@given(st.lists(RAYS, min_size=1, max_size=20))
def test_vector_sum_of_one_robot_equals_that_of_many_bit_for_bit(rays: list[tuple[float, float]]) -> None:
    values, angles_deg = zip(*rays, strict=True)
    spec, value = RadialSpec(angles_deg=angles_deg), np.array(values)
    single = RadialReading(value, spec).vector_sum()
    many = RadialReading(np.array([value, value[::-1]]), spec).vector_sum()
    assert [number.hex() for number in single] == [float(numbers[0]).hex() for numbers in many]
