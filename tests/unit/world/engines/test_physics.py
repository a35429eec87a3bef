"""Physics: which engine, its steps, and movable obstacles."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.geometry.obstacles import obstacle_arrays
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.world.engines.movable import FLOOR_FRICTION, GRAVITY_MPS2, load_of
from swarmwire.world.engines.physics import ENGINES
from swarmwire.world.world import World
from tests.support.refusals import refused_input
from tests.support.world.scenes import commanded, posed, wandering

EPUCK = load_body("epuck")
MOVABLE = {"shape": "cylinder", "radius_m": 0.1, "at": [0.0, 0.0], "movable": True, "mass_kg": 0.1}
ARENA = {"size_m": [4.0, 4.0]}
CYLINDER = {"shape": "cylinder", "radius_m": 0.1}
BOX = {"shape": "box", "size_m": [0.3, 0.2], "heading_rad": 0.3}
WEDGE = {"shape": "polygon", "points": [[0.0, 0.0], [0.4, 0.0], [0.0, 0.3]], "heading_rad": -0.4}
SHAPES = [CYLINDER, BOX, WEDGE]


def test_open_arena_lets_robots_leave() -> None:
    world = World(posed([[1.9, 0.0, 0.0]], arena={"size_m": [4.0, 4.0], "boundary": "open"}), [1], {})
    for _ in range(40):
        assert not world.move(commanded(world, 0.12, 0.0)).any()
    assert world.pose[0, 0] > 2.2


def test_speed_builds_up_with_the_force_of_the_motors() -> None:
    world = World(posed([[0.0, 0.0, 0.0]], physics={"steps": 50}), [1], {})
    world.move(commanded(world, EPUCK.max_linear_mps, 0.0))
    # At 1.5 N on 0.4 kg it takes 34 ms to full speed; until then half of the way is lost, and the first step of 2 ms.
    lost_s = 0.5 * EPUCK.max_linear_mps * EPUCK.mass_kg / EPUCK.drive.max_force_n
    assert world.pose[0, 0] == pytest.approx(EPUCK.max_linear_mps * (0.1 - lost_s), abs=0.002 * EPUCK.max_linear_mps)


def test_contact_is_counted_again_after_robots_parted() -> None:
    world = World(posed([[-0.2, 0.0, 0.0], [0.2, 0.0, np.pi]]), [1], {})
    for linear_mps, began in ((0.1, 1), (-0.05, 0), (0.1, 1)):
        assert np.array_equal(sum(world.move(commanded(world, linear_mps, 0.0)) for _ in range(30)), [[began, 0]])


def test_push_off_centre_keeps_the_heading_of_a_robot() -> None:
    world = World(posed([[-0.3, 0.02, 0.0], [0.3, -0.02, np.pi]], "footbot"), [1], {})
    for _ in range(40):
        world.move(commanded(world, 0.2, 0.0))
    assert abs(world.pose[0, 2]) < np.deg2rad(3)
    assert abs(world.velocity[0, 2]) < 1e-3


def engines(**tables: Any) -> tuple[str, ...]:
    return World(posed([[-1.0, 0.0, 0.0]], **tables), [1], {}).engines


def test_auto_engine_is_discs_unless_an_obstacle_is_movable() -> None:
    assert engines() == ("discs",)
    assert engines(arena={**ARENA, "obstacles": [MOVABLE]}) == ("pymunk",)


@pytest.mark.parametrize("engine", ENGINES)
def test_engine_of_the_scenario_is_used(engine: str) -> None:
    assert engines(physics={"engine": engine}) == (engine,)


@pytest.mark.parametrize(
    ("physics", "arena", "key"),
    [
        ({"engine": "discs"}, {"obstacles": [{**CYLINDER, "at": [1.0, 1.0]}, MOVABLE]}, "physics.engine"),
        ({"engine": "kinematic"}, {"obstacles": [MOVABLE]}, "arena.obstacles.0.movable"),
        ({}, {"boundary": "torus"}, "arena.boundary"),
        ({}, {"obstacles": [{**MOVABLE, "mass_kg": -1.0}]}, "arena.obstacles.0.mass_kg"),
        ({}, {"obstacles": [{**CYLINDER, "at": [0.0, 0.0], "movable": True}]}, "arena.obstacles.0.mass_kg"),
        ({}, {"obstacles": [{**MOVABLE, "movable": False}]}, "arena.obstacles.0.mass_kg"),
    ],
)
def test_physics_contradictions_are_refused_with_their_key(
    physics: dict[str, Any], arena: dict[str, Any], key: str
) -> None:
    with refused_input("posed", key):
        posed([[-1.0, 0.0, 0.0]], physics=physics, arena={**ARENA, **arena})


@pytest.mark.parametrize("engine", ["discs", "pymunk"])
def test_engine_that_could_move_no_robot_is_refused(engine: str, tmp_path: Path) -> None:
    drone = tmp_path / "drone.toml"
    drone.write_text('like = "epuck"\nname = "drone"\naltitude_m = 1.0\n')
    table = {"count": 1, "agent": "x"}
    ghosts, medium, floor = ({**table, "body": body} for body in ("point", str(drone), "epuck"))
    with pytest.raises(BadInput, match=r"physics\.engine: .*: a has no contacts, b flies$"):
        posed([], robots={"a": ghosts, "b": medium}, physics={"engine": engine})
    posed([], robots={"a": ghosts, "b": floor}, physics={"engine": engine})


def test_robots_without_contacts_may_be_faster_than_physics_steps_allow() -> None:
    with pytest.raises(BadInput, match=r"physics\.steps: expected at least 2"):
        posed([[-1.0, 0.0, 0.0]], physics={"steps": 1})
    posed([[-1.0, 0.0, 0.0]], physics={"steps": 1, "engine": "kinematic"})


def test_robots_with_and_without_contacts_share_an_arena(tmp_path: Path) -> None:
    """Both kinds move as without the other."""
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
            both.set_alive(np.arange(10) != 3)
            alone["floor"].set_alive(np.arange(6) != 1)
        onsets = both.move(commanded(both, 0.1, 0.05))
        apart = [world.move(commanded(world, 0.1, 0.05)) for world in alone.values()]
        assert np.array_equal(onsets, sum(apart))
        for name, world in alone.items():
            assert np.array_equal(both.pose[rows[name]], world.pose)
            assert np.array_equal(both.velocity[rows[name]], world.velocity)
            at = [row % 5 for row in rows[name][: len(rows[name]) // 2]]
            assert np.array_equal(both._physics.touched[:, at], world._physics.touched)
            assert np.array_equal(both._physics.travel_m[:, at], world._physics.travel_m)


def world_with(*obstacles: dict[str, Any], poses: Any, mass_kg: float = 0.1, needs: Any = None) -> World:
    """E-pucks among movable obstacles."""
    tables = [{"movable": True, "mass_kg": mass_kg, **table} for table in obstacles]
    arena = {"size_m": [4.0, 4.0], "obstacles": tables}
    return World(posed(poses, arena=arena), [1], needs or {})


def pose_of(world: World, which: int = 0) -> np.ndarray:
    assert world.movable is not None
    return world.movable[0, which]


@pytest.mark.parametrize("shape", SHAPES)
def test_robot_pushes_a_movable_obstacle(shape: dict[str, Any]) -> None:
    world = world_with({**shape, "at": [0.0, 0.0]}, poses=[[-0.5, 0.02, 0.0]])
    start = pose_of(world).copy()
    onsets = np.zeros((1, 2), np.int64)
    for _ in range(70):
        onsets += world.move(commanded(world, 0.1, 0.0))
        if shape is CYLINDER:
            apart = np.hypot(*(pose_of(world)[:2] - world.pose[0, :2]))
            assert apart > 0.1 + EPUCK.radius_m - 1.2 * 0.1 * 0.02  # closing speed x step
    assert pose_of(world)[0] > start[0] + 0.15
    assert np.array_equal(onsets, [[0, 1]])
    assert world.engines == ("pymunk",)


def test_obstacle_moves_only_if_the_robot_exceeds_its_friction() -> None:
    held_kg = EPUCK.drive.max_force_n / (FLOOR_FRICTION * GRAVITY_MPS2)
    moved = [
        world_with({**CYLINDER, "at": [0.0, 0.0]}, poses=[[-0.5, 0.0, 0.0]], mass_kg=share * held_kg)
        for share in (0.9, 1.1)
    ]
    for world in moved:
        for _ in range(100):
            world.move(commanded(world, 0.1, 0.0))
    assert pose_of(moved[0])[0] > 0.1
    assert abs(pose_of(moved[1])[0]) < 2e-3


def test_push_off_centre_turns_a_box_and_friction_stops_it() -> None:
    world = world_with({**BOX, "heading_rad": 0.0, "at": [0.0, 0.0]}, poses=[[-0.4, 0.08, 0.0]])
    for _ in range(60):
        world.move(commanded(world, 0.1, 0.0))
    assert pose_of(world)[2] < -0.1
    for _ in range(5):
        world.move(commanded(world, -0.1, 0.0))
    at = pose_of(world).copy()
    for _ in range(20):
        world.move(commanded(world, -0.05, 0.0))
    assert np.array_equal(pose_of(world), at)


def test_released_obstacle_slides_no_farther_than_friction_allows() -> None:
    world = world_with({**CYLINDER, "at": [0.0, 0.0]}, poses=[[-0.3, 0.0, 0.0]], mass_kg=0.2)
    for _ in range(30):
        world.move(commanded(world, 0.12, 0.0))
    start = pose_of(world)[0]
    for _ in range(10):
        world.move(commanded(world, -0.12, 0.0))
    assert pose_of(world)[0] - start <= 0.12**2 / (2.0 * FLOOR_FRICTION * GRAVITY_MPS2) + 0.12 * 0.1


@pytest.mark.parametrize("seeds", [[5], [4, 5, 6]])
def test_obstacle_arrays_follow_movable_obstacles(seeds: list[int]) -> None:
    tables = [
        {"shape": "box", "size_m": [0.2, 0.2], "at": [1.5, 1.5]},
        *({**shape, "place": "random", "count": 3, "movable": True, "mass_kg": 0.05} for shape in SHAPES),
        {"shape": "cylinder", "radius_m": 0.1, "at": [-1.5, 1.5]},
    ]
    group = {"body": "epuck", "count": 40, "agent": "x"}
    arena = {"size_m": [4.0, 4.0], "obstacles": tables}
    world = World(posed([], arena=arena, robots={"a": group}), seeds, {})
    assert world.movable is not None
    start = world.movable
    for tick in range(150):
        world.move(wandering(world, tick))
    assert (np.hypot(*(world.movable - start)[..., :2].reshape(-1, 2).T) > 0.01).sum() >= len(seeds)
    static = world.static
    now = tuple(
        (fixed[0], *static.movable_at(arena, world.movable[arena]), fixed[-1])
        for arena, fixed in enumerate(static.obstacles)
    )
    expected = obstacle_arrays(now)
    for have, want in zip(world.obstacles, expected, strict=True):
        assert np.allclose(have, want, atol=1e-12)
    if len(seeds) > 1:
        alone = World(posed([], arena=arena, robots={"a": group}), [5], {})
        for tick in range(150):
            alone.move(wandering(alone, tick))
        assert alone.movable is not None
        assert np.array_equal(alone.movable[0], world.movable[1])


def test_proximity_senses_an_obstacle_that_another_robot_pushes() -> None:
    poses = [[-0.3, 0.0, 0.0], [0.5, 0.0, np.pi]]
    world = world_with({**CYLINDER, "at": [0.0, 0.0]}, poses=poses, needs={"a": ["proximity"]})
    before = world.sense(0)["a"].fields["proximity.value"][1].max()
    for _ in range(120):
        world.move(commanded(world, [0.1, 0.0], 0.0))
    after = world.sense(1)["a"].fields["proximity.value"][1].max()
    assert before < 0.2
    assert after > 0.5


def test_friction_torque_uses_the_mean_distance_of_the_area() -> None:
    world = world_with({**BOX, "at": [0.0, 0.0]}, {**CYLINDER, "at": [1.0, 1.0]}, poses=[[-1.0, 0.0, 0.0]])
    box, cylinder = (load_of(obstacle) for obstacle in world.static.obstacles[0])
    x, y = np.meshgrid(0.3 * (np.arange(600) + 0.5) / 600 - 0.15, 0.2 * (np.arange(400) + 0.5) / 400 - 0.1)
    assert box.reach_m == pytest.approx(np.hypot(x, y).mean(), rel=1e-3)
    assert cylinder.reach_m == pytest.approx(0.2 / 3.0)


def test_polygon_has_its_mass_at_the_centroid() -> None:
    world = world_with({**WEDGE, "at": [0.2, 0.1]}, poses=[[-1.0, 0.0, 0.0]])
    load, corners = load_of(world.static.obstacles[0][0]), world.static.obstacles[0][0].corners_m
    assert (load.x_m, load.y_m) == pytest.approx(tuple(corners.mean(axis=0)))  # a triangle's
