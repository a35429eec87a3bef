"""Where things stand at the start of an arena: fixed obstacles, then random ones, lights and robots, in file order.

Candidate j of a thing is a draw keyed by the arena, the thing and j; it takes the first candidate that is free. So a
robot's place depends on its arena's seed and on what was put before it, never on what comes after. Lights have no body:
they keep clear of obstacles, and nothing keeps clear of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray, KeyArray
from swarmwire.comms.draws import purpose, uniform
from swarmwire.comms.errors import BadInput
from swarmwire.comms.geometry import obstacle_arrays
from swarmwire.comms.grid import MOST_CELLS_PER_SIDE
from swarmwire.comms.truth import Group, Light, Obstacle
from swarmwire.world.angles import wrapped
from swarmwire.world.free_places import GAP_M, MOST_CANDIDATES, Region, Taken, free_circle, free_polygon, put_robots
from swarmwire.world.obstacles import heading_of, obstacle_at
from swarmwire.world.scenario import AtPoses, CylinderTable, InDisc, ObstacleTable, OnGrid, RobotsTable, Scenario

ROBOT, HEADING = purpose("place of a robot"), purpose("heading of a robot")
TRIED = f"none of {MOST_CANDIDATES} places tried is free"


@dataclass(frozen=True, slots=True)
class Placed:
    """Where everything of one arena stands at the start."""

    obstacles: tuple[Obstacle, ...]  # in the file's order
    lights: tuple[Light, ...]  # in the file's order
    pose: FloatArray  # (robots, 3) x, y in m, heading in rad, in (-pi, pi]


def place(scenario: Scenario, groups: Sequence[Group], seed: int, key: np.uint64) -> Placed:
    """The obstacles, lights and robots of the arena with this seed and key; BadInput names what finds no room."""
    standing = _Standing(scenario)
    obstacles = _place_obstacles(scenario, standing, seed, key)
    lights = _place_lights(scenario, standing.taken(), seed, key)
    taken = standing.taken(groups)
    pose = np.empty((groups[-1].stop, 3))
    for group in groups:
        table = scenario.robots[group.name]
        fixed = _fixed(table)
        region, radius_m = _region(scenario, table), group.body.radius_m
        lost = put_robots(taken, region, fixed, key, ROBOT, group.start, group.stop, radius_m)
        if lost >= 0:
            i, why = lost - group.start, TRIED
            if len(fixed):
                why = f"at ({fixed[i, 0]:g}, {fixed[i, 1]:g}) it would stand outside or touch something"
            raise _no_room(scenario, f"robots.{group.name}.place", f"{group.name}-{i}", why, seed)
        pose[group.start : group.stop, 2] = _headings(table, group, key)
    pose[:, :2] = taken.robot[:, :2]
    return Placed(obstacles, lights, pose)


def _no_room(scenario: Scenario, key: str, what: str, why: str, seed: int) -> BadInput:
    return BadInput(scenario.source, key, f"no room for {what} with seed {seed}: {why}")


class _Standing:
    """The obstacles that stand in an arena so far, as arrays with room for all that will."""

    def __init__(self, scenario: Scenario) -> None:
        self._size_m = scenario.arena.size_m
        tables = scenario.arena.obstacles
        round_ones = [table.count for table in tables if isinstance(table, CylinderTable)]
        sides = [_sides(table) * table.count for table in tables]
        self._circle = np.empty((sum(round_ones), 3))
        self._side = np.empty((sum(sides), 5))
        self._side_start = np.zeros(sum(table.count for table in tables) + 1, np.int64)
        self._circles = self._polygons = 0

    def add(self, obstacle: Obstacle) -> Obstacle:
        """Note an obstacle."""
        shape = obstacle_arrays(((obstacle,),))
        if len(shape.circle):
            self._circle[self._circles] = shape.circle[0]
            self._circles += 1
        else:
            first = self._side_start[self._polygons]
            self._side[first : first + len(shape.side)] = shape.side
            self._polygons += 1
            self._side_start[self._polygons] = first + len(shape.side)
        return obstacle

    def taken(self, groups: Sequence[Group] = ()) -> Taken:
        """What kernels look at, with room to note the robots of these groups."""
        width, height = self._size_m
        widest = max((group.body.radius_m for group in groups), default=max(width, height))
        cell_m = max(2.0 * widest + GAP_M, max(width, height) / MOST_CELLS_PER_SIDE)
        head = np.full((int(np.ceil(height / cell_m)), int(np.ceil(width / cell_m))), -1, np.int64)
        robots = groups[-1].stop if groups else 0
        circle, side_start = self._circle[: self._circles], self._side_start[: self._polygons + 1]
        side = self._side[: side_start[-1]]
        follow = np.full(robots, -1, np.int64)
        return Taken(0.5 * width, 0.5 * height, circle, side_start, side, cell_m, head, follow, np.zeros((robots, 3)))


def _place_obstacles(scenario: Scenario, standing: _Standing, seed: int, key: np.uint64) -> tuple[Obstacle, ...]:
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


def _random_obstacle(table: ObstacleTable, taken: Taken, key: np.uint64, copy: int, of: int) -> Obstacle | None:
    heading, wanted = 0.0, heading_of(table)
    if isinstance(table, CylinderTable):
        x, y = free_circle(taken, _anywhere(taken), key, copy, of, table.radius_m)
    else:
        corners = obstacle_at(table, 0.0, 0.0, 0.0).corners_m
        wanted = np.nan if wanted is None else wanted
        x, y, heading = free_polygon(taken, _anywhere(taken), key, copy, of, corners, wanted)
    return obstacle_at(table, x, y, heading) if np.isfinite(x) else None


def _sides(table: ObstacleTable) -> int:
    return 0 if isinstance(table, CylinderTable) else len(obstacle_at(table, 0.0, 0.0, 0.0).corners_m)


def _anywhere(taken: Taken) -> Region:
    return Region(False, 0.0, 0.0, taken.half_x_m, taken.half_y_m)


def _place_lights(scenario: Scenario, taken: Taken, seed: int, key: np.uint64) -> tuple[Light, ...]:
    placed: list[Light] = []
    for i, table in enumerate(scenario.arena.lights):
        region = Region(False, *table.at, 0.0, 0.0) if table.at else _anywhere(taken)
        for copy in range(table.count):
            x, y = free_circle(taken, region, key, copy, purpose(f"place of light {i}"), 0.0)
            if not np.isfinite(x):
                why = f"at ({table.at[0]:g}, {table.at[1]:g}) it is outside or in an obstacle" if table.at else TRIED
                what = f"light {copy + 1} of {table.count}"
                raise _no_room(scenario, f"arena.lights.{i}", what, why, seed)
            placed.append(Light(x, y, table.intensity))
    return tuple(placed)


def _region(scenario: Scenario, table: RobotsTable) -> Region:
    if isinstance(table.place, InDisc):
        return Region(True, *table.place.at, table.place.radius_m, table.place.radius_m)
    width, height = scenario.arena.size_m
    return Region(False, 0.0, 0.0, 0.5 * width, 0.5 * height)


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


def _headings(table: RobotsTable, group: Group, key: np.uint64) -> FloatArray:
    if isinstance(table.place, AtPoses):
        return wrapped(np.array(table.place.poses, np.float64)[:, 2])
    keys: KeyArray = np.array(key, np.uint64)
    return np.pi - 2.0 * np.pi * uniform(keys, np.arange(group.start, group.stop), 0, 0, HEADING)
