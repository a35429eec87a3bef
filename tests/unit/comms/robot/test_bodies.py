"""Bodies of robots: sheets, custom bodies, and drives."""

from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.robot.bodies.body import (
    Body,
    IncompatibleBody,
    body_from,
    body_from_mapping,
    body_names,
    load_body,
    merged,
)
from swarmwire.comms.robot.bodies.drives import Holonomic, Twist, WheelNoise, Wheels, twist_of_wheels, wheels_of_twist
from swarmwire.comms.robot.sensors.rays import ProximitySpec
from swarmwire.comms.robot.sensors.simple import PositioningSpec
from tests.support.refusals import refused_input

WITH_PROXIMITY = [name for name in body_names() if load_body(name).proximity]
WHEELLESS = {"kind": "holonomic", "max_speed_mps": 1, "max_angular_radps": 1, "max_force_n": 1, "max_torque_nm": 1}
FORCES = {"max_force_n": 1.0, "max_torque_nm": 2.0}
WHEELS = {"wheel_base_m": 0.1, "max_wheel_mps": 0.2, **FORCES}
TWIST = {"kind": "twist", "wheel_base_m": 0.16, "max_linear_mps": 0.22, "max_angular_radps": 2.84, **FORCES}
HOLONOMIC = {"kind": "holonomic", "max_speed_mps": 0.5, "max_angular_radps": 3.0, **FORCES}


def proximity_of(name: str) -> ProximitySpec:
    spec = load_body(name).proximity
    assert spec is not None
    return spec


@pytest.mark.parametrize("name", body_names())
def test_shipped_body_loads_under_its_name_and_survives_its_mapping(name: str) -> None:
    body = load_body(name)
    assert body.name == name
    assert body_from(body.as_mapping(), "copy.toml") == body


def test_body_like_another_is_named_by_its_sheet_or_file() -> None:
    assert body_from({"like": "epuck"}, "bodies/worn.toml").name == "worn"
    assert body_from({"like": "epuck", "name": "old"}, "bodies/worn.toml").name == "old"
    with refused_input(key="body", match="expected one of crazyflie, epuck, .*; got 'roomba'"):
        load_body("roomba")


@pytest.mark.parametrize("distance_m", [0.01, 0.02, 0.05])
def test_epuck2_proximity_matches_its_driver(distance_m: float) -> None:
    # epuck_driver_cpp: the distance in m is 0.5 / sqrt(value), of 4095.
    value = proximity_of("epuck2").response.value(np.float64(distance_m))
    assert 0.5 / np.sqrt(4095.0 * value) == pytest.approx(distance_m, rel=1e-3)


def test_flockbot_sees_five_diameters_with_three_rays_per_sector() -> None:
    # Sectors of minimalist flocking: front (-45, 45], left (45, 135], rear (135, 225], right (225, 315].
    body, spec = load_body("flockbot"), proximity_of("flockbot")
    infrared = body.infrared
    assert infrared is not None
    assert spec.range_m == infrared.range_m == pytest.approx(5.0 * 2.0 * body.radius_m)
    for each in (spec, infrared):
        sector = np.floor((np.rad2deg(each.angle_rad) + 45.0 - 1e-9) / 90.0) % 4
        assert np.bincount(sector.astype(int)).tolist() == [3, 3, 3, 3]


def test_proximity_is_full_at_the_rim_of_a_footbot_and_zero_beyond_its_reach() -> None:
    assert not proximity_of("epuck").response.value(np.linspace(0.048, 0.2, 100)).any()
    response = proximity_of("footbot").response
    assert response.value(np.array([0.0, 0.009, 0.1001, 1.0])).tolist() == [1.0, 1.0, 0.0, 0.0]


@pytest.mark.parametrize("name", WITH_PROXIMITY)
@given(st.floats(0.0, 0.2))
def test_proximity_response_inverts_to_its_distance(name: str, distance_m: float) -> None:
    response = proximity_of(name).response
    value = response.value(np.array([distance_m]))
    if 1e-9 < value[0] < 1.0:
        assert response.distance_m(value)[0] == pytest.approx(distance_m, abs=1e-9)
    elif value[0] == 0.0:
        assert response.distance_m(value)[0] == response.reach_m


@pytest.mark.parametrize("name", WITH_PROXIMITY)
def test_proximity_response_falls_with_distance(name: str) -> None:
    response = proximity_of(name).response
    distance_m = response.distance_m(np.linspace(0.0, 1.0, 1001))
    assert np.all(np.diff(distance_m) <= 0.0)
    assert 0.0 <= distance_m.min() <= distance_m.max() == response.reach_m


@pytest.mark.parametrize("name", WITH_PROXIMITY)
def test_proximity_rays_are_mirrored_within_half_a_turn(name: str) -> None:
    angle = proximity_of(name).angle_rad
    assert np.all((angle > -np.pi) & (angle <= np.pi))
    ahead, left = np.round(np.cos(angle), 9), np.round(np.sin(angle), 9)
    assert set(zip(ahead, left, strict=True)) == set(zip(ahead, -left, strict=True))


def test_body_without_sensors_has_no_sensor_sheets() -> None:
    body = body_from({**sheet_of("epuck"), "sensors": {}}, "blind.toml")
    assert (body.proximity, body.compass, body.odometry) == (None, None, None)


def sheet_of(name: str) -> dict[str, Any]:
    return load_body(name).as_mapping()


def changed(path: str, value: object) -> dict[str, Any]:
    """The e-puck's sheet with one value put in place, or taken away where it is None."""
    spec = sheet_of("epuck")
    *tables, key = path.split(".")
    table = spec
    for name in tables:
        table = table[name]
    table[key] = value
    if value is None:
        del table[key]
    return spec


BAD_VALUES: list[tuple[str, object]] = [  # of a key, which the line names
    *((path, None) for path in ("radius_m", "name", "drive", "drive.wheel_base_m")),
    *(("like", value) for value in ("roomba", 3)),
    *(("radius_m", value) for value in ("big", True, 0.0, float("nan"), float("inf"))),
    *(("name", 3), ("colour", "red"), ("mass_kg", 10**400)),
    *(("drive", []), ("drive.gears", 3), ("drive.wheel_base_m", 0.0701)),
    *(("sensors", 3), ("sensors.lidar", {}), ("sensors.odometry.slip", 2)),
    *(("sensors.light.noise", 2), ("sensors.bumper.noise", 1), ("sensors.camera.max_blobs", 1001)),
    *(("sensors.compass", True), ("sensors.compass.delay_s", 1e308), ("sensors.compass.noise_rad", -1)),
    ("sensors.proximity.response.kind", "cubic"),
    *(("sensors.proximity.angles_deg", value) for value in (17, [], [1] * 1001)),
    ("sensors.ground.points_m", [[0, 0]] * 1001),
    *(("leds.angles_deg", [1] * 1001), ("leds.radius_m", 0.044), ("leds.height_m", 0.173)),
    ("leds.beacon_height_m", 1),
]


@pytest.mark.parametrize(
    ("path", "value", "key"),
    [
        *((path, value, path) for path, value in BAD_VALUES),
        *(("drive.noise", {key: value}, f"drive.noise.{key}") for key, value in (("factor", 1000.0), ("bias_mps", -1))),
        ("drive", WHEELLESS, "sensors.odometry"),
        ("altitude_m", 0.5, "sensors.ground"),
        ("sensors.positioning", {"noise_m": -1}, "sensors.positioning.noise_m"),
        ("sensors.proximity.response.b", 36.8961, "sensors.proximity.response"),
        ("sensors.proximity.angles_deg", [1, "x"], "sensors.proximity.angles_deg[1]"),
        ("sensors.scan", {"rays": 10_001, "range_m": 1}, "sensors.scan.rays"),
    ],
)
def test_bad_sheet_is_refused_with_file_and_key(path: str, value: object, key: str) -> None:
    with refused_input("mine.toml", key):
        body_from(changed(path, value), "mine.toml")


def test_integers_serve_as_floats() -> None:
    mass_kg = body_from(changed("mass_kg", 2), "mine.toml").mass_kg
    assert (mass_kg, type(mass_kg)) == (2.0, float)


def test_body_like_another_differs_only_in_its_own_keys() -> None:
    gps, epuck = load_body("epuck-gps"), load_body("epuck")
    assert {**gps.as_mapping(), "name": "epuck", "source": epuck.source, "sensors": None} == {
        **epuck.as_mapping(),
        "sensors": None,
    }
    assert gps.sensors == {**epuck.sensors, "positioning": PositioningSpec(0.01)}
    derived = body_from({"like": "epuck-gps", "name": "mine", "drive": {"wheel_base_m": 0.06}}, "mine.toml")
    assert (derived.wheels.wheel_base_m, derived.drive.max_force_n) == (0.06, epuck.drive.max_force_n)
    assert (derived.name, derived.sensors) == ("mine", gps.sensors)


def test_positioning_is_only_on_bodies_that_declare_it() -> None:
    assert [name for name in body_names() if "positioning" in load_body(name).sensors] == ["epuck-gps", "point"]


def test_photocells_match_argos() -> None:
    epuck, footbot = load_body("epuck").light, load_body("footbot").light
    assert epuck
    assert footbot
    assert epuck.angles_deg == tuple(22.5 + 45.0 * k for k in range(8))
    assert footbot.angles_deg == proximity_of("footbot").angles_deg
    assert (epuck.noise, footbot.noise) == (0.05, 0.0)


def test_body_like_another_drops_impossible_sensors() -> None:
    spec = {"like": "epuck", "name": "drone", "altitude_m": 1.0, "drive": WHEELLESS}
    drone = body_from(spec, "drone.toml")
    assert set(load_body("epuck").sensors) - set(drone.sensors) == {"odometry", "ground"}
    with refused_input("drone.toml", "sensors.ground"):
        body_from({**spec, "sensors": {"ground": {"noise": 0.1}}}, "drone.toml")


def test_actuator_numbers_follow_one_another_up_to_a_limit() -> None:
    def body_with(**widths: int) -> Body:
        parts = {name: {"kind": "a:B", "params": {}, "width": width} for name, width in widths.items()}
        return body_from_mapping({**sheet_of("epuck"), "actuators": parts}, "told")

    slices = body_with(arm=3, bell=0, hand=2, eye=1).actuator_slices
    assert slices == {"arm": slice(0, 3), "bell": slice(3, 3), "hand": slice(3, 5), "eye": slice(5, 6)}
    with refused_input("told", "actuators.arm.width"):
        body_with(arm=10_001)


def test_merged_tables_keep_unique_keys_and_prefer_the_second():
    base = {"name": "a", "sensors": {"compass": {"noise_rad": 0.1}, "light": {"noise": 0.2}}, "radius_m": 1.0}
    over = {"sensors": {"compass": {"delay_s": 1.0}}, "radius_m": {"new": 2}}
    sensors = {"compass": {"noise_rad": 0.1, "delay_s": 1.0}, "light": {"noise": 0.2}}
    assert merged(base, over) == {"name": "a", "sensors": sensors, "radius_m": {"new": 2}}
    assert base["sensors"] == {"compass": {"noise_rad": 0.1}, "light": {"noise": 0.2}}


def driven(drive: object, **keys: Any) -> Body:
    spec = {"name": "mine", "source": "nowhere", "radius_m": 0.1, "height_m": 0.1, "mass_kg": 1.0}
    return body_from({**spec, "drive": drive, **keys}, "mine.toml")


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
def test_drive_is_chosen_by_kind(table: object, drive: object, linear_mps: float, angular_radps: float) -> None:
    body = driven(table)
    assert body.drive == drive
    assert (body.max_linear_mps, body.max_angular_radps) == (linear_mps, pytest.approx(angular_radps))


@pytest.mark.parametrize("table", [WHEELS, TWIST, HOLONOMIC, {**WHEELS, "noise": {"factor_std": 0.05}}], ids=repr)
def test_body_crosses_the_wire_with_drive_and_leds(table: object) -> None:
    leds = {"angles_deg": [0, 90], "height_m": 0.05}
    for body in (driven(table), driven(table, leds=leds, altitude_m=1.5, contacts=False)):
        assert body_from(msgpack.unpackb(msgpack.packb(body.as_mapping())), "copy") == body


def test_wheel_noise_is_a_table_with_neutral_defaults() -> None:
    noise = {"bias_mps": 0.001, "bias_std_mps": 0.002, "factor": 0.9, "factor_std": 0.05}
    assert driven({**TWIST, "noise": noise}).wheels.noise == WheelNoise(0.001, 0.002, 0.9, 0.05)
    assert driven(WHEELS).wheels.noise == WheelNoise(0.0, 0.0, 1.0, 0.0)


@pytest.mark.parametrize(
    ("keys", "key"),
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
def test_impossible_body_is_refused_with_file_and_key(keys: dict[str, Any], key: str) -> None:
    with refused_input("mine.toml", key):
        driven(**{"drive": WHEELS, **keys})


def test_body_like_another_with_another_drive_inherits_no_drive_values() -> None:
    for like in ("epuck", "epuck-gps"):
        derived = body_from({"like": like, "name": "mine", "drive": HOLONOMIC}, "mine.toml")
        assert derived.drive == driven(HOLONOMIC).drive
        assert derived.radius_m == load_body("epuck").radius_m
        same = body_from({"like": like, "drive": {"kind": "wheels", "max_wheel_mps": 0.1}}, "mine.toml")
        assert same.wheels.wheel_base_m == load_body("epuck").wheels.wheel_base_m


def test_wheels_of_a_body_without_wheels_are_refused() -> None:
    assert driven(TWIST).wheels.wheel_base_m == 0.16
    with pytest.raises(IncompatibleBody, match="the body mine has no wheels: its drive is holonomic"):
        _ = driven(HOLONOMIC).wheels


def test_leds_sit_on_their_ring_and_the_beacon_on_the_axis() -> None:
    body = driven(WHEELS, leds={"angles_deg": [0, 90], "height_m": 0.05, "beacon_height_m": 0.2})
    assert body.led_count == 3
    np.testing.assert_allclose(body.led_positions_m, [[0.1, 0, 0.05], [0, 0.1, 0.05], [0, 0, 0.2]], atol=1e-12)
    wide = driven(WHEELS, leds={"angles_deg": [180], "height_m": 0.05, "radius_m": 0.12})
    np.testing.assert_allclose(wide.led_positions_m, [[-0.12, 0, 0.05]], atol=1e-12)
    assert driven(WHEELS).led_positions_m.shape == (0, 3)


def test_leds_of_shipped_bodies_match_argos() -> None:
    epuck, footbot = load_body("epuck"), load_body("footbot")
    assert (epuck.led_count, footbot.led_count) == (8, 13)
    assert footbot.led_positions_m[-1].tolist() == [0.0, 0.0, 0.174249733]
    ring_m = np.hypot(*footbot.led_positions_m[:-1, :2].T)
    np.testing.assert_allclose(ring_m, footbot.radius_m + 0.005)


@given(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.floats(0.01, 1.0))
def test_twist_survives_conversion_to_wheel_speeds(linear: float, angular: float, base_m: float) -> None:
    left, right = wheels_of_twist(linear, angular, base_m)
    assert twist_of_wheels(left, right, base_m) == pytest.approx((linear, angular), abs=1e-12)
    assert (right > left) == (angular > 0.0) or abs(base_m * angular) < 1e-12
    assert wheels_of_twist(0.0, 2.0, 0.1) == (-0.1, 0.1)
