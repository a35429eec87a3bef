"""Placement: the obstacles, lights and robots of an arena at the start.

The order is: the map, buildings, obstacles at a point, random obstacles, lights, robots. Candidate j of an entity is a
draw keyed by the arena, the entity and j; the first free candidate becomes its position. So a robot's position depends
on its arena's seed and on earlier entities, never on later ones. Lights have no body: they keep clear of obstacles, and
only lights with a gap keep clear of lights. Robots keep clear of bodies that they could touch at their height.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from swarmwire.comms.base.angles import wrap_angles
from swarmwire.comms.base.arrays import FloatArray, KeyArray
from swarmwire.comms.base.draws import purpose, uniform
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.base.sentinels import NO_ROBOT
from swarmwire.comms.observe.truth import Group, Light
from swarmwire.world.placement.maps import Layout
from swarmwire.world.placement.occupancy import GAP_M, Disc, Occupancy, PlacedObstacles, heading_of, obstacle_at
from swarmwire.world.placement.sampling import (
    BOX,
    DISC,
    MAX_CANDIDATES,
    RING,
    Region,
    free_circle,
    free_polygon,
    place_robots,
)
from swarmwire.world.scenario import tables
from swarmwire.world.scenario.arena import CylinderTable, ObstacleTable
from swarmwire.world.scenario.scenario import RobotsTable, Scenario
from swarmwire.world.scenario.tables import AtPoses, OnGrid, PlacementTable, RegionTable

ROBOT, HEADING = purpose("place of a robot"), purpose("heading of a robot")
NOTHING_FREE = f"none of {MAX_CANDIDATES} places tried is free"


@dataclass(frozen=True, slots=True)
class Placement:
    """The initial obstacles, lights and poses of one arena."""

    obstacles: tuple[Obstacle, ...]  # of the map, of buildings, then the file's obstacles, in its order
    lights: tuple[Light, ...]  # the file's lights, in its order
    pose: FloatArray  # (robots, 3) x, y in m, heading in rad, in (-pi, pi]


def place_arena(
    scenario: Scenario,
    layout: Layout,
    groups: Sequence[Group],
    seed: int,
    key: np.uint64,
    starts: Mapping[str, FloatArray],
) -> Placement:
    """Place obstacles, lights and robots of the arena with this seed and key; BadInput names an entity without room.

    `starts` has the poses (count, 3) of groups that a source moves, which stand there in any case.
    """
    store = PlacedObstacles(scenario.arena, layout)
    obstacles = (*layout.obstacles, *_place_obstacles(scenario, store, seed, key))
    lights = _place_lights(scenario, store, seed, key)
    gaps_m = {group.name: _gap_m(scenario.robots[group.name].place) for group in groups}
    occupancy = store.occupancy(groups, max(gaps_m.values()))
    pose = np.empty((groups[-1].stop, 3))
    for group in groups:
        table, body = scenario.robots[group.name], group.body
        start, bottom_m = starts.get(group.name), body.altitude_m
        fixed = _fixed(table) if start is None else np.ascontiguousarray(start[:, :2])
        disc = Disc(body.radius_m, gaps_m[group.name], bottom_m, bottom_m + body.height_m)
        region = _region(table.place, occupancy)
        robots = group.start, group.stop
        unplaced = place_robots(occupancy, region, fixed, key, ROBOT, *robots, disc, start is None)
        if unplaced != NO_ROBOT:
            i, reason = unplaced - group.start, NOTHING_FREE
            if len(fixed):
                reason = f"at ({fixed[i, 0]:g}, {fixed[i, 1]:g}) it would stand outside or touch something"
            raise _no_room(scenario, f"robots.{group.name}.place", f"{group.name}-{i}", reason, seed)
        pose[group.start : group.stop, 2] = _headings(table.place, group, key) if start is None else start[:, 2]
    pose[:, :2] = occupancy.robot[:, :2]
    return Placement(obstacles, lights, pose)


def _no_room(scenario: Scenario, key: str, entity: str, reason: str, seed: int) -> BadInput:
    return BadInput(scenario.source, key, f"no room for {entity} with seed {seed}: {reason}")


def _place_obstacles(scenario: Scenario, store: PlacedObstacles, seed: int, key: np.uint64) -> tuple[Obstacle, ...]:
    tables = scenario.arena.obstacles
    placed: list[list[Obstacle]] = [[] for _ in tables]
    for i, table in enumerate(tables):
        if table.at:
            placed[i].append(store.add(obstacle_at(table, *table.at, heading_of(table) or 0.0)))
    for i, table in enumerate(tables):
        for copy in range(table.count if table.at is None else 0):
            obstacle = _random_obstacle(table, store.occupancy(), key, copy, purpose(f"place of obstacle {i}"))
            if obstacle is None:
                entity = f"{table.shape} {copy + 1} of {table.count}"
                raise _no_room(scenario, f"arena.obstacles.{i}", entity, NOTHING_FREE, seed)
            placed[i].append(store.add(obstacle))
    return tuple(obstacle for copies in placed for obstacle in copies)


def _random_obstacle(
    table: ObstacleTable, occupancy: Occupancy, key: np.uint64, copy: int, position_purpose: int
) -> Obstacle | None:
    heading, heading_rad, gap_m = 0.0, heading_of(table), max(GAP_M, table.apart_m)
    region = _region(table.within, occupancy)
    if isinstance(table, CylinderTable):
        x, y = free_circle(occupancy, region, key, copy, position_purpose, Disc(table.radius_m, gap_m, 0.0, inf))
    else:
        corners = obstacle_at(table, 0.0, 0.0, 0.0).corners_m
        heading_rad = np.nan if heading_rad is None else heading_rad
        x, y, heading = free_polygon(occupancy, region, key, copy, position_purpose, corners, heading_rad, gap_m)
    return obstacle_at(table, x, y, heading) if np.isfinite(x) else None


def _place_lights(scenario: Scenario, store: PlacedObstacles, seed: int, key: np.uint64) -> tuple[Light, ...]:
    placed: list[Light] = []
    for i, table in enumerate(scenario.arena.lights):
        disc = Disc(0.0, max(GAP_M, table.apart_m), 0.0, inf)
        for copy in range(table.count):
            occupancy = store.occupancy(lights=placed if table.apart_m else ())
            region = Region(BOX, *table.at, 0.0, 0.0, 0.0) if table.at else _region(table.within, occupancy)
            x, y = free_circle(occupancy, region, key, copy, purpose(f"place of light {i}"), disc)
            if not np.isfinite(x):
                reason = (
                    f"at ({table.at[0]:g}, {table.at[1]:g}) it is outside or in an obstacle"
                    if table.at
                    else NOTHING_FREE
                )
                raise _no_room(scenario, f"arena.lights.{i}", f"light {copy + 1} of {table.count}", reason, seed)
            placed.append(Light(x, y, table.intensity))
    return tuple(placed)


def _region(table: RegionTable | PlacementTable | None, occupancy: Occupancy) -> Region:
    """Return the region of a table, by default the whole arena."""
    if isinstance(table, tables.DiscTable):
        return Region(DISC, *table.at, table.radius_m, table.radius_m, 0.0)
    if isinstance(table, tables.RingTable):
        return Region(RING, *table.at, table.radius_m, table.radius_m, table.inner_radius_m)
    if isinstance(table, tables.RectangleTable):
        return Region(BOX, *table.at, 0.5 * table.size_m[0], 0.5 * table.size_m[1], 0.0)
    return Region(BOX, 0.0, 0.0, occupancy.half_x_m, occupancy.half_y_m, 0.0)


def _gap_m(table: PlacementTable) -> float:
    """Return the least gap between robots."""
    return GAP_M if isinstance(table, OnGrid | AtPoses) else max(GAP_M, table.apart_m)


def _fixed(table: RobotsTable) -> FloatArray:
    """Return the only candidate of each robot, (count, 2), if the scenario fixes it; else no rows."""
    if isinstance(table.place, AtPoses):
        return np.array(table.place.poses, np.float64)[:, :2].copy()
    if not isinstance(table.place, OnGrid):
        return np.empty((0, 2))
    columns = int(np.ceil(np.sqrt(table.count)))
    rows = -(-table.count // columns)
    i = np.arange(table.count, dtype=np.float64)
    x, y = i % columns - 0.5 * (columns - 1), i // columns - 0.5 * (rows - 1)
    return np.stack([x, y], axis=1) * table.place.spacing_m


def _headings(table: PlacementTable, group: Group, key: np.uint64) -> FloatArray:
    if isinstance(table, AtPoses):
        return wrap_angles(np.array(table.poses, np.float64)[:, 2])
    if table.heading_rad is not None:
        return wrap_angles(np.full(group.stop - group.start, table.heading_rad))
    keys: KeyArray = np.array(key, np.uint64)
    return np.pi - 2.0 * np.pi * uniform(keys, np.arange(group.start, group.stop), 0, 0, HEADING)
