"""Drives: the table `[drive]` chooses one by kind, and what does not fit is refused with its place."""

from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.bodies.body import Body, IncompatibleBody, body_from, load_body
from swarmwire.comms.bodies.drives import Holonomic, Twist, WheelNoise, Wheels, twist_of_wheels, wheels_of_twist
from swarmwire.comms.errors import BadInput

FORCES = {"max_force_n": 1.0, "max_torque_nm": 2.0}
WHEELS = {"wheel_base_m": 0.1, "max_wheel_mps": 0.2, **FORCES}
TWIST = {"kind": "twist", "wheel_base_m": 0.16, "max_linear_mps": 0.22, "max_angular_radps": 2.84, **FORCES}
HOLONOMIC = {"kind": "holonomic", "max_speed_mps": 0.5, "max_angular_radps": 3.0, **FORCES}


def driven(drive: object, **given: Any) -> Body:
    spec = {"name": "mine", "source": "nowhere", "radius_m": 0.1, "height_m": 0.1, "mass_kg": 1.0}
    return body_from({**spec, "drive": drive, **given}, "mine.toml")


@pytest.mark.parametrize(
    ("table", "drive", "linear_mps", "angular_radps"),
    [
        (WHEELS, Wheels(0.1, 0.2, 1.0, 2.0), 0.2, 4.0),
        ({**WHEELS, "kind": "wheels"}, Wheels(0.1, 0.2, 1.0, 2.0), 0.2, 4.0),
        (TWIST, Twist(0.16, 0.22, 2.84, 1.0, 2.0), 0.22, 2.84),
        (HOLONOMIC, Holonomic(0.5, 3.0, 1.0, 2.0), 0.5, 3.0),
    ],
    ids=["left out", "wheels", "twist", "holonomic"],
)
def test_the_table_chooses_a_drive_by_kind(
    table: object, drive: object, linear_mps: float, angular_radps: float
) -> None:
    body = driven(table)
    assert body.drive == drive
    assert (body.max_linear_mps, body.max_angular_radps) == (linear_mps, pytest.approx(angular_radps))


@pytest.mark.parametrize("table", [WHEELS, TWIST, HOLONOMIC, {**WHEELS, "noise": {"factor_std": 0.05}}], ids=repr)
def test_a_body_crosses_the_wire_with_its_drive_and_leds(table: object) -> None:
    leds = {"angles_deg": [0, 90], "height_m": 0.05}
    for body in (driven(table), driven(table, leds=leds, altitude_m=1.5, contacts=False)):
        assert body_from(msgpack.unpackb(msgpack.packb(body.as_mapping())), "copy") == body


def test_the_noise_of_wheels_is_a_table_of_its_own() -> None:
    noise = {"bias_mps": 0.001, "bias_std_mps": 0.002, "factor": 0.9, "factor_std": 0.05}
    assert driven({**TWIST, "noise": noise}).wheels.noise == WheelNoise(0.001, 0.002, 0.9, 0.05)
    assert driven(WHEELS).wheels.noise == WheelNoise(0.0, 0.0, 1.0, 0.0)


@pytest.mark.parametrize(
    ("given", "key"),
    [
        ({"drive": {**WHEELS, "wheel_base_m": 0}}, "drive.wheel_base_m"),
        ({"drive": {**TWIST, "wheel_base_m": -0.1}}, "drive.wheel_base_m"),
        ({"drive": FORCES}, "drive.wheel_base_m"),
        ({"drive": {**TWIST, "max_angular_radps": 0}}, "drive.max_angular_radps"),
        ({"drive": {**HOLONOMIC, "max_speed_mps": float("inf")}}, "drive.max_speed_mps"),
        ({"drive": {**HOLONOMIC, "wheel_base_m": 0.1}}, "drive.wheel_base_m"),
        ({"drive": {**HOLONOMIC, "noise": {}}}, "drive.noise"),
        ({"drive": {**WHEELS, "kind": "legs"}}, "drive.kind"),
        ({"drive": {**WHEELS, "kind": ["wheels"]}}, "drive.kind"),
        ({"drive": {**WHEELS, "noise": 0.1}}, "drive.noise"),
        ({"drive": {**WHEELS, "noise": {"factor_std": -1}}}, "drive.noise.factor_std"),
        ({"drive": {**WHEELS, "noise": {"bias": 1}}}, "drive.noise.bias"),
        ({"altitude_m": -1}, "altitude_m"),
        ({"contacts": 1}, "contacts"),
        ({"leds": {"angles_deg": [0]}}, "leds.height_m"),
        ({"leds": {"angles_deg": [], "height_m": 0.1}}, "leds.angles_deg"),
        ({"leds": {"angles_deg": [0], "height_m": -0.1}}, "leds.height_m"),
        ({"leds": 8}, "leds"),
    ],
)
def test_what_a_body_cannot_be_is_refused_with_file_and_key(given: dict[str, Any], key: str) -> None:
    with pytest.raises(BadInput) as refused:
        driven(**{"drive": WHEELS, **given})
    assert (refused.value.where, refused.value.key) == ("mine.toml", key)


def test_a_body_like_another_with_another_kind_of_drive_has_nothing_of_its_drive() -> None:
    for like in ("epuck", "epuck-gps"):
        mine = body_from({"like": like, "name": "mine", "drive": HOLONOMIC}, "mine.toml")
        assert mine.drive == driven(HOLONOMIC).drive
        assert mine.radius_m == load_body("epuck").radius_m
        same = body_from({"like": like, "drive": {"kind": "wheels", "max_wheel_mps": 0.1}}, "mine.toml")
        assert same.wheels.wheel_base_m == load_body("epuck").wheels.wheel_base_m


def test_only_a_body_with_wheels_tells_of_them() -> None:
    assert driven(TWIST).wheels.wheel_base_m == 0.16
    with pytest.raises(IncompatibleBody, match="the body mine has no wheels: its drive is holonomic"):
        _ = driven(HOLONOMIC).wheels


def test_leds_sit_on_their_ring_and_the_beacon_on_the_axis() -> None:
    body = driven(WHEELS, leds={"angles_deg": [0, 90], "height_m": 0.05, "beacon_height_m": 0.2})
    assert body.led_count == 3
    np.testing.assert_allclose(body.led_places_m, [[0.1, 0, 0.05], [0, 0.1, 0.05], [0, 0, 0.2]], atol=1e-12)
    wide = driven(WHEELS, leds={"angles_deg": [180], "height_m": 0.05, "radius_m": 0.12})
    np.testing.assert_allclose(wide.led_places_m, [[-0.12, 0, 0.05]], atol=1e-12)
    assert driven(WHEELS).led_places_m.shape == (0, 3)


def test_the_bodies_that_come_along_have_argos_s_leds() -> None:
    epuck, footbot = load_body("epuck"), load_body("footbot")
    assert (epuck.led_count, footbot.led_count) == (8, 13)
    assert footbot.led_places_m[-1].tolist() == [0.0, 0.0, 0.174249733]
    ring_m = np.hypot(*footbot.led_places_m[:-1, :2].T)
    np.testing.assert_allclose(ring_m, footbot.radius_m + 0.005)


@given(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.floats(0.01, 1.0))
def test_a_twist_becomes_wheel_speeds_and_back(linear: float, angular: float, base_m: float) -> None:
    left, right = wheels_of_twist(linear, angular, base_m)
    assert twist_of_wheels(left, right, base_m) == pytest.approx((linear, angular), abs=1e-12)
    assert (right > left) == (angular > 0.0) or abs(base_m * angular) < 1e-12


def test_a_turn_to_the_left_has_the_right_wheel_ahead() -> None:
    assert wheels_of_twist(0.0, 2.0, 0.1) == (-0.1, 0.1)
    assert twist_of_wheels(0.0, 0.2, 0.1) == (0.1, 2.0)
