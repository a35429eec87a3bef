"""What finds no room is named, with its key, its seed, and why."""

from typing import Any

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.world import World
from tests.support.world.samples import changed

NO_ROOM = [
    (
        "robots.flock.place",
        {"how": "disc", "radius_m": 0.8, "apart_m": 0.6},
        r"robots.flock.place: no room for flock-\d+ with seed 1: none of 1000 places",
    ),
    (
        "arena.obstacles.0.apart_m",
        3.0,
        "arena.obstacles.0: no room for cylinder 3 of 4 with seed 1: none of 1000 places",
    ),
    (
        "arena.obstacles.0.within",
        {"how": "disc", "radius_m": 0.5, "at": [9.0, 0.0]},
        "arena.obstacles.0: no room for cylinder 1 of 4 with seed 1: none of 1000 places",
    ),
    (
        "arena.lights.0.apart_m",
        5.5,
        "arena.lights.0: no room for light [12] of 2 with seed 1: none of 1000 places",
    ),
    (
        "robots.flock.place.radius_m",
        0.08,
        r"robots.flock.place: no room for flock-\d+ with seed 1: none of 1000 places",
    ),
    (
        "arena.obstacles.0.radius_m",
        1.5,
        "arena.obstacles.0: no room for cylinder 2 of 4 with seed 1: none of 1000 places",
    ),
    (
        "arena.lights",
        [{"intensity": 1.0, "at": [1.0, 1.04]}],
        r"arena.lights.0: no room for light 1 of 1 with seed 1: at \(1, 1.04\) it is outside or in an obstacle",
    ),
    ("arena.lights", [{"intensity": 1.0, "at": [3.1, 0]}], r"at \(3.1, 0\) it is outside or in an obstacle"),
    ("robots.flock.place", {"how": "grid", "spacing_m": 2.0}, "no room for flock-0 with seed 1: at "),
    (
        "robots.flock.place",
        {"how": "poses", "poses": [[0, 0, 0]] * 12},
        r"no room for flock-1 with seed 1: at \(0, 0\)",
    ),
]


@pytest.mark.parametrize(("path", "value", "text"), NO_ROOM)
def test_what_finds_no_room_is_named(path: str, value: Any, text: str) -> None:
    mapping = changed(path, value)
    if "robots" in path:
        mapping["arena"]["obstacles"] = []
    with pytest.raises(BadInput, match=f"^file.toml: .*{text}"):
        World(scenario_from(mapping, "file.toml"), [1], {})
