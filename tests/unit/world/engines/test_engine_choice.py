"""Who is moved by which engine, engines side by side, and what none of them can do."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.world.engines.physics import ENGINES
from swarmwire.world.world import World
from tests.support.world.samples import commanded, posed

MOVABLE = {"shape": "cylinder", "radius_m": 0.1, "at": [0.0, 0.0], "movable": True, "mass_kg": 0.1}
ARENA = {"size_m": [4.0, 4.0]}


def engines(**tables: Any) -> tuple[str, ...]:
    return World(posed([[-1.0, 0.0, 0.0]], **tables), [1], {}).engines


def test_discs_move_robots_unless_an_obstacle_is_movable() -> None:
    assert engines() == ("discs",)
    assert engines(arena={**ARENA, "obstacles": [MOVABLE]}) == ("pymunk",)


@pytest.mark.parametrize("engine", ENGINES)
def test_an_engine_that_is_asked_for_is_taken(engine: str) -> None:
    assert engines(physics={"engine": engine}) == (engine,)


@pytest.mark.parametrize(
    ("physics", "arena", "text"),
    [
        (
            {"engine": "discs"},
            {"obstacles": [{"shape": "cylinder", "radius_m": 0.1, "at": [1.0, 1.0]}, MOVABLE]},
            "physics.engine: expected auto or pymunk: discs moves no obstacles, and arena.obstacles.1 is movable",
        ),
        (
            {"engine": "kinematic"},
            {"obstacles": [MOVABLE]},
            "arena.obstacles.0.movable: expected a robot with contacts that could push it: all robots are moved "
            "without contacts",
        ),
        (
            {},
            {"boundary": "torus"},
            "arena.boundary: expected walls or open: on a torus no robot has contacts, and epuck (robots.a) does; "
            'physics.engine = "kinematic" takes them all off the floor',
        ),
        (
            {},
            {"obstacles": [{**MOVABLE, "mass_kg": -1.0}]},
            "arena.obstacles.0.mass_kg: expected a number above 0 and at most 10000 (kg), got -1.0",
        ),
        (
            {},
            {"obstacles": [{key: value for key, value in MOVABLE.items() if key != "mass_kg"}]},
            "arena.obstacles.0.mass_kg: is missing; expected the mass of what is movable (kg)",
        ),
        (
            {},
            {"obstacles": [{**MOVABLE, "movable": False}]},
            "arena.obstacles.0.mass_kg: expected a mass only with movable = true",
        ),
    ],
)
def test_contradictions_are_refused_with_file_key_and_reason(
    physics: dict[str, Any], arena: dict[str, Any], text: str
) -> None:
    with pytest.raises(BadInput, match=f"^posed: {re.escape(text)}$"):
        posed([[-1.0, 0.0, 0.0]], physics=physics, arena={**ARENA, **arena})


@pytest.mark.parametrize("engine", ["discs", "pymunk"])
def test_an_engine_that_could_move_nobody_is_refused(engine: str, tmp_path: Path) -> None:
    drone = tmp_path / "drone.toml"
    drone.write_text('like = "epuck"\nname = "drone"\naltitude_m = 1.0\n')
    table = {"count": 1, "agent": "x"}
    ghosts, medium, floor = ({**table, "body": body} for body in ("point", str(drone), "epuck"))
    told = "expected auto or kinematic: no robot could be moved by"
    with pytest.raises(BadInput, match=rf"physics\.engine: {told} {engine}: a has no contacts, b flies$"):
        posed([], robots={"a": ghosts, "b": medium}, physics={"engine": engine})
    posed([], robots={"a": ghosts, "b": floor}, physics={"engine": engine})


def test_robots_without_contacts_may_be_faster_than_physics_steps_allow() -> None:
    with pytest.raises(BadInput, match=r"physics\.steps: expected at least 2"):
        posed([[-1.0, 0.0, 0.0]], physics={"steps": 1})
    posed([[-1.0, 0.0, 0.0]], physics={"steps": 1, "engine": "kinematic"})


def test_floor_and_air_stand_side_by_side_in_one_arena(tmp_path: Path) -> None:
    """Each moves as it does with its own kind alone."""
    drone = tmp_path / "drone.toml"
    drone.write_text('like = "footbot"\nname = "drone"\naltitude_m = 1.0\ncontacts = false\n')
    flock = {"body": "epuck", "count": 3, "agent": "x"}
    poses = [[-0.5, 0.0, 0.0], [0.5, 0.0, np.pi], [0.0, 1.0, 0.0]]
    above = {"how": "poses", "poses": [[-0.5, 0.0, 0.0], [0.5, 0.05, np.pi]]}
    robots = {
        "air": {"body": str(drone), "count": 2, "agent": "x", "place": above},
        "floor": {**flock, "place": {"how": "poses", "poses": poses}},
    }
    both = World(posed([], robots=robots), [1, 2], {})
    alone = {name: World(posed([], robots={name: table}), [1, 2], {}) for name, table in robots.items()}
    assert both.engines == ("discs", "kinematic")
    rows = {"air": [0, 1, 5, 6], "floor": [2, 3, 4, 7, 8, 9]}
    for tick in range(60):
        if tick == 40:
            both.live(np.arange(10) != 3)
            alone["floor"].live(np.arange(6) != 1)
        onsets = both.move(commanded(both, 0.1, 0.05))
        apart = [world.move(commanded(world, 0.1, 0.05)) for world in alone.values()]
        assert np.array_equal(onsets, sum(apart))
        for name, world in alone.items():
            assert np.array_equal(both.pose[rows[name]], world.pose)
            assert np.array_equal(both.velocity[rows[name]], world.velocity)
            at = [row % 5 for row in rows[name][: len(rows[name]) // 2]]
            assert np.array_equal(both._physics.touched[:, at], world._physics.touched)
            assert np.array_equal(both._physics.travel_m[:, at], world._physics.travel_m)
