"""All sensors."""

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.angles import wrap_angles
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.draws import normal, purpose, uniform
from swarmwire.comms.base.plugins import NotLoaded
from swarmwire.comms.observe.truth import Group, Light
from swarmwire.comms.robot.bodies.body import Body, body_from, load_body
from swarmwire.comms.robot.sensors import SENSOR_SPECS, Sensors
from swarmwire.comms.robot.sensors.camera import CameraSpec
from swarmwire.comms.robot.sensors.imu import ImuSpec
from swarmwire.comms.robot.sensors.light import LightSpec
from swarmwire.comms.robot.sensors.rays import InfraredSpec, ProximitySpec
from swarmwire.comms.robot.sensors.scan import ScanSpec
from swarmwire.comms.robot.sensors.sensor import RangedSensorSpec, SensorSpec
from swarmwire.comms.robot.sensors.simple import (
    BatterySpec,
    CompassSpec,
    FlowSpec,
    GroundSpec,
    OdometrySpec,
    PositioningSpec,
)
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.sensors.loading import sensor_of, truth_of
from swarmwire.world.sensors.rays import ProximitySensor
from swarmwire.world.sensors.sensor import BuiltInSensor, Scene
from swarmwire.world.world import World
from tests.support.refusals import refused_input
from tests.support.world.scenes import SENSORS, commanded, posed, read, scene, staged

EPUCK, FOOTBOT = load_body("epuck"), load_body("footbot")
# ARGoS's foot-bot, ideal rays, an infinite wall dead ahead: gap from wall to body in m, length of the mean vector.
ARGOS_WALL = [
    (0.09, 0.0091),
    (0.08, 0.0184),
    (0.06, 0.0310),
    (0.05, 0.0366),
    (0.04, 0.0446),
    (0.03, 0.0572),
    (0.02, 0.0861),
    (0.015, 0.1074),
    (0.01, 0.1448),
    (0.005, 0.1755),
]
assert FOOTBOT.proximity is not None
RING: dict[str, Any] = {"angles_deg": tuple(range(0, 360, 30)), "range_m": 0.1, "response": FOOTBOT.proximity.response}
STAGES: dict[str, Any] = {"rate_hz": 4.0, "delay_s": 0.15, "drop_out": 0.2}
OUTLIER: dict[str, Any] = {"outlier": 0.1, "step": 0.01}
SPECS = {
    name: replace(kind.example(), **STAGES, **(OUTLIER if issubclass(kind, RangedSensorSpec) else {}))
    for name, kind in SENSOR_SPECS.items()
}
CUSTOM = f"{Path(__file__).parents[3] / 'support' / 'custom_code.py'}:Alone"
NAMES = (*SPECS, "own")


def proximity(looked_at: Scene, body: Body, **spec: Any) -> ProximitySensor:
    assert body.proximity is not None
    group = Group("a", body, 0, len(looked_at.radius_m))
    sensor = sensor_of("proximity", replace(body.proximity, **spec), looked_at, group)
    assert isinstance(sensor, ProximitySensor)
    return sensor


def values(looked_at: Scene, body: Body) -> FloatArray:
    assert body.proximity is not None
    return read(looked_at, body, "proximity", replace(body.proximity, noise=0.0))["proximity.value"]


def mean_vector(gap_m: float, off_normal_rad: float = 0.0) -> complex:
    looked_at = scene([[5.0 - gap_m - FOOTBOT.radius_m, 0.0, off_normal_rad]], FOOTBOT)
    assert FOOTBOT.proximity is not None
    return complex(np.sum(values(looked_at, FOOTBOT)[0] * np.exp(1j * FOOTBOT.proximity.angle_rad)) / 24)


@pytest.mark.parametrize(("gap_m", "length"), ARGOS_WALL)
def test_wall_ahead_of_a_footbot_gives_the_mean_vector_of_argos(gap_m: float, length: float) -> None:
    assert abs(mean_vector(gap_m)) == pytest.approx(length, abs=6e-5)
    assert np.angle(mean_vector(gap_m)) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("gap_m", "off_deg", "seen_deg"), [(0.08, 15, -15.0), (0.08, 10, -7.7), (0.05, 10, -12.9), (0.02, 10, -9.1)]
)
def test_wall_at_an_angle_gives_the_direction_of_argos(gap_m: float, off_deg: float, seen_deg: float) -> None:
    assert np.rad2deg(np.angle(mean_vector(gap_m, np.deg2rad(off_deg)))) == pytest.approx(seen_deg, abs=0.06)


@pytest.mark.parametrize(
    ("body", "off_deg", "error", "answers"),
    [  # ray 0 looks straight at the wall; distances in m and values: of ARGoS, and of the quadratic curve
        (FOOTBOT, -7.5, 6e-5, {0.0999999: 0.1004, 0.05: 0.2004, 0.02: 0.4986, 0.0098: 1.0, 0.1000001: 0.0}),
        (EPUCK, -17.0, 1e-3, {0.005: 0.905, 0.01: 0.743, 0.02: 0.464, 0.03: 0.244, 0.04: 0.084, 0.049: 0.0}),
    ],
    ids=["footbot", "epuck"],
)
def test_proximity_to_a_wall_follows_the_curve_of_the_body(
    body: Body, off_deg: float, error: float, answers: dict[float, float]
) -> None:
    for distance_m, value in answers.items():
        reading = values(scene([[5.0 - body.radius_m - distance_m, 0.0, np.deg2rad(off_deg)]], body), body)[0, 0]
        assert reading == pytest.approx(value, abs=error)


@pytest.mark.parametrize("body", [EPUCK, FOOTBOT])
def test_proximity_kernel_equals_the_curve_of_the_sheet(body: Body) -> None:
    assert body.proximity is not None
    poses = np.random.default_rng(1).uniform(-1, 1, (100, 3)) * [0.6, 0.6, np.pi]
    looked_at = scene(poses, body, size_m=1.4)
    distance_m, value = proximity(looked_at, body).distance_m()[0], values(looked_at, body)
    detected = np.isfinite(distance_m)
    assert 100 < np.count_nonzero(detected) < detected.size
    assert np.array_equal(value[detected], body.proximity.response.value(distance_m[detected]))
    assert not value[~detected].any()


# Of each sensor: a spec with noise, its distribution, and its sizes by field, absolute and as a share of the value.
NOISE: dict[str, tuple[SensorSpec, Any, dict[str, tuple[float, float]]]] = {
    "proximity": (ProximitySpec(**RING, noise=0.05), uniform, {"value": (0.05, 0.0)}),
    "infrared": (InfraredSpec(**RING, noise=0.05), uniform, {"value": (0.05, 0.0)}),
    "light": (LightSpec(angles_deg=RING["angles_deg"], noise=0.05), uniform, {"value": (0.05, 0.0)}),
    "ground": (GroundSpec(points_m=((0.03, 0.0), (0.0, 0.03)), noise=0.3), uniform, {"shade": (0.3, 0.0)}),
    "compass": (CompassSpec(0.1), normal, {"heading_rad": (0.1, 0.0)}),
    "positioning": (PositioningSpec(0.1), normal, {"x_m": (0.1, 0.0), "y_m": (0.1, 0.0)}),
    "flow": (FlowSpec(noise_mps=0.1), normal, {"forward_mps": (0.1, 0.0), "left_mps": (0.1, 0.0)}),
    "battery": (
        BatterySpec(capacity_wh=1.0, noise=0.2, noise_v=0.1),
        normal,
        {"charge": (0.2, 0.0), "voltage_v": (0.1, 0.0)},
    ),
    "imu": (
        ImuSpec(noise_mps2=0.1, noise_radps=0.2),
        normal,
        {"forward_mps2": (0.1, 0.0), "left_mps2": (0.1, 0.0), "turn_radps": (0.2, 0.0)},
    ),
    "scan": (ScanSpec(rays=8, range_m=3.5, noise_m=0.01, noise_relative=0.02), normal, {"range_m": (0.01, 0.02)}),
    "camera": (CameraSpec(height_m=0.2887, aperture_deg=70.0, noise_relative=0.1), normal, {"distance_m": (0.0, 0.1)}),
}


@pytest.mark.parametrize("name", NOISE)
def test_noise_of_a_sensor_is_keyed_and_clipped_to_its_range(name: str) -> None:
    spec, distribution, sizes = NOISE[name]
    exact_spec = replace(spec, **dict.fromkeys((key for key in asdict(spec) if key.startswith("noise")), 0.0))
    poses = np.random.default_rng(1).uniform(-1, 1, (20, 3)) * [0.3, 0.3, np.pi]
    looked_at = scene(poses, FOOTBOT, size_m=4.0, lights=(Light(1.0, 0.0, 2.0),), colour=0x00FF00)
    exact, noisy, later = (read(looked_at, FOOTBOT, name, *case) for case in ((exact_spec, 4), (spec, 4), (spec, 5)))
    for field, (size, relative) in sizes.items():
        column = f"{name}.{field}"
        width = exact[column].shape[1:]
        robots, slots = (np.arange(20)[:, None], np.arange(*width)) if width else (np.arange(20), 0)
        draws = distribution(7, robots, 4, slots, purpose(f"{column} noise"))
        error = 2.0 * draws - 1.0 if distribution is uniform else draws
        expected = exact[column] + (size + relative * exact[column]) * error
        if distribution is uniform or field in ("charge", "range_m"):
            expected = np.clip(expected, 0.0, 3.5 if name == "scan" else 1.0)
        expected = wrap_angles(expected) if name == "compass" else expected
        np.testing.assert_allclose(noisy[column], expected, rtol=1e-12, atol=1e-12)
        assert np.isfinite(exact[column]).any()
        assert not np.array_equal(noisy[column], later[column], equal_nan=True)


@given(turns=st.integers(-5, 5), heading=st.floats(-3.14, 3.14))
def test_compass_ignores_full_turns(turns: int, heading: float) -> None:
    looked_at = scene([[0.0, 0.0, heading + turns * 2 * np.pi]], EPUCK)
    heading_read = read(looked_at, EPUCK, "compass", CompassSpec(0.0))["compass.heading_rad"]
    assert heading_read[0] == pytest.approx(heading, abs=1e-12)


@pytest.mark.parametrize("steps", [2, 5, 20])
def test_wheels_roll_the_distance_that_the_robot_drives(steps: int) -> None:
    world = World(posed([[0.0, 0.0, 0.3], [0.5, 0.5, 1.0], [-1.0, 0.0, 0.0]], physics={"steps": steps}), [1], {})
    for _ in range(20):
        world.move(commanded(world, [0.05, 0.0, 0.06], [0.0, 1.5, -0.5]))
    rolled = world._physics.travel_m[0]
    left, right = rolled[:, 0], rolled[:, 1]
    assert left[0] == pytest.approx(right[0])
    assert left[0] == pytest.approx(np.hypot(*world.pose[0, :2]))
    turned = (right - left) / EPUCK.wheels.wheel_base_m
    assert np.angle(np.exp(1j * (world.pose[:, 2] - [0.3, 1.0, 0.0] - turned))) == pytest.approx(np.zeros(3), abs=1e-9)
    # The last arc: chord = 2 (v/w) sin(turn / 2), where only the path while speeding up is not on it.
    arc_m, turn = 0.5 * (left + right)[2], turned[2]
    assert np.hypot(*(world.pose[2, :2] - [-1.0, 0.0])) == pytest.approx(arc_m * np.sinc(turn / (2 * np.pi)), rel=1e-3)


def test_wheels_do_not_roll_against_a_wall() -> None:
    world = World(posed([[1.9, 0.0, 0.0]]), [1], {})
    for _ in range(30):
        world.move(commanded(world, 0.1, 0.0))
    assert world._physics.travel_m[0, 0] == pytest.approx([0.1 - EPUCK.radius_m] * 2, abs=2e-3)


def test_encoders_slip_in_each_tick_and_read_whole_steps() -> None:
    looked_at = scene(np.zeros((2, 3)), EPUCK)
    slipping = staged(looked_at, EPUCK, "odometry", OdometrySpec(slip=0.05, step_m=0.0))
    stepped = staged(looked_at, EPUCK, "odometry", OdometrySpec(slip=0.05, step_m=0.001))
    expected = np.zeros((2, 2))
    for tick in range(1, 20):
        looked_at.travel_m[0] += [[0.01, 0.02], [-0.01, 0.0]]
        factor = 1 + 0.05 * normal(7, np.arange(2)[:, None], tick, np.arange(2), purpose("odometry slip"))
        expected += [[0.01, 0.02], [-0.01, 0.0]] * factor
        shown, exact = stepped.read(tick), slipping.read(tick)
        for wheel, field in enumerate(("odometry.left_m", "odometry.right_m")):
            assert np.allclose(exact[field], expected[:, wheel], atol=1e-12)
            assert np.array_equal(shown[field], np.floor(exact[field] / 0.001) * 0.001)
    assert np.array_equal(slipping.read(20)["odometry.left_m"], slipping.read(20)["odometry.left_m"])


def test_bodies_have_the_sensors_of_their_sheets() -> None:
    assert EPUCK.sensors.keys() == FOOTBOT.sensors.keys() == {*SENSORS, "ground", "camera"}
    assert isinstance(EPUCK.proximity, ProximitySpec)


def test_odometry_wheel_error_is_drawn_once_per_wheel() -> None:
    """The error grows with the distance; travel back and forth undoes it."""
    looked_at = scene(np.zeros((400, 3)), EPUCK)
    odometry = staged(looked_at, EPUCK, "odometry", OdometrySpec(wheel_error_std=0.02))
    looked_at.travel_m[0] = 2.0
    distances = odometry.read(1)
    drawn = normal(7, np.arange(400)[:, None], 0, np.arange(2), purpose("odometry wheel"))
    for wheel, field in enumerate(("odometry.left_m", "odometry.right_m")):
        assert distances[field] == pytest.approx(2.0 * (1.0 + 0.02 * drawn[:, wheel]))
    looked_at.travel_m[0] = 0.0
    assert odometry.read(2)["odometry.left_m"] == pytest.approx(np.zeros(400), abs=1e-12)


def body() -> str:
    """A sheet with an example of every sensor."""
    tables = {**{name: asdict(spec) for name, spec in SPECS.items()}, "own": {"kind": CUSTOM, **STAGES}}
    return "\n".join(['like = "epuck"', *(f"sensors.{name} = {toml(table)}" for name, table in tables.items())])


def toml(value: Any) -> str:
    """An inline value of TOML."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml(item)}" for key, item in value.items()) + " }"
    return json.dumps(value)


def world(folder: Path, seeds: tuple[int, ...] = (1,), every: int = 1) -> World:
    """Nine robots with lit LEDs, crowded between lights."""
    (folder / "all.toml").write_text(body())
    arena = {"size_m": [0.5, 0.5], "lights": [{"intensity": 2.0, "place": "random", "count": 2}]}
    group = {"body": "all.toml", "count": 9, "agent": "x:X", "act_every_ticks": every}
    tables = {"arena": arena, "robots": {"a": group}}
    scenario = scenario_from({"format": 1, "name": "t", "seed": 1, "duration_s": 1.0, **tables}, str(folder / "s.toml"))
    built = World(scenario, seeds, {"a": NAMES})
    built.scene.leds[:] = 0x00FF00
    return built


def move_all(built: World, tick: int) -> None:
    """Let all robots drive some distance, equal in each arena."""
    robot = np.arange(built.static.arenas * built.static.robots) % built.static.robots
    built.move(commanded(built, 0.1 * np.sin(tick + robot), np.cos(robot)))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """Readings of all sensors in each of 13 ticks, in two arenas."""
    built, read = world(tmp_path_factory.mktemp("recorded"), (1, 2)), list[dict[str, Any]]()
    for tick in range(13):
        read.append(built.sense(tick)["a"].fields)
        move_all(built, tick)
    return read


@pytest.mark.parametrize("name", SENSOR_SPECS)
def test_sensor_fields_equal_readings_truth_and_synthetic_values(name: str) -> None:
    spec, declared = SPECS[name], getattr(Sensors, name)
    fields = spec.reading_fields()
    assert declared.columns == tuple(f"{name}.{field.name}" for field in fields)
    assert truth_of(declared.spec) is not BuiltInSensor
    synthetic = spec.synthetic(name, 3, lambda _, width: np.full((5, width) if width else 5, 0.25))
    for field, values, blank in zip(fields, synthetic, spec.blank(name, 5).values(), strict=True):
        assert values.shape == blank.shape == ((5, field.width) if field.width else (5,))
        finite = values[np.isfinite(values)]
        assert ((field.low <= finite) & (finite <= field.high)).all()
        assert bool(field.per) == bool(field.width)
        assert field.help


def test_sensor_spec_without_a_truth_is_refused() -> None:
    class Lost(SensorSpec):
        truth = "swarmwire.world.sensors.imu:Lost"

    class Other(SensorSpec):
        truth = "swarmwire.world.sensors.sensor:Scene"

    with pytest.raises(NotLoaded, match="holds no such name: 'Lost'"):
        truth_of(Lost)
    with pytest.raises(TypeError, match="expected a BuiltInSensor"):
        truth_of(Other)


SHEET_FAULTS: dict[str, list[dict[str, Any]]] = {  # by the key below sensors
    **{
        f"scan.{key}": [{"rays": 360, "range_m": 3.5, key: value} for value in values]
        for key, values in {"rays": [0, 2.5], "span_deg": [400.0], "range_min_m": [3.5], "at_m": [0.1]}.items()
    },
    **{
        f"battery.{key}": [{"capacity_wh": 1.0, key: value} for value in values]
        for key, values in {"capacity_wh": [-1.0, 0], "idle_w": [-0.1], "empty_v": [4.5], "start": [1.5]}.items()
    },
    "ground.points_m[1]": [{"points_m": [[0.0, 0.0], [0.03, 0.09]]}],  # not under the body
    "ground.points_m[0]": [{"points_m": [[0.0, 0.0, 0.0]]}],
    "ground.points_m": [{"points_m": []}],
}


@pytest.mark.parametrize(("key", "table"), [(key, table) for key, tables in SHEET_FAULTS.items() for table in tables])
def test_impossible_sensor_is_refused_with_its_key(key: str, table: dict[str, Any]) -> None:
    with refused_input("mine.toml", f"sensors.{key}"):
        body_from({"like": "footbot", "sensors": {key.partition(".")[0]: table}}, "mine.toml")


@pytest.mark.parametrize("name", NAMES)
def test_readings_are_blank_at_first_and_vary_later(recorded: list[dict[str, Any]], name: str) -> None:
    fields = [field for field in recorded[0] if field.startswith(f"{name}.")]
    assert fields
    for field in fields:
        first, later = recorded[0][field], np.stack([tick[field] for tick in recorded[3:]])
        assert first.flags.c_contiguous
        assert len(np.unique(first)) == 1  # before the first reading all are blank
        assert len(np.unique(later)) > 1


@pytest.mark.parametrize("over", [0, 1])
def test_arena_senses_equally_after_another_has_left(tmp_path: Path, recorded: list[dict[str, Any]], over: int) -> None:
    built, rows = world(tmp_path, (1, 2)), slice(0, 9) if over else slice(9, 18)
    for tick, expected in enumerate(recorded):
        if tick == 5:
            built.leave(np.arange(2) == over)
        readings = built.sense(tick)["a"]
        assert readings.rows.tolist() == list(range(18) if tick < 5 else range(18)[rows])
        for field, values in readings.fields.items():
            np.testing.assert_array_equal(values[-9:] if over == 0 else values[:9], expected[field][rows])
        move_all(built, tick)


def test_arena_senses_equally_alone_and_among_others(tmp_path: Path, recorded: list[dict[str, Any]]) -> None:
    alone = world(tmp_path, (2,))
    for tick in range(13):
        for field, values in alone.sense(tick)["a"].fields.items():
            assert np.array_equal(values, recorded[tick][field][9:], equal_nan=True), field
        move_all(alone, tick)


def test_readings_do_not_depend_on_how_often_a_group_acts(tmp_path: Path, recorded: list[dict[str, Any]]) -> None:
    seldom = world(tmp_path, (1, 2), every=4)
    for tick in range(13):
        read = seldom.sense(tick)
        assert bool(read) == (tick % 4 == 0)
        for field, values in (read["a"].fields if read else {}).items():
            assert np.array_equal(values, recorded[tick][field], equal_nan=True), field
        move_all(seldom, tick)
