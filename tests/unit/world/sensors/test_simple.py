"""Sensors of a robot by itself: battery, bumper, ground, positioning, IMU."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.draws import normal, purpose
from swarmwire.comms.base.geometry.floor import Floor, Patch
from swarmwire.comms.observe.truth import Group
from swarmwire.comms.robot.bodies.body import Body, body_from, load_body
from swarmwire.comms.robot.sensors.imu import ImuSpec
from swarmwire.comms.robot.sensors.simple import BatterySpec, FlowSpec, GroundSpec, PositioningSpec
from swarmwire.comms.robot.tick_io import SparseTable
from swarmwire.world.actuation.batteries import Batteries
from swarmwire.world.event_scheduler import EventScheduler
from swarmwire.world.sensors.sensor import Scene
from swarmwire.world.world import World
from tests.support.world.scenes import commanded, posed, read, scene, staged

EPUCK = load_body("epuck")
SHEET = BatterySpec(capacity_wh=0.01, idle_w=1.0, drive_w_per_mps=20.0, led_w=0.5)
HOLONOMIC = body_from(
    {
        "like": "epuck",
        "drive": {"kind": "holonomic", "max_speed_mps": 1.0, "max_angular_radps": 1.0, "max_force_n": 1.0}
        | {"max_torque_nm": 1.0},
        "sensors": {"battery": {"capacity_wh": 0.01, "drive_w_per_mps": 20.0}},
    },
    "holonomic.toml",
)
BOX = {"shape": "box", "size_m": [0.2, 0.2], "at": [0.0, 0.0]}
ROOM = {"size_m": [4.0, 4.0], "obstacles": [BOX]}
THREE = GroundSpec(points_m=((0.03, -0.009), (0.03, 0.0), (0.03, 0.009)))  # ARGoS's e-puck
SPOT = Floor(0.8, (Patch("disc", 0.5, 0.2, 0.1, radius_m=0.1), Patch("disc", 0.5, 0.2, 0.4, radius_m=0.02)))
GPS = load_body("epuck-gps")
FIELDS = ("imu.forward_mps2", "imu.left_mps2", "imu.turn_radps")


def with_battery(spec: BatterySpec) -> Body:
    return replace(EPUCK, sensors={**EPUCK.sensors, "battery": spec})


def batteries(*bodies: Body, arenas: int = 1) -> Batteries:
    groups = [Group(str(i), body, i, i + 1) for i, body in enumerate(bodies)]
    return Batteries(groups, arenas, 0.1)


def drain(packs: Batteries, target, leds=None, alive=None, motors_off=None):
    """Let one arena pass a tick under these targets (robots, 3)."""
    robots, targets = packs.charge.shape[1], np.array([target], np.float64)
    lights = np.zeros((1, robots, 2), np.int64) if leds is None else np.array([leds])
    off = np.zeros((1, robots), bool) if motors_off is None else np.array([motors_off])
    packs.drain(np.ones(robots, bool) if alive is None else np.array(alive), lights, targets, off)


def test_battery_drains_by_power_times_time() -> None:
    packs = batteries(with_battery(SHEET), with_battery(SHEET), EPUCK, with_battery(SHEET))
    base_m = EPUCK.wheels.wheel_base_m
    targets = [[0.1, 0.0, 0.0], [0.0, 2.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.0]]
    drain(packs, targets, [[0, 0], [0, 0], [5, 5], [0xFF0000, 1]])
    watts = np.array([1.0 + 20.0 * 0.1, 1.0 + 20.0 * base_m, 0.0, 1.0 + 2 * 0.5])
    assert packs.charge[0] == pytest.approx(1.0 - watts * 0.1 / 3600.0 / 0.01)
    curving = batteries(with_battery(SHEET), with_battery(SHEET))
    drain(curving, [[0.1, 0.2 / base_m, 0.0], [-0.1, 6.0 / base_m, 0.0]])  # the mean of how fast the wheels turn
    watts = np.array([1.0 + 20.0 * 0.1, 1.0 + 20.0 * 3.0])
    assert curving.charge[0] == pytest.approx(1.0 - watts * 0.1 / 3600.0 / 0.01)
    moving = batteries(HOLONOMIC)
    drain(moving, [[0.3, 1.0, -0.4]])
    assert moving.charge[0, 0] == pytest.approx(1.0 - 20.0 * 0.5 * 0.1 / 3600.0 / 0.01)


def test_crazyflie_with_motors_off_draws_a_tenth() -> None:
    body = load_body("crazyflie")  # 7.9 W in flight: Bitcraze's 7 minutes of its 0.925 Wh
    packs = batteries(body, body)
    drain(packs, np.zeros((2, 3)), motors_off=[False, True])
    assert (1.0 - packs.charge[0]) * 0.925 * 36000.0 == pytest.approx([7.9, 0.79])


def test_motor_switch_holds_and_is_on_after_revival() -> None:
    world = World(posed([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), [1], {})
    spec = BatterySpec(capacity_wh=1.0, idle_w=36.0, hover_w=324.0)  # 0.001 and 0.009 of the charge in 0.1 s
    world.batteries = Batteries([Group("a", with_battery(spec), 0, 2)], 1, 0.1)
    off = SparseTable(np.array([0]), np.array([0]), np.array([0.0]))
    world.move(replace(commanded(world, 0.0, 0.0), motors=off))
    world.move(commanded(world, 0.0, 0.0))
    assert world.batteries.charge[0] == pytest.approx([0.998, 0.98])
    world.set_alive(np.array([False, True]))
    world.set_alive(np.array([True, True]))
    world.move(commanded(world, 0.0, 0.0))
    assert world.batteries.charge[0] == pytest.approx([0.988, 0.97])


def test_battery_that_is_empty_exactly_at_a_tick_ends_there() -> None:
    packs = batteries(with_battery(BatterySpec(capacity_wh=1.0, idle_w=3600.0)))  # a tenth in each tick of 0.1 s
    for tick in range(10):
        assert not packs.empty[0], tick
        drain(packs, [[0.0, 0.0, 0.0]])
    assert packs.empty[0]


def test_charge_ends_at_zero_and_only_empty_batteries_are_renewed() -> None:
    packs = batteries(with_battery(replace(SHEET, start=0.01)), with_battery(SHEET), EPUCK)
    for _ in range(2):
        drain(packs, [[0.1, 1.0, 0.0]] * 3)
    assert packs.charge[0, 0] == 0.0
    assert packs.empty.tolist() == [True, False, False]
    before = packs.charge[0, 1]
    packs.renew(np.array([True, True, True]))
    assert packs.charge[0].tolist() == [1.0, before, 1.0]


def test_empty_battery_kills_its_robot_with_a_run_down_event() -> None:
    events = [{"at_s": 1.0, "do": "revive", "robots": {"names": ["a-0"]}}]
    scenario = posed([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], events=events, duration_s=2.5)
    world = World(scenario, [1], {})
    short = with_battery(BatterySpec(capacity_wh=1.0, idle_w=3700.0, start=0.5))
    world.batteries = Batteries([Group("a", short, 0, 2)], 1, 0.1)
    scheduler = EventScheduler(scenario.events, world.static, world.keys)
    deaths: list[tuple[int, str, list[bool]]] = []
    for tick in range(25):
        happened = scheduler.apply(tick * 10**8, world).records
        deaths += [(tick, each.do, each.changed.tolist()) for each in happened]
        world.move(commanded(world, 0.05, 0.0))
    # Half a watt-hour lasts not quite half a second at 3,700 W, a full one not quite a second.
    assert deaths == [(5, "run_down", [True, True]), (10, "revive", [True, False]), (20, "run_down", [True, False])]
    assert world.command[1].tolist() == [0.0, 0.0, 0.0]


def test_dead_robot_draws_no_power() -> None:
    packs = batteries(with_battery(SHEET), with_battery(SHEET))
    drain(packs, np.zeros((2, 3)), alive=[False, True])
    assert packs.charge[0, 0] == 1.0 > packs.charge[0, 1]


def test_batteries_exist_only_for_bodies_with_one() -> None:
    assert not batteries(EPUCK).any
    assert batteries(EPUCK, with_battery(SHEET)).any
    assert batteries(EPUCK, with_battery(replace(SHEET, start=0.25)), arenas=2).charge.tolist() == [[1.0, 0.25]] * 2


def test_battery_sensor_reads_charge_and_falling_voltage() -> None:
    looked_at = scene(np.zeros((3, 3)), EPUCK)
    looked_at.charge[0] = [1.0, 0.5, 0.0]
    exact = read(looked_at, EPUCK, "battery", replace(SHEET, full_v=4.0, empty_v=3.0))
    assert exact["battery.charge"].tolist() == [1.0, 0.5, 0.0]
    assert exact["battery.voltage_v"].tolist() == [4.0, 3.5, 3.0]


def pressed(world: World, tick: int = 0) -> list[float]:
    return world.sense(tick)["a"].fields["bumper.pressed"].tolist()


def built(poses: list[list[float]], **tables: Any) -> World:
    return World(posed(poses, **tables), [1], {"a": ("bumper",)})


@pytest.mark.parametrize("poses", [[[-0.15, 0.0, 0.0]], [[1.95, 0.0, 0.0]]], ids=["obstacle", "wall"])
def test_bumper_is_pressed_at_walls_and_obstacles(poses: list[list[float]]) -> None:
    world = built([*poses, [-1.0, -1.0, 0.0]], arena=ROOM)
    assert pressed(world) == [0.0, 0.0]
    for _ in range(4):
        world.move(commanded(world, [0.1, 0.0], 0.0))
    assert pressed(world) == [1.0, 0.0]
    for _ in range(3):
        world.move(commanded(world, [-0.1, 0.0], 0.0))
    assert pressed(world) == [0.0, 0.0]


def test_bumpers_of_both_robots_in_touch_are_pressed() -> None:
    world = built([[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.09, 0.0, 0.0]])
    for _ in range(5):
        world.move(commanded(world, [0.1, 0.0, 0.0], 0.0))
    assert pressed(world) == [1.0, 0.0, 1.0]


def test_bumper_reading_is_not_written_to_later() -> None:
    world = built([[-0.15, 0.0, 0.0]], arena=ROOM)
    reading = world.sense(0)["a"].fields["bumper.pressed"]
    for _ in range(4):
        world.move(commanded(world, 0.1, 0.0))
    assert np.array_equal(reading, [0.0])


def shade(poses: Any, floor: Floor | None, spec: GroundSpec = THREE, tick: int = 0) -> FloatArray:
    return read(scene(poses, EPUCK, floor=floor), EPUCK, "ground", spec, tick)["ground.shade"]


def test_ground_is_white_without_a_floor() -> None:
    assert shade([[0.0, 0.0, 0.0], [7.0, 0.0, 0.0]], None).tolist() == [[1.0] * 3] * 2


def test_ground_reads_the_shade_under_each_point() -> None:
    at_edge = [0.5 - 0.03, 0.2 + 0.1 - 0.009 / 2, 0.0]  # the left point is over the edge of the dark disc
    assert shade([[0.0, 0.0, 0.0], at_edge, [0.5 - 0.03, 0.2, 0.0]], SPOT).tolist() == [
        [0.8, 0.8, 0.8],
        [0.1, 0.1, 0.8],
        [0.4, 0.4, 0.4],
    ]


@given(turn=st.floats(-7, 7))
def test_ground_points_turn_with_the_body(turn: float) -> None:
    ahead = [0.5 - 0.03 * np.cos(turn), 0.2 - 0.03 * np.sin(turn), turn]
    behind = [0.5 + 0.03 * np.cos(turn), 0.2 + 0.03 * np.sin(turn), turn]
    middle = shade([ahead, behind], SPOT)[:, 1]
    assert middle.tolist() == [0.4, 0.1]


def test_positioning_reads_the_position() -> None:
    poses = np.random.default_rng(1).uniform(-2, 2, (20, 3))
    looked_at = scene(poses, GPS)
    exact = read(looked_at, GPS, "positioning", PositioningSpec(0.0), 4)
    for axis, field in enumerate(("positioning.x_m", "positioning.y_m")):
        assert np.array_equal(exact[field], poses[:, axis])
    readings = World(posed([[0.5, 0.25, 0]], body="epuck-gps"), [1], {"a": ("positioning",)}).sense(0)["a"].fields
    assert readings["positioning.x_m"][0] == pytest.approx(0.5, abs=0.06)
    read(looked_at, GPS, "positioning", PositioningSpec(0.1), 4)
    assert np.array_equal(looked_at.state[0, :, :3], poses)


def test_flow_is_the_velocity_in_the_frame_of_the_body() -> None:
    looked_at = scene(np.zeros((2, 3)), GPS)
    set_motion(looked_at, 0.5 * np.pi, [0.3, 0.1])
    exact = read(looked_at, GPS, "flow", FlowSpec(), 4)
    assert exact["flow.forward_mps"] == pytest.approx([0.1, 0.1])  # robots look along +y
    assert exact["flow.left_mps"] == pytest.approx([-0.3, -0.3])


def set_motion(looked_at: Scene, heading, velocity) -> None:
    """Set heading and velocity of all robots."""
    looked_at.state[0, :, 2], looked_at.state[0, :, 3:5] = heading, velocity


def felt(headings, velocities, spec: ImuSpec | None = None, robots: int = 1):
    """The last reading after these headings and velocities, one a tick, (robots, fields)."""
    looked_at = scene(np.zeros((robots, 3)), EPUCK)
    set_motion(looked_at, headings[0], velocities[0])
    imu = staged(looked_at, EPUCK, "imu", spec or ImuSpec())
    fields = {}
    for tick, (heading, velocity) in enumerate(zip(headings, velocities, strict=True)):
        set_motion(looked_at, heading, velocity)
        fields = imu.read(tick)
    return np.stack([fields[name] for name in FIELDS], axis=1)


def test_imu_reads_speeding_up_ahead_and_braking_behind() -> None:
    assert felt([0.5, 0.5], [(0, 0), (0.1 * np.cos(0.5), 0.1 * np.sin(0.5))])[0] == pytest.approx([1.0, 0.0, 0.0])
    assert felt([0.5, 0.5], [(0.1 * np.cos(0.5), 0.1 * np.sin(0.5)), (0, 0)])[0] == pytest.approx([-1.0, 0.0, 0.0])


@pytest.mark.parametrize("turn_radps", [0.5, -2.0])
def test_imu_on_a_circle_reads_v_times_w_to_the_inside(turn_radps: float) -> None:
    headings = 0.7 + turn_radps * 0.1 * np.arange(3)
    accelerations = felt(headings, 0.2 * np.stack([np.cos(headings), np.sin(headings)], axis=1))[0]
    chord = np.sinc(turn_radps * 0.1 / (2.0 * np.pi))  # the mean over the tick's arc
    assert accelerations == pytest.approx([0.0, 0.2 * turn_radps * chord, turn_radps])


@given(turn=st.floats(-9, 9), seed=st.integers(0, 99))
def test_imu_does_not_depend_on_the_frame_of_the_arena(turn: float, seed: int) -> None:
    random = np.random.default_rng(seed)
    headings, velocities = random.uniform(-3, 3, 4), random.uniform(-1, 1, (4, 2))
    c, s = np.cos(turn), np.sin(turn)
    turned = velocities @ np.array([[c, s], [-s, c]])
    assert felt(headings + turn, turned)[0] == pytest.approx(felt(headings, velocities)[0], abs=1e-9)


def test_imu_reads_zero_in_the_first_tick() -> None:
    assert not felt([0.5], [(0.1, 0.2)]).any()


def test_imu_biases_are_drawn_once_and_drift_by_tick() -> None:
    still, robots = [(0.0, 0.0)] * 6, np.arange(500)[:, None]
    drawn = normal(7, robots, 0, np.arange(3), purpose("imu bias"))
    biased = ImuSpec(bias_std_mps2=0.1, bias_std_radps=0.02)
    constant = felt([0.0] * 6, still, biased, 500)
    assert constant == pytest.approx(drawn * [0.1, 0.1, 0.02])
    assert np.array_equal(constant, felt([0.0], still[:1], biased, 500))
    walk = sum(normal(7, robots, tick, np.arange(3), purpose("imu drift")) for tick in range(1, 6))
    drifted = felt([0.0] * 6, still, ImuSpec(drift_mps2=0.1, drift_radps=0.02), 500)
    assert drifted == pytest.approx(walk * np.array([0.1, 0.1, 0.02]) * np.sqrt(0.1))
    # 500 draws: the standard deviation is known to 3.2 %; four of them, 1 in 16,000 for each of three.
    assert drifted.std(axis=0) == pytest.approx(np.array([0.1, 0.1, 0.02]) * np.sqrt(0.5), rel=0.127)
