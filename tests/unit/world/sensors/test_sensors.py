"""All sensors."""

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.draws import normal, purpose
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.base.plugins import NotLoaded
from swarmwire.comms.observe.truth import Group
from swarmwire.comms.robot.bodies.body import Body, load_body
from swarmwire.comms.robot.sensors import SENSOR_SPECS, Sensors
from swarmwire.comms.robot.sensors.rays import ProximitySpec
from swarmwire.comms.robot.sensors.sensor import RangedSensorSpec, SensorSpec
from swarmwire.comms.robot.sensors.simple import CompassSpec, OdometrySpec
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.sensors.loading import sensor_of, truth_of
from swarmwire.world.sensors.rays import ProximitySensor
from swarmwire.world.sensors.sensor import BuiltInSensor, Scene
from swarmwire.world.world import World
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
STAGES: dict[str, Any] = {"rate_hz": 4.0, "delay_s": 0.15, "drop_out": 0.2}
OUTLIER: dict[str, Any] = {"outlier": 0.1, "step": 0.01}
SPECS = {
    name: replace(kind.example(), **STAGES, **(OUTLIER if issubclass(kind, RangedSensorSpec) else {}))
    for name, kind in SENSOR_SPECS.items()
}
OWN = f"{Path(__file__).parents[3] / 'support' / 'custom_code.py'}:Alone"
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
def test_a_wall_ahead_looks_to_a_footbot_as_in_argos(gap_m: float, length: float) -> None:
    assert abs(mean_vector(gap_m)) == pytest.approx(length, abs=6e-5)
    assert np.angle(mean_vector(gap_m)) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("gap_m", "off_deg", "seen_deg"), [(0.08, 15, -15.0), (0.08, 10, -7.7), (0.05, 10, -12.9), (0.02, 10, -9.1)]
)
def test_a_wall_seen_at_an_angle_is_where_argos_sees_it(gap_m: float, off_deg: float, seen_deg: float) -> None:
    assert np.rad2deg(np.angle(mean_vector(gap_m, np.deg2rad(off_deg)))) == pytest.approx(seen_deg, abs=0.06)


def test_a_footbot_answers_to_a_wall_as_in_argos() -> None:
    for distance_m, value in ((0.0999999, 0.1004), (0.05, 0.2004), (0.02, 0.4986), (0.0098, 1.0), (0.1000001, 0.0)):
        off_rad = np.deg2rad(-7.5)  # ray 0 looks straight at the wall
        seen = values(scene([[5.0 - FOOTBOT.radius_m - distance_m, 0.0, off_rad]], FOOTBOT), FOOTBOT)[0, 0]
        assert seen == pytest.approx(value, abs=6e-5)


def test_an_epuck_answers_to_a_wall_by_its_quadratic_curve() -> None:
    for distance_m, value in ((0.005, 0.905), (0.01, 0.743), (0.02, 0.464), (0.03, 0.244), (0.04, 0.084), (0.049, 0.0)):
        off_rad = np.deg2rad(-17)  # ray 0 looks straight at the wall
        seen = values(scene([[5.0 - EPUCK.radius_m - distance_m, 0.0, off_rad]], EPUCK), EPUCK)[0, 0]
        assert seen == pytest.approx(value, abs=1e-3)


@pytest.mark.parametrize("body", [EPUCK, FOOTBOT])
def test_the_kernel_answers_as_the_sheet_s_curve(body: Body) -> None:
    assert body.proximity is not None
    poses = np.random.default_rng(1).uniform(-1, 1, (100, 3)) * [0.6, 0.6, np.pi]
    looked_at = scene(poses, body, size_m=1.4)
    distance_m, value = proximity(looked_at, body).distance_m()[0], values(looked_at, body)
    seen = np.isfinite(distance_m)
    assert 100 < np.count_nonzero(seen) < seen.size
    assert np.array_equal(value[seen], body.proximity.response.value(distance_m[seen]))
    assert not value[~seen].any()


def marched(looked_at: Scene, body: Body, own: int, obstacles: tuple[Obstacle, ...], half: float) -> FloatArray:
    """The distance along each ray of one robot by small steps, inf beyond the range; good to 0.1 mm."""
    assert body.proximity is not None
    x, y, heading = looked_at.state[0, own, :3]
    along = np.arange(0.0, body.proximity.range_m, 1e-4)
    found = np.full(len(body.proximity.angle_rad), np.inf)
    for ray, angle in enumerate(body.proximity.angle_rad):
        px = x + (body.radius_m + along) * np.cos(heading + angle)
        py = y + (body.radius_m + along) * np.sin(heading + angle)
        hit = (np.abs(px) >= half) | (np.abs(py) >= half)
        for other in range(len(looked_at.radius_m)):
            if other != own:
                hit |= np.hypot(px - looked_at.state[0, other, 0], py - looked_at.state[0, other, 1]) <= body.radius_m
        for o in obstacles:
            if o.shape == "cylinder":
                hit |= np.hypot(px - o.x_m, py - o.y_m) <= o.radius_m
                continue
            within = np.ones_like(hit)
            for (ax, ay), (bx, by) in zip(o.corners_m, np.roll(o.corners_m, -1, axis=0), strict=True):
                within &= (bx - ax) * (py - ay) >= (by - ay) * (px - ax)
            hit |= within
        if hit.any():
            found[ray] = along[np.argmax(hit)]
    return found


def test_rays_end_at_the_nearest_robot_obstacle_or_wall() -> None:
    poses = np.random.default_rng(2).uniform(-1, 1, (40, 3)) * [0.6, 0.6, np.pi]
    obstacles = (
        Obstacle("cylinder", 0.3, 0.3, radius_m=0.1),
        Obstacle("box", -0.3, 0.1, 0.4, size_m=(0.3, 0.1)),
        Obstacle("polygon", 0.2, -0.3, 0.7, points_m=((0.0, -0.1), (0.2, 0.0), (0.1, 0.15), (-0.1, 0.1))),
    )
    looked_at = scene(poses, EPUCK, obstacles, size_m=1.3)
    near = proximity(looked_at, EPUCK).distance_m()[0]
    for own in range(len(poses)):
        expected = marched(looked_at, EPUCK, own, obstacles, 0.65)
        both = np.isfinite(expected) & np.isfinite(near[own])
        assert np.abs(expected[both] - near[own][both]).max(initial=0.0) <= 1.1e-4
        edge = np.minimum(expected, near[own])[np.isfinite(expected) != np.isfinite(near[own])]
        assert np.all(edge > 0.0998)  # only at the very end of a ray may the march differ


@given(x=st.floats(-3, 3), y=st.floats(-3, 3), turn=st.floats(-3.1, 3.1), seed=st.integers(0, 9))
def test_what_robots_see_of_each_other_does_not_depend_on_the_frame(x: float, y: float, turn: float, seed: int) -> None:
    poses = np.random.default_rng(seed).uniform(-1, 1, (30, 3)) * [0.5, 0.5, np.pi]
    c, s = np.cos(turn), np.sin(turn)
    moved = np.stack(
        [x + c * poses[:, 0] - s * poses[:, 1], y + s * poses[:, 0] + c * poses[:, 1], poses[:, 2] + turn], axis=1
    )
    before = proximity(scene(poses, EPUCK, boundary="open"), EPUCK).distance_m()
    after = proximity(scene(moved, EPUCK, boundary="open"), EPUCK).distance_m()
    grazing = np.isfinite(before) != np.isfinite(after)  # a ray that just touches or just reaches
    assert np.count_nonzero(grazing) <= 1
    both = np.isfinite(before) & np.isfinite(after)
    # Near a tangent the distance changes with the root of a rounding error.
    assert np.abs(before[both] - after[both]).max() < 1e-6


def test_proximity_noise_is_uniform_keyed_and_clipped() -> None:
    poses = np.stack([np.linspace(-4, 4, 500), np.zeros(500), np.zeros(500)], axis=1)
    assert EPUCK.proximity is not None
    spec = replace(EPUCK.proximity, noise=0.05)
    sensor = staged(scene(poses[::25], EPUCK, boundary="open"), EPUCK, "proximity", spec)
    draws = np.concatenate([sensor.read(tick)["proximity.value"].ravel() for tick in range(50)])
    assert draws.min() == 0.0
    assert 0.0499 < draws.max() <= 0.05
    # 8,000 draws, half of them clipped to 0: the share's standard deviation is 0.0056.
    assert abs(np.mean(draws == 0.0) - 0.5) < 0.025
    assert np.array_equal(sensor.read(3)["proximity.value"], sensor.read(3)["proximity.value"])
    assert not np.array_equal(sensor.read(3)["proximity.value"], sensor.read(4)["proximity.value"])


def test_the_compass_errs_normally_and_stays_within_a_turn() -> None:
    poses = np.tile([0.0, 0.0, np.pi], (20, 1))
    looked_at = scene(poses, EPUCK)
    exact = read(looked_at, EPUCK, "compass", CompassSpec(0.0))["compass.heading_rad"]
    assert np.array_equal(exact, np.full(20, np.pi))
    noisy = read(looked_at, EPUCK, "compass", CompassSpec(0.1), 5)["compass.heading_rad"]
    error = np.angle(np.exp(1j * (noisy - np.pi)))
    expected = 0.1 * normal(7, np.arange(20), 5, 0, purpose("compass.heading_rad noise"))
    assert np.allclose(error, expected)
    assert np.all((noisy > -np.pi) & (noisy <= np.pi))


@given(turns=st.integers(-5, 5), heading=st.floats(-3.14, 3.14))
def test_the_compass_forgets_full_turns(turns: int, heading: float) -> None:
    looked_at = scene([[0.0, 0.0, heading + turns * 2 * np.pi]], EPUCK)
    told = read(looked_at, EPUCK, "compass", CompassSpec(0.0))["compass.heading_rad"]
    assert told[0] == pytest.approx(heading, abs=1e-12)


@pytest.mark.parametrize("steps", [2, 5, 20])
def test_wheels_roll_the_way_that_the_robot_drives(steps: int) -> None:
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


def test_a_robot_held_by_a_wall_rolls_no_further() -> None:
    world = World(posed([[1.9, 0.0, 0.0]]), [1], {})
    for _ in range(30):
        world.move(commanded(world, 0.1, 0.0))
    assert world._physics.travel_m[0, 0] == pytest.approx([0.1 - EPUCK.radius_m] * 2, abs=2e-3)


def test_encoders_slip_by_tick_and_show_whole_steps() -> None:
    looked_at = scene(np.zeros((2, 3)), EPUCK)
    slipping = staged(looked_at, EPUCK, "odometry", OdometrySpec(slip=0.05, step_m=0.0))
    stepped = staged(looked_at, EPUCK, "odometry", OdometrySpec(slip=0.05, step_m=0.001))
    told = np.zeros((2, 2))
    for tick in range(1, 20):
        looked_at.travel_m[0] += [[0.01, 0.02], [-0.01, 0.0]]
        factor = 1 + 0.05 * normal(7, np.arange(2)[:, None], tick, np.arange(2), purpose("odometry slip"))
        told += [[0.01, 0.02], [-0.01, 0.0]] * factor
        shown, exact = stepped.read(tick), slipping.read(tick)
        for wheel, field in enumerate(("odometry.left_m", "odometry.right_m")):
            assert np.allclose(exact[field], told[:, wheel], atol=1e-12)
            assert np.array_equal(shown[field], np.floor(exact[field] / 0.001) * 0.001)
    assert np.array_equal(slipping.read(20)["odometry.left_m"], slipping.read(20)["odometry.left_m"])


def test_odometry_is_the_same_however_often_an_agent_looks() -> None:
    """The slip is that of every tick; a robot that acts in every third one reads what it would have read anyway."""
    needs = {"a": ("odometry",)}
    poses = [[0.0, 0.0, 0.0], [1.0, 0.0, 2.0]]
    every, third = (World(posed(poses), [1], needs) for _ in range(2))
    third.static = replace(third.static, groups=(replace(third.static.groups[0], act_every_ticks=3),))
    for tick in range(13):
        read, now_and_then = every.sense(tick), third.sense(tick)
        if tick == 12:
            assert read["a"].fields["odometry.left_m"].min() > 0.0
        assert now_and_then.keys() == (set() if tick % 3 else {"a"})
        for name, group in now_and_then.items():
            for field, column in group.fields.items():
                assert np.array_equal(column, read[name].fields[field])
        for world in (every, third):
            world.move(commanded(world, 0.1, 1.0))


def test_the_sheets_of_the_bodies_have_a_sensor_each() -> None:
    assert EPUCK.sensors.keys() == FOOTBOT.sensors.keys() == {*SENSORS, "ground", "camera"}
    assert isinstance(EPUCK.proximity, ProximitySpec)


def test_wheels_differ_from_what_their_encoders_take_them_for() -> None:
    """Drawn once per wheel, so it grows with the way; travel back and forth undoes it."""
    looked_at = scene(np.zeros((400, 3)), EPUCK)
    odometry = staged(looked_at, EPUCK, "odometry", OdometrySpec(wheel_error_std=0.02))
    looked_at.travel_m[0] = 2.0
    told = odometry.read(1)
    drawn = normal(7, np.arange(400)[:, None], 0, np.arange(2), purpose("odometry wheel"))
    for wheel, field in enumerate(("odometry.left_m", "odometry.right_m")):
        assert told[field] == pytest.approx(2.0 * (1.0 + 0.02 * drawn[:, wheel]))
    looked_at.travel_m[0] = 0.0
    assert odometry.read(2)["odometry.left_m"] == pytest.approx(np.zeros(400), abs=1e-12)


def body() -> str:
    """A sheet with an example of every sensor."""
    tables = {**{name: asdict(spec) for name, spec in SPECS.items()}, "own": {"kind": OWN, **STAGES}}
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
    of = World(scenario, seeds, {"a": NAMES})
    of.scene.leds[:] = 0x00FF00
    return of


def moved(of: World, tick: int) -> None:
    """All drive some way, which is the same in each arena."""
    robot = np.arange(of.static.arenas * of.static.robots) % of.static.robots
    of.move(commanded(of, 0.1 * np.sin(tick + robot), np.cos(robot)))


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """What all sensors read in each of 13 ticks, two arenas side by side."""
    of, read = world(tmp_path_factory.mktemp("told"), (1, 2)), list[dict[str, Any]]()
    for tick in range(13):
        read.append(of.sense(tick)["a"].fields)
        moved(of, tick)
    return read


@pytest.mark.parametrize("name", SENSOR_SPECS)
def test_the_fields_of_a_spec_are_those_of_its_reading_its_truth_and_its_synthetic_values(name: str) -> None:
    spec, declared = SPECS[name], getattr(Sensors, name)
    fields = spec.reading_fields()
    assert declared.columns == tuple(f"{name}.{field.name}" for field in fields)
    assert truth_of(declared.spec) is not BuiltInSensor
    made = spec.synthetic(name, 3, lambda _, width: np.full((5, width) if width else 5, 0.25))
    for field, values, blank in zip(fields, made, spec.blank(name, 5).values(), strict=True):
        assert values.shape == blank.shape == ((5, field.width) if field.width else (5,))
        finite = values[np.isfinite(values)]
        assert ((field.low <= finite) & (finite <= field.high)).all()
        assert bool(field.per) == bool(field.width)
        assert field.help


def test_a_declaration_without_its_truth_is_refused() -> None:
    class Lost(SensorSpec):
        truth = "swarmwire.world.sensors.imu:Lost"

    class Other(SensorSpec):
        truth = "swarmwire.world.sensors.sensor:Scene"

    with pytest.raises(NotLoaded, match="holds no such name: 'Lost'"):
        truth_of(Lost)
    with pytest.raises(TypeError, match="expected a BuiltInSensor"):
        truth_of(Other)


@pytest.mark.parametrize("name", NAMES)
def test_some_readings_are_there_and_some_are_lost(told: list[dict[str, Any]], name: str) -> None:
    fields = [field for field in told[0] if field.startswith(f"{name}.")]
    assert fields
    for field in fields:
        first, later = told[0][field], np.stack([tick[field] for tick in told[3:]])
        assert first.flags.c_contiguous
        assert len(np.unique(first)) == 1  # nothing was shown so far: all are blank
        assert len(np.unique(later)) > 1


@pytest.mark.parametrize("over", [0, 1])
def test_an_arena_senses_the_same_once_another_has_left(tmp_path: Path, told: list[dict[str, Any]], over: int) -> None:
    of, kept = world(tmp_path, (1, 2)), slice(0, 9) if over else slice(9, 18)
    for tick, expected in enumerate(told):
        if tick == 5:
            of.leave(np.arange(2) == over)
        readings = of.sense(tick)["a"]
        assert readings.rows.tolist() == list(range(18) if tick < 5 else range(18)[kept])
        for field, values in readings.fields.items():
            np.testing.assert_array_equal(values[-9:] if over == 0 else values[:9], expected[field][kept])
        moved(of, tick)


def test_an_arena_alone_senses_what_it_senses_among_others(tmp_path: Path, told: list[dict[str, Any]]) -> None:
    alone = world(tmp_path, (2,))
    for tick in range(13):
        for field, values in alone.sense(tick)["a"].fields.items():
            assert np.array_equal(values, told[tick][field][9:], equal_nan=True), field
        moved(alone, tick)


def test_how_often_a_group_looks_changes_nothing(tmp_path: Path, told: list[dict[str, Any]]) -> None:
    seldom = world(tmp_path, (1, 2), every=4)
    for tick in range(13):
        read = seldom.sense(tick)
        assert bool(read) == (tick % 4 == 0)
        for field, values in (read["a"].fields if read else {}).items():
            assert np.array_equal(values, told[tick][field], equal_nan=True), field
        moved(seldom, tick)


def test_a_sensor_that_failed_reads_blank_and_all_others_go_on(tmp_path: Path, told: list[dict[str, Any]]) -> None:
    of = world(tmp_path, (1, 2))
    for tick in range(13):
        for sensor in of.sensors["a"].values():
            sensor.failed = np.arange(18).reshape(2, 9) % 3 == 0 if tick == 12 else None
        read = of.sense(tick)["a"].fields
        if tick == 12:
            for field, values in read.items():
                blank = told[0][field][0]
                assert np.array_equal(values[::3], np.broadcast_to(blank, values[::3].shape), equal_nan=True), field
                assert np.array_equal(values[1::3], told[12][field][1::3], equal_nan=True), field
        moved(of, tick)
