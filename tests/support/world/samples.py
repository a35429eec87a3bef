"""Scenarios and commands that the world's tests share."""

import copy
from typing import Any

import numpy as np

from swarmwire.comms.tick_io import Actions
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.world import World

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
    asked = (np.broadcast_to(np.asarray(v, np.float64), rows.shape).copy() for v in speeds)
    return Actions(rows, np.ones(len(rows), np.bool_), *asked)


def wandering(world: World, tick: int) -> Actions:
    """Commands that differ by robot index and tick, alike in every arena."""
    index = np.arange(world.static.arenas * world.static.robots) % world.static.robots
    return commanded(world, 0.06 + 0.06 * np.sin(index + 0.1 * tick), np.cos(3.0 * index + 0.2 * tick))
