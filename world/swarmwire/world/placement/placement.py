"""Angles as the contract has them."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from swarmwire.comms.arrays import FloatArray, KeyArray
from swarmwire.comms.draws import purpose, uniform
from swarmwire.comms.errors import BadInput
from swarmwire.comms.truth import Group, Light, Obstacle
from swarmwire.world.placement.maps import Layout
from swarmwire.world.placement.occupancy import GAP_M, Disc, Occupancy, PlacementRules, heading_of, obstacle_at
from swarmwire.world.placement.sampling import (
    BOX,
    DISC,
    MAX_CANDIDATES,
    RING,
    Region,
    free_circle,
    free_polygon,
    put_robots,
)
from swarmwire.world.scenario import tables
from swarmwire.world.scenario.scenario import RobotsTable, Scenario
from swarmwire.world.scenario.tables import AtPoses, CylinderTable, ObstacleTable, OnGrid, PlaceTable, RegionTable


def wrapped(angle_rad: FloatArray) -> FloatArray:
    """Angles of any shape in (-pi, pi]; those already there keep their bits."""
    turned = angle_rad - 2.0 * np.pi * np.ceil((angle_rad - np.pi) / (2.0 * np.pi))
    turned = np.clip(turned, np.nextafter(-np.pi, 0.0), np.pi)  # the last bit of the product may step over an end
    return np.where((angle_rad > -np.pi) & (angle_rad <= np.pi), angle_rad, turned)


# --- Where things stand at the start of an arena: its map, obstacles at a point, then random ones, lights and robots.
#
# Candidate j of a thing is a draw keyed by the arena, the thing and j; it takes the first candidate that is free. So a
# robot's place depends on its arena's seed and on what was put before it, never on what comes after. Lights have no
# body: they keep clear of obstacles, and nothing keeps clear of them but lights that are to stand apart. Robots keep
# clear of what their own height lets them touch.


ROBOT, HEADING = purpose("place of a robot"), purpose("heading of a robot")
TRIED = f"none of {MAX_CANDIDATES} places tried is free"


@dataclass(frozen=True, slots=True)
class Placed:
    """Where everything of one arena stands at the start."""

    obstacles: tuple[Obstacle, ...]  # the map's boxes, then in the file's order
    lights: tuple[Light, ...]  # in the file's order
    pose: FloatArray  # (robots, 3) x, y in m, heading in rad, in (-pi, pi]


def place(scenario: Scenario, layout: Layout, groups: Sequence[Group], seed: int, key: np.uint64) -> Placed:
    """The obstacles, lights and robots of the arena with this seed and key; BadInput names what finds no room."""
    standing = PlacementRules(scenario.arena, layout)
    obstacles = (*layout.boxes, *_place_obstacles(scenario, standing, seed, key))
    lights = _place_lights(scenario, standing, seed, key)
    gaps_m = {group.name: _gap_m(scenario.robots[group.name].place) for group in groups}
    taken = standing.taken(groups, max(gaps_m.values()))
    pose = np.empty((groups[-1].stop, 3))
    for group in groups:
        table, body = scenario.robots[group.name], group.body
        bottom_m, fixed = body.altitude_m, _fixed(table)
        disc = Disc(body.radius_m, gaps_m[group.name], bottom_m, bottom_m + body.height_m)
        lost = put_robots(taken, _region(table.place, taken), fixed, key, ROBOT, group.start, group.stop, disc)
        if lost >= 0:
            i, why = lost - group.start, TRIED
            if len(fixed):
                why = f"at ({fixed[i, 0]:g}, {fixed[i, 1]:g}) it would stand outside or touch something"
            raise _no_room(scenario, f"robots.{group.name}.place", f"{group.name}-{i}", why, seed)
        pose[group.start : group.stop, 2] = _headings(table.place, group, key)
    pose[:, :2] = taken.robot[:, :2]
    return Placed(obstacles, lights, pose)


def _no_room(scenario: Scenario, key: str, what: str, why: str, seed: int) -> BadInput:
    return BadInput(scenario.source, key, f"no room for {what} with seed {seed}: {why}")


def _place_obstacles(scenario: Scenario, standing: PlacementRules, seed: int, key: np.uint64) -> tuple[Obstacle, ...]:
    tables = scenario.arena.obstacles
    placed: list[list[Obstacle]] = [[] for _ in tables]
    for i, table in enumerate(tables):
        if table.at:
            placed[i].append(standing.add(obstacle_at(table, *table.at, heading_of(table) or 0.0)))
    for i, table in enumerate(tables):
        for copy in range(table.count if table.at is None else 0):
            found = _random_obstacle(table, standing.taken(), key, copy, purpose(f"place of obstacle {i}"))
            if found is None:
                what = f"{table.shape} {copy + 1} of {table.count}"
                raise _no_room(scenario, f"arena.obstacles.{i}", what, TRIED, seed)
            placed[i].append(standing.add(found))
    return tuple(obstacle for some in placed for obstacle in some)


def _random_obstacle(table: ObstacleTable, taken: Occupancy, key: np.uint64, copy: int, of: int) -> Obstacle | None:
    heading, wanted, gap_m = 0.0, heading_of(table), max(GAP_M, table.apart_m)
    region = _region(table.within, taken)
    if isinstance(table, CylinderTable):
        x, y = free_circle(taken, region, key, copy, of, Disc(table.radius_m, gap_m, 0.0, inf))
    else:
        corners = obstacle_at(table, 0.0, 0.0, 0.0).corners_m
        wanted = np.nan if wanted is None else wanted
        x, y, heading = free_polygon(taken, region, key, copy, of, corners, wanted, gap_m)
    return obstacle_at(table, x, y, heading) if np.isfinite(x) else None


def _place_lights(scenario: Scenario, standing: PlacementRules, seed: int, key: np.uint64) -> tuple[Light, ...]:
    placed: list[Light] = []
    for i, table in enumerate(scenario.arena.lights):
        disc = Disc(0.0, max(GAP_M, table.apart_m), 0.0, inf)
        for copy in range(table.count):
            taken = standing.taken(lights=placed if table.apart_m else ())
            region = Region(BOX, *table.at, 0.0, 0.0, 0.0) if table.at else _region(table.within, taken)
            x, y = free_circle(taken, region, key, copy, purpose(f"place of light {i}"), disc)
            if not np.isfinite(x):
                why = f"at ({table.at[0]:g}, {table.at[1]:g}) it is outside or in an obstacle" if table.at else TRIED
                what = f"light {copy + 1} of {table.count}"
                raise _no_room(scenario, f"arena.lights.{i}", what, why, seed)
            placed.append(Light(x, y, table.intensity))
    return tuple(placed)


def _region(of: RegionTable | PlaceTable | None, taken: Occupancy) -> Region:
    """The region of a table; the whole arena where it names none."""
    if isinstance(of, tables.DiscTable):
        return Region(DISC, *of.at, of.radius_m, of.radius_m, 0.0)
    if isinstance(of, tables.RingTable):
        return Region(RING, *of.at, of.radius_m, of.radius_m, of.inner_radius_m)
    if isinstance(of, tables.RectangleTable):
        return Region(BOX, *of.at, 0.5 * of.size_m[0], 0.5 * of.size_m[1], 0.0)
    return Region(BOX, 0.0, 0.0, taken.half_x_m, taken.half_y_m, 0.0)


def _gap_m(of: PlaceTable) -> float:
    """How far robots keep apart at least."""
    return GAP_M if isinstance(of, OnGrid | AtPoses) else max(GAP_M, of.apart_m)


def _fixed(table: RobotsTable) -> FloatArray:
    """The only candidate of each robot, (count, 2), where the scenario gives it; else no rows."""
    if isinstance(table.place, AtPoses):
        return np.array(table.place.poses, np.float64)[:, :2].copy()
    if not isinstance(table.place, OnGrid):
        return np.empty((0, 2))
    columns = int(np.ceil(np.sqrt(table.count)))
    rows = -(-table.count // columns)
    i = np.arange(table.count, dtype=np.float64)
    x, y = i % columns - 0.5 * (columns - 1), i // columns - 0.5 * (rows - 1)
    return np.stack([x, y], axis=1) * table.place.spacing_m


def _headings(of: PlaceTable, group: Group, key: np.uint64) -> FloatArray:
    if isinstance(of, AtPoses):
        return wrapped(np.array(of.poses, np.float64)[:, 2])
    if of.heading_rad is not None:
        return wrapped(np.full(group.stop - group.start, of.heading_rad))
    keys: KeyArray = np.array(key, np.uint64)
    return np.pi - 2.0 * np.pi * uniform(keys, np.arange(group.start, group.stop), 0, 0, HEADING)
