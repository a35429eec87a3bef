"""Robots push movable obstacles, the floor's friction stops them, and everybody sees them where they are."""

from typing import Any

import numpy as np
import pytest

from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.geometry.obstacles import obstacle_arrays
from swarmwire.world.engines.movable import FLOOR_FRICTION, GRAVITY_MPS2, load_of
from swarmwire.world.world import World
from tests.support.world.samples import commanded, posed, wandering

EPUCK = load_body("epuck")
CYLINDER = {"shape": "cylinder", "radius_m": 0.1}
BOX = {"shape": "box", "size_m": [0.3, 0.2], "heading_rad": 0.3}
WEDGE = {"shape": "polygon", "points": [[0.0, 0.0], [0.4, 0.0], [0.0, 0.3]], "heading_rad": -0.4}
SHAPES = [CYLINDER, BOX, WEDGE]


def world_with(*obstacles: dict[str, Any], poses: Any, mass_kg: float = 0.1, needs: Any = None) -> World:
    """E-pucks among movable obstacles."""
    tables = [{"movable": True, "mass_kg": mass_kg, **table} for table in obstacles]
    arena = {"size_m": [4.0, 4.0], "obstacles": tables}
    return World(posed(poses, arena=arena), [1], needs or {})


def pose_of(world: World, which: int = 0) -> np.ndarray:
    assert world.movable is not None
    return world.movable[0, which]


@pytest.mark.parametrize("shape", SHAPES)
def test_a_robot_pushes_what_it_has_the_force_for(shape: dict[str, Any]) -> None:
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


def test_an_obstacle_whose_friction_is_stronger_than_the_robot_stays_where_it_is() -> None:
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


def test_a_push_off_the_centre_turns_a_box_and_friction_stops_it() -> None:
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


def test_an_undriven_obstacle_gains_no_energy() -> None:
    """Once it is let go it slides no farther than its speed and the floor's friction allow."""
    world = world_with({**CYLINDER, "at": [0.0, 0.0]}, poses=[[-0.3, 0.0, 0.0]], mass_kg=0.2)
    for _ in range(30):
        world.move(commanded(world, 0.12, 0.0))
    start = pose_of(world)[0]
    for _ in range(10):
        world.move(commanded(world, -0.12, 0.0))
    assert pose_of(world)[0] - start <= 0.12**2 / (2.0 * FLOOR_FRICTION * GRAVITY_MPS2) + 0.12 * 0.1


@pytest.mark.parametrize("seeds", [[5], [4, 5, 6]])
def test_the_arrays_that_sensors_and_radio_look_at_follow(seeds: list[int]) -> None:
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
        (own[0], *static.movable_at(arena, world.movable[arena]), own[-1]) for arena, own in enumerate(static.obstacles)
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


def test_a_robot_senses_the_obstacle_that_another_pushes_towards_it() -> None:
    poses = [[-0.3, 0.0, 0.0], [0.5, 0.0, np.pi]]
    world = world_with({**CYLINDER, "at": [0.0, 0.0]}, poses=poses, needs={"a": ["proximity"]})
    before = world.sense(0)["a"].fields["proximity.value"][1].max()
    for _ in range(120):
        world.move(commanded(world, [0.1, 0.0], 0.0))
    after = world.sense(1)["a"].fields["proximity.value"][1].max()
    assert before < 0.2
    assert after > 0.5


def test_friction_turns_by_the_mean_distance_of_the_area() -> None:
    world = world_with({**BOX, "at": [0.0, 0.0]}, {**CYLINDER, "at": [1.0, 1.0]}, poses=[[-1.0, 0.0, 0.0]])
    box, cylinder = (load_of(obstacle) for obstacle in world.static.obstacles[0])
    x, y = np.meshgrid(0.3 * (np.arange(600) + 0.5) / 600 - 0.15, 0.2 * (np.arange(400) + 0.5) / 400 - 0.1)
    assert box.reach_m == pytest.approx(np.hypot(x, y).mean(), rel=1e-3)
    assert cylinder.reach_m == pytest.approx(0.2 / 3.0)


def test_a_polygon_s_mass_is_where_its_area_is() -> None:
    world = world_with({**WEDGE, "at": [0.2, 0.1]}, poses=[[-1.0, 0.0, 0.0]])
    load, corners = load_of(world.static.obstacles[0][0]), world.static.obstacles[0][0].corners_m
    assert (load.x_m, load.y_m) == pytest.approx(tuple(corners.mean(axis=0)))  # a triangle's
