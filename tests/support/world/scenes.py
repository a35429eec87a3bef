"""Scenes, samples and pairs of robots."""

import copy
from typing import Any

import numpy as np
from scipy import stats

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.geometry.ground import ground_of
from swarmwire.comms.base.geometry.obstacles import obstacle_arrays
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.observe.truth import Group
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.sensors.sensor import SensorSpec
from swarmwire.comms.robot.tick_io import Actions
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.sensors.loading import sensor_of
from swarmwire.world.sensors.pipeline import SensorPipeline
from swarmwire.world.sensors.sensor import Scene, led_positions_m
from swarmwire.world.world import World

FALSE_ALARM = 1e-4  # probability that one comparison of equals fails
SAMPLE: dict[str, Any] = {
    "format": 1,
    "name": "sample",
    "seed": 3,
    "duration_s": 10.0,
    "arena": {
        "size_m": [6.0, 4.0],
        "obstacles": [
            {"shape": "cylinder", "radius_m": 0.1, "count": 4, "place": "random"},
            {"shape": "box", "size_m": [0.5, 0.1], "at": [1.0, 1.0]},
            {"shape": "polygon", "points": [[0, 0], [0.3, 0], [0, 0.3]], "count": 2, "place": "random"},
        ],
        "lights": [{"intensity": 2.0, "place": "random", "count": 2}],
    },
    "robots": {
        "flock": {"body": "epuck", "count": 12, "agent": "a:B", "place": {"how": "disc", "radius_m": 1.5}},
        "big": {"body": "footbot", "count": 3, "agent": "a:C"},
    },
    "radio": {"range_m": 2.0, "loss": 0.3, "measures": {"range": {"noise_m": 0.02}, "bearing": {}}},
}
SENSORS = ("proximity", "compass", "odometry", "light", "bumper")
ALL_SENSORS = {"flock": SENSORS, "big": SENSORS}


def scene(poses: Any, body: Body, obstacles: tuple[Obstacle, ...] = (), size_m: float = 10.0, **more: Any) -> Scene:
    """One arena with robots of one body at these poses (robots, 3)."""
    robots = len(poses)
    boundary = more.get("boundary", "walls")
    state = np.zeros((1, robots, 6))
    state[0, :, :3] = poses
    return Scene(
        keys=np.array([7], np.uint64),
        size_m=(size_m, size_m),
        boundary=boundary,
        obstacles=obstacle_arrays((obstacles,)),
        lights=(more.get("lights", ()),),
        ground=ground_of(more.get("floor"), (size_m, size_m), boundary),
        tick_s=more.get("tick_s", 0.1),
        radius_m=np.full(robots, body.radius_m),
        bottom_m=np.zeros(robots),
        top_m=np.full(robots, body.height_m),
        state=state,
        travel_m=np.zeros((1, robots, 2)),
        touched=np.zeros((1, robots)),
        target=np.zeros((1, robots, 3)),
        alive=np.array([more.get("alive", [True] * robots)]),
        running=np.ones(1, np.bool_),
        charge=np.ones((1, robots)),
        leds=np.full((1, robots, body.led_count), more.get("colour", 0)),
        led_positions_m=led_positions_m((Group("a", body, 0, robots),), body.led_count),
    )


def rim(obstacle: Obstacle, points: int = 2001) -> FloatArray:
    """Points close together on the rim of a cylinder, or on each side of a polygon, (k, 2)."""
    share = np.linspace(0.0, 1.0, points)[:, None]
    if obstacle.shape == "cylinder":
        turn = 2.0 * np.pi * share
        centre = np.array([obstacle.x_m, obstacle.y_m])
        return centre + obstacle.radius_m * np.concatenate([np.cos(turn), np.sin(turn)], axis=1)
    corners = obstacle.corners_m
    sides = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    return np.concatenate([(1.0 - share) * a + share * b for a, b in sides])


def staged(looked_at: Scene, body: Body, name: str, spec: SensorSpec) -> SensorPipeline:
    """A sensor of all robots of a scene with all its stages."""
    group = Group("a", body, 0, looked_at.state.shape[1])
    return SensorPipeline(name, sensor_of(name, spec, looked_at, group), spec, looked_at.keys, group, looked_at.tick_s)


def read(looked_at: Scene, body: Body, name: str, spec: SensorSpec, tick: int = 0) -> dict[str, FloatArray]:
    """Readings of the robots of a scene in a tick."""
    return staged(looked_at, body, name, spec).read(tick)


def assert_same_on_average(label: str, values: np.ndarray, expected: np.ndarray, margin: float = 0.0) -> None:
    """A paired t test of values (seeds,): the same seed has the same start and obstacles in both.

    What differs on average by no more than `margin`, a share, counts as the same.
    """
    apart = values - expected
    error = apart.std(ddof=1) / np.sqrt(len(apart))
    most = stats.t.ppf(1.0 - 0.5 * FALSE_ALARM, len(apart) - 1) * error
    print(f"{label}: {values.mean():.4g} and {expected.mean():.4g}, standard error of the difference {error:.2g}")
    assert abs(apart.mean()) <= most + max(margin, 1e-12) * abs(expected.mean()), label


def changed(path: str, value: Any) -> dict[str, Any]:
    """The sample with one value set; a number in the path is a place in a list."""
    mapping = copy.deepcopy(SAMPLE)
    at: Any = mapping
    *parents, last = path.split(".")
    for name in parents:
        at = at[int(name)] if isinstance(at, list) else at.setdefault(name, {})
    at[int(last) if isinstance(at, list) else last] = value
    return mapping


def without(path: str) -> dict[str, Any]:
    """The sample with one key left out."""
    mapping = copy.deepcopy(SAMPLE)
    at: Any = mapping
    *parents, last = path.split(".")
    for name in parents:
        at = at[name]
    del at[last]
    return mapping


def posed(poses: list[list[float]], body: str = "epuck", **tables: Any) -> Scenario:
    """Robots of one group `a` at these poses, alone in a 4 m square unless `tables` say otherwise."""
    group = {"body": body, "count": len(poses), "agent": "x", "place": {"how": "poses", "poses": poses}}
    mapping = {"format": 1, "name": "posed", "duration_s": 1.0, "arena": {"size_m": [4.0, 4.0]}, "robots": {"a": group}}
    return scenario_from({**mapping, **tables}, "posed")


def commanded(world: World, linear_mps: Any, angular_radps: Any, lateral_mps: Any = 0.0) -> Actions:
    """A command for every robot; numbers or arrays with a value per row."""
    rows = np.arange(world.static.arenas * world.static.robots)
    speeds = (linear_mps, angular_radps, lateral_mps)
    columns = (np.broadcast_to(np.asarray(v, np.float64), rows.shape).copy() for v in speeds)
    return Actions(rows, np.ones(len(rows), np.bool_), *columns)


def wandering(world: World, tick: int) -> Actions:
    """Commands that differ by robot index and tick, alike in every arena."""
    index = np.arange(world.static.arenas * world.static.robots) % world.static.robots
    return commanded(world, 0.06 + 0.06 * np.sin(index + 0.1 * tick), np.cos(3.0 * index + 0.2 * tick))
