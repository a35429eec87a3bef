"""Batteries are drained by what robots do; an empty one is death, and a bad sheet is refused."""

from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.bodies.body import Body, body_from, load_body
from swarmwire.comms.errors import BadInput
from swarmwire.comms.sensors.simple import BatterySpec
from swarmwire.comms.truth import Group
from swarmwire.world.actuation.batteries import Batteries
from swarmwire.world.event_scheduler import EventScheduler
from swarmwire.world.world import World
from tests.support.world.samples import commanded, posed
from tests.support.world.scenes import read, scene

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


def with_battery(spec: BatterySpec) -> Body:
    return replace(EPUCK, sensors={**EPUCK.sensors, "battery": spec})


def batteries(*bodies: Body, arenas: int = 1) -> Batteries:
    groups = [Group(str(i), body, i, i + 1) for i, body in enumerate(bodies)]
    return Batteries(groups, arenas, 0.1)


def drained(of: Batteries, target, leds=None, alive=None):
    """A tick of one arena under these targets (robots, 3)."""
    robots, given = of.charge.shape[1], np.array([target], np.float64)
    lights = np.zeros((1, robots, 2), np.int64) if leds is None else np.array([leds])
    of.drain(np.ones(robots, bool) if alive is None else np.array(alive), lights, given)


def test_what_is_used_is_power_times_time() -> None:
    of = batteries(with_battery(SHEET), with_battery(SHEET), EPUCK, with_battery(SHEET))
    base_m = EPUCK.wheels.wheel_base_m
    targets = [[0.1, 0.0, 0.0], [0.0, 2.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.0]]
    drained(of, targets, [[0, 0], [0, 0], [5, 5], [0xFF0000, 1]])
    watts = np.array([1.0 + 20.0 * 0.1, 1.0 + 20.0 * base_m, 0.0, 1.0 + 2 * 0.5])
    assert of.charge[0] == pytest.approx(1.0 - watts * 0.1 / 3600.0 / 0.01)
    curving = batteries(with_battery(SHEET), with_battery(SHEET))
    drained(curving, [[0.1, 0.2 / base_m, 0.0], [-0.1, 6.0 / base_m, 0.0]])  # the mean of how fast the wheels turn
    watts = np.array([1.0 + 20.0 * 0.1, 1.0 + 20.0 * 3.0])
    assert curving.charge[0] == pytest.approx(1.0 - watts * 0.1 / 3600.0 / 0.01)
    moving = batteries(HOLONOMIC)
    drained(moving, [[0.3, 1.0, -0.4]])
    assert moving.charge[0, 0] == pytest.approx(1.0 - 20.0 * 0.5 * 0.1 / 3600.0 / 0.01)


def test_a_charge_ends_at_nothing_and_only_empty_batteries_are_renewed() -> None:
    of = batteries(with_battery(replace(SHEET, start=0.01)), with_battery(SHEET), EPUCK)
    for _ in range(2):
        drained(of, [[0.1, 1.0, 0.0]] * 3)
    assert of.charge[0, 0] == 0.0
    assert of.empty.tolist() == [True, False, False]
    before = of.charge[0, 1]
    of.renew(np.array([True, True, True]))
    assert of.charge[0].tolist() == [1.0, before, 1.0]


def test_a_robot_whose_battery_is_empty_is_dead_and_its_run_says_so() -> None:
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
    assert deaths == [
        (5, "run_down", [True, True]),
        (10, "revive", [True, False]),
        (20, "run_down", [True, False]),
    ]
    assert world.command[1].tolist() == [0.0, 0.0, 0.0]


def test_a_dead_robot_draws_nothing() -> None:
    of = batteries(with_battery(SHEET), with_battery(SHEET))
    drained(of, np.zeros((2, 3)), alive=[False, True])
    assert of.charge[0, 0] == 1.0 > of.charge[0, 1]


def test_only_bodies_with_a_battery_have_any() -> None:
    assert not batteries(EPUCK).any
    assert batteries(EPUCK, with_battery(SHEET)).any
    assert batteries(EPUCK, with_battery(replace(SHEET, start=0.25)), arenas=2).charge.tolist() == [[1.0, 0.25]] * 2


def test_the_gauge_tells_charge_and_a_voltage_that_falls_with_it() -> None:
    looked_at = scene(np.zeros((3, 3)), EPUCK)
    looked_at.charge[0] = [1.0, 0.5, 0.0]
    told = read(looked_at, EPUCK, "battery", replace(SHEET, full_v=4.0, empty_v=3.0))
    assert told["battery.charge"].tolist() == [1.0, 0.5, 0.0]
    assert told["battery.voltage_v"].tolist() == [4.0, 3.5, 3.0]
    noisy = read(looked_at, EPUCK, "battery", replace(SHEET, noise=0.2, noise_v=0.1), 3)
    assert noisy["battery.charge"][0] <= 1.0
    assert noisy["battery.charge"][2] >= 0.0
    assert not np.array_equal(noisy["battery.voltage_v"], told["battery.voltage_v"])


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("capacity_wh", -1.0, "expected more than 0 Wh, got -1.0"),
        ("capacity_wh", 0, "expected more than 0 Wh, got 0.0"),
        ("idle_w", -0.1, "expected at least 0 W"),
        ("empty_v", 4.5, "expected at most full_v, 4.2 V; got 4.5"),
        ("start", 1.5, "expected at most 1"),
    ],
)
def test_a_negative_battery_is_refused(key: str, value: float, expected: str) -> None:
    spec = {"like": "epuck", "sensors": {"battery": {"capacity_wh": 1.0, key: value}}}
    with pytest.raises(BadInput, match=rf"mine.toml: sensors.battery.{key}: {expected}"):
        body_from(spec, "mine.toml")
