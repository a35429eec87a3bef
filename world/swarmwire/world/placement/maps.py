"""The layout that all arenas of a scenario share: size, obstacles of the map, floor.

`read_layout` builds the `Layout`. A map is a picture, or one of Nav2 (`nav2_map.py`). `merged_boxes` (compiled) merges
its occupied pixels into rectangles: few obstacles for engines, rays and the radio.
"""

from collections import Counter
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import AnyArray, BoolArray, IntArray
from swarmwire.comms.base.config import folder_of
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.geometry.floor import Floor, Patch, packed_image
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.base.kernels import njit
from swarmwire.world.placement.buildings import Buildings, read_buildings
from swarmwire.world.placement.nav2_map import Nav2Map, read_nav2_map
from swarmwire.world.placement.pictures import MAX_PIXELS, read_grey
from swarmwire.world.scenario.arena import ArenaTable, BuildingsTable, DiscPatchTable, GroundTable, MapTable

MAX_BOXES = 10_000
MAX_SIDE_M = 10_000.0

UNKNOWN = np.float32(205) / np.float32(255)  # map_saver and SLAM write unknown cells so (nav2_map_server, map_io.cpp)


def path_near_scenario(where: str, name: str) -> Path:
    """Return the path of a file that a scenario names, relative to the scenario's folder."""
    return folder_of(where) / name


def merged_boxes(occupied: BoolArray, max_boxes: int) -> IntArray:
    """Return rectangles that cover each occupied pixel (rows, columns) once and nothing else, (boxes, 4).

    A row is the first row, first column, rows and columns of a rectangle. From the first uncovered pixel in reading
    order grow two rectangles: as wide as possible and then as tall, and vice versa; the larger is added. The result has
    `max_boxes + 1` rows if more than `max_boxes` are needed.
    """
    return _merged(occupied.copy(), max_boxes)


@njit()
def _merged(uncovered: AnyArray, max_boxes: Any):
    boxes = np.empty((max_boxes + 1, 4), np.int64)
    count = 0
    for row in range(uncovered.shape[0]):
        for column in range(uncovered.shape[1]):
            if not uncovered[row, column]:
                continue
            if count > max_boxes:
                return boxes
            wide = _columns(uncovered, row, column, 1)
            rows_of_wide = _rows(uncovered, row, column, wide)
            tall = _rows(uncovered, row, column, 1)
            columns_of_tall = _columns(uncovered, row, column, tall)
            wider = rows_of_wide * wide >= tall * columns_of_tall
            rows, columns = (rows_of_wide, wide) if wider else (tall, columns_of_tall)
            uncovered[row : row + rows, column : column + columns] = False
            boxes[count] = row, column, rows, columns
            count += 1
    return boxes[:count]


@njit()
def _columns(uncovered: AnyArray, row: int, column: int, rows: int):
    """Return the number of columns from `column` on that are occupied in all of these rows."""
    columns = 0
    while column + columns < uncovered.shape[1] and uncovered[row : row + rows, column + columns].all():
        columns += 1
    return columns


@njit()
def _rows(uncovered: AnyArray, row: int, column: int, columns: Any):
    """Return the number of rows from `row` on that are occupied in all of these columns."""
    rows = 0
    while row + rows < uncovered.shape[0] and uncovered[row + rows, column : column + columns].all():
        rows += 1
    return rows


@dataclass(frozen=True, slots=True)
class Layout:
    """Size, map, buildings and floor, the same in every arena; other obstacles are not part of it."""

    size_m: tuple[float, float]
    obstacles: tuple[Obstacle, ...] = ()  # of the map and the buildings
    floor: Floor | None = None


def read_layout(arena: ArenaTable, where: str) -> Layout:
    """Return the layout that an arena's table describes; BadInput for pictures that are unreadable or do not fit."""
    size_m, obstacles = arena.size_m, ()
    if isinstance(arena.map, str):
        path = path_near_scenario(where, arena.map)
        size_m, obstacles = _place_map(read_nav2_map(path, where, "arena.map"), path, size_m, where)
    elif arena.map is not None:
        size_m, obstacles = _read_map(arena.map, size_m, where)
    if arena.buildings is not None:
        size_m, inside = _place_buildings(_buildings(arena.buildings, where), size_m, where)
        obstacles += inside
    assert size_m is not None  # checked by the table
    return Layout(size_m, obstacles, _read_floor(arena.ground, where) if arena.ground else None)


def layout_hints(arena: ArenaTable, where: str) -> list[str]:
    """Return a line about what a user may not expect of the map, and one about parts of a file that are left out."""
    hints: list[str] = []
    if isinstance(arena.map, MapTable) and arena.map.occupied_below <= UNKNOWN:
        greys = read_grey(path_near_scenario(where, arena.map.image), where, "arena.map.image")
        share = float(np.isclose(greys, UNKNOWN, rtol=0.0, atol=1e-4).mean())
        if share > 0.5:
            text = "is unknown (205 of 255) and free: occupied_below = 0.9 makes this obstacles"
            hints.append(f"{share:.0%} of arena.map {text}")
    if arena.buildings is not None and (left_out := _buildings(arena.buildings, where).left_out):
        hints.append(f"arena.buildings leaves out {_counted(left_out)}")
    return hints


def _read_map(
    table: MapTable, table_size_m: tuple[float, float] | None, where: str
) -> tuple[tuple[float, float], tuple[Obstacle, ...]]:
    """Return the size of the arena in m, and the boxes."""
    key, path = "arena.map.image", path_near_scenario(where, table.image)
    occupied = read_grey(path, where, key) < table.occupied_below
    rows, columns = occupied.shape
    size_m = columns * table.resolution_m, rows * table.resolution_m
    if table_size_m is not None and not np.allclose(table_size_m, size_m, rtol=1e-6, atol=0.0):
        size, got = (" x ".join(f"{side:g}" for side in sides) for sides in (size_m, table_size_m))
        raise BadInput(where, "arena.size_m", f"expected {size} m, the size of the map, or none; got {got} m")
    if max(size_m) > MAX_SIDE_M:
        raise BadInput(where, "arena.map.resolution_m", f"expected an arena of at most {MAX_SIDE_M:g} m a side")
    if occupied.all():
        expected = f"expected free space: no pixel is as bright as occupied_below = {table.occupied_below:g}"
        raise BadInput(where, key, f"{expected}: {path}")
    height_m = inf if table.height_m is None else table.height_m
    return size_m, _boxes(occupied, table.resolution_m, (0.0, 0.0, 0.0), height_m, (where, key))


def _place_map(
    grid: Nav2Map, path: Path, table_size_m: tuple[float, float] | None, where: str
) -> tuple[tuple[float, float], tuple[Obstacle, ...]]:
    """Return the size of the arena in m, by default that of the known cells, and boxes over all that is not free."""
    if not grid.free.any():
        raise BadInput(where, "arena.map", f"expected free cells: {path} has none")
    size_m = table_size_m or grid.known_size_m()
    if max(size_m) > MAX_SIDE_M or size_m[0] * size_m[1] > MAX_PIXELS * grid.resolution_m**2:
        expected = f"expected an arena of at most {MAX_SIDE_M:g} m a side and {MAX_PIXELS} cells"
        raise BadInput(where, "arena.map", f"{expected}, got {size_m[0]:g} x {size_m[1]:g} m: {path}")
    blocked, centre = grid.blocked(size_m)
    return size_m, _boxes(blocked, grid.resolution_m, centre, inf, (where, "arena.map"))


def _buildings(table: BuildingsTable, where: str) -> Buildings:
    path = path_near_scenario(where, table.file)
    return read_buildings(path, table.origin, table.height_m, (where, "arena.buildings"))


def _counted(left_out: Counter[str]) -> str:
    return ", ".join(f"{count} x {kind}" for kind, count in left_out.items())


def _place_buildings(
    file: Buildings, table_size_m: tuple[float, float] | None, where: str
) -> tuple[tuple[float, float], tuple[Obstacle, ...]]:
    """Return the size of the arena in m, by default one that holds all buildings, and those that reach into it."""
    buildings = file.obstacles
    if not buildings:
        raise BadInput(where, "arena.buildings", f"expected a file with buildings, got {_counted(file.left_out)}")
    low_m, high_m = (np.array(ends_m) for ends_m in zip(*(building.extent_m for building in buildings), strict=True))
    farthest_m = 2.0 * np.maximum(np.abs(low_m), np.abs(high_m)).max(axis=0)
    size_m = table_size_m or (round(float(farthest_m[0]), 6), round(float(farthest_m[1]), 6))
    if max(size_m) > MAX_SIDE_M:
        expected = f"expected size_m, or buildings within {0.5 * MAX_SIDE_M:g} m of the origin"
        raise BadInput(where, "arena.buildings", f"{expected}: the farthest is at {0.5 * farthest_m.max():g} m")
    half_m = 0.5 * np.array(size_m)
    reaching: BoolArray = np.all((low_m < half_m) & (high_m > -half_m), axis=1)
    inside = tuple(buildings[index] for index in np.flatnonzero(reaching))
    if not inside:
        expected = "expected buildings that reach into the arena; the origin is latitude, longitude"
        raise BadInput(where, "arena.buildings", expected)
    if len(inside) > MAX_BOXES:
        raise BadInput(where, "arena.buildings", f"expected at most {MAX_BOXES} convex parts, got {len(inside)}")
    return size_m, inside


def _boxes(
    occupied: BoolArray, side_m: float, centre: tuple[float, float, float], height_m: float, named_by: tuple[str, str]
) -> tuple[Obstacle, ...]:
    """Return boxes over the occupied pixels of a picture, the pose of whose centre is x, y in m and yaw in rad."""
    merged = merged_boxes(occupied, MAX_BOXES)
    if len(merged) > MAX_BOXES:
        expected = f"expected a map that makes at most {MAX_BOXES} boxes: make it coarser, or free of specks"
        raise BadInput(*named_by, expected)
    rows, columns = occupied.shape
    x_m, y_m, yaw_rad = centre
    c, s = portable.cos(yaw_rad), portable.sin(yaw_rad)
    boxes = list[Obstacle]()
    for row, column, tall, wide in merged.tolist():
        along_m, up_m = (column + 0.5 * wide - 0.5 * columns) * side_m, (0.5 * rows - row - 0.5 * tall) * side_m
        at_m = x_m + (c * along_m - s * up_m), y_m + (s * along_m + c * up_m)
        boxes.append(Obstacle("box", *at_m, yaw_rad, size_m=(wide * side_m, tall * side_m), height_m=height_m))
    return tuple(boxes)


def _read_floor(table: GroundTable, where: str) -> Floor:
    image = None
    if table.image is not None:
        grey = read_grey(path_near_scenario(where, table.image), where, "arena.ground.image")
        image = packed_image(np.round(255.0 * grey).astype(np.uint8))
    patches = (
        Patch("disc", *patch.at, patch.shade, radius_m=patch.radius_m)
        if isinstance(patch, DiscPatchTable)
        else Patch("polygon", *patch.at, patch.shade, points_m=patch.points)
        for patch in table.patches
    )
    return Floor(table.shade, tuple(patches), image)
