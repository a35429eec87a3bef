"""Where things stand at the start of an arena: fixed obstacles, then random ones, then robots, in the file's order.

Candidate j of a thing is a draw keyed by the arena, the thing and j; it takes the first candidate that is free. So a
robot's place depends on its arena's seed and on what was put before it, never on what comes after.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray, KeyArray
from swarmwire.comms.draws import purpose, uniform
from swarmwire.comms.errors import BadInput
from swarmwire.comms.geometry import obstacle_arrays
from swarmwire.comms.grid import MOST_CELLS_PER_SIDE
from swarmwire.comms.truth import Group, Obstacle
from swarmwire.world.angles import wrapped
from swarmwire.world.free_places import GAP_M, MOST_CANDIDATES, Region, Taken, free_box, free_circle, put_robots
from swarmwire.world.scenario import AtPoses, BoxTable, CylinderTable, InDisc, OnGrid, RobotsTable, Scenario

ROBOT, HEADING = purpose("place of a robot"), purpose("heading of a robot")
TRIED = f"none of {MOST_CANDIDATES} places tried is free"


@dataclass(frozen=True, slots=True)
class Placed:
    """Where everything of one arena stands at the start."""

    obstacles: tuple[Obstacle, ...]  # in the file's order
    pose: FloatArray  # (robots, 3) x, y in m, heading in rad, in (-pi, pi]


def place(scenario: Scenario, groups: Sequence[Group], seed: int, key: np.uint64) -> Placed:
    """The obstacles and robots of the arena with this seed and key; BadInput names what finds no room."""
    standing = _Standing(scenario)
    obstacles = _place_obstacles(scenario, standing, seed, key)
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
    return Placed(obstacles, pose)


def _no_room(scenario: Scenario, key: str, what: str, why: str, seed: int) -> BadInput:
    return BadInput(scenario.source, key, f"no room for {what} with seed {seed}: {why}")


class _Standing:
    """The obstacles that stand in an arena so far, as arrays with room for all that will."""

    def __init__(self, scenario: Scenario) -> None:
        self._size_m = scenario.arena.size_m
        tables = scenario.arena.obstacles
        self._circle = np.empty((sum(table.count for table in tables if table.shape == "cylinder"), 3))
        self._box = np.empty((sum(table.count for table in tables if table.shape == "box"), 6))
        self._circles = self._boxes = 0

    def add(self, obstacle: Obstacle) -> Obstacle:
        """Note an obstacle."""
        shape = obstacle_arrays(((obstacle,),))
        if len(shape.circle):
            self._circle[self._circles] = shape.circle[0]
            self._circles += 1
        else:
            self._box[self._boxes] = shape.box[0]
            self._boxes += 1
        return obstacle

    def taken(self, groups: Sequence[Group] = ()) -> Taken:
        """What kernels look at, with room to note the robots of these groups."""
        width, height = self._size_m
        widest = max((group.body.radius_m for group in groups), default=max(width, height))
        cell_m = max(2.0 * widest + GAP_M, max(width, height) / MOST_CELLS_PER_SIDE)
        head = np.full((int(np.ceil(height / cell_m)), int(np.ceil(width / cell_m))), -1, np.int64)
        robots = groups[-1].stop if groups else 0
        circle, box = self._circle[: self._circles], self._box[: self._boxes]
        follow = np.full(robots, -1, np.int64)
        return Taken(0.5 * width, 0.5 * height, circle, box, cell_m, head, follow, np.zeros((robots, 3)))


def _place_obstacles(scenario: Scenario, standing: _Standing, seed: int, key: np.uint64) -> tuple[Obstacle, ...]:
    tables = scenario.arena.obstacles
    placed = [[standing.add(_fixed_obstacle(table, *table.at))] if table.at else [] for table in tables]
    for i, table in enumerate(tables):
        for copy in range(table.count if table.at is None else 0):
            found = _random_obstacle(table, standing.taken(), key, copy, purpose(f"place of obstacle {i}"))
            if found is None:
                what = f"{table.shape} {copy + 1} of {table.count}"
                raise _no_room(scenario, f"arena.obstacles.{i}", what, TRIED, seed)
            placed[i].append(standing.add(found))
    return tuple(obstacle for some in placed for obstacle in some)


def _fixed_obstacle(table: CylinderTable | BoxTable, x_m: float, y_m: float) -> Obstacle:
    if isinstance(table, CylinderTable):
        return Obstacle("cylinder", x_m, y_m, radius_m=table.radius_m)
    return Obstacle("box", x_m, y_m, table.heading_rad or 0.0, size_m=table.size_m)


def _random_obstacle(
    table: CylinderTable | BoxTable, taken: Taken, key: np.uint64, copy: int, of: int
) -> Obstacle | None:
    anywhere = Region(False, 0.0, 0.0, taken.half_x_m, taken.half_y_m)
    if isinstance(table, CylinderTable):
        x, y = free_circle(taken, anywhere, key, copy, of, table.radius_m)
        return Obstacle("cylinder", x, y, radius_m=table.radius_m) if np.isfinite(x) else None
    half = 0.5 * table.size_m[0], 0.5 * table.size_m[1]
    wanted = np.nan if table.heading_rad is None else table.heading_rad
    x, y, heading = free_box(taken, anywhere, key, copy, of, *half, wanted)
    return Obstacle("box", x, y, heading, size_m=table.size_m) if np.isfinite(x) else None


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
