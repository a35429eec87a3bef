"""What is the same in every arena of a scenario: its size, the obstacles of its map, its floor."""

from dataclasses import dataclass
from math import inf

import numpy as np

from swarmwire.comms.errors import BadInput
from swarmwire.comms.geometry.floor import Floor, Patch, packed_image
from swarmwire.comms.truth import Obstacle
from swarmwire.world.placement.grey_image import beside, read_grey
from swarmwire.world.placement.merged_boxes import merged_boxes
from swarmwire.world.scenario.arena_tables import ArenaTable, DiscPatchTable, GroundTable, MapTable

MOST_BOXES = 10_000
LONGEST_M = 10_000.0


@dataclass(frozen=True, slots=True)
class Layout:
    """Size, obstacles and floor of every arena; obstacles at random are each arena's own."""

    size_m: tuple[float, float]
    boxes: tuple[Obstacle, ...] = ()  # of the map
    floor: Floor | None = None


def read_layout(arena: ArenaTable, where: str) -> Layout:
    """The layout that an arena's table describes; BadInput for pictures that cannot be read, or do not fit."""
    size_m, boxes = arena.size_m, ()
    if arena.map is not None:
        size_m, boxes = _read_map(arena.map, size_m, where)
    assert size_m is not None  # the table sees to it
    return Layout(size_m, boxes, _read_floor(arena.ground, where) if arena.ground else None)


def _read_map(
    table: MapTable, wanted_m: tuple[float, float] | None, where: str
) -> tuple[tuple[float, float], tuple[Obstacle, ...]]:
    """Size of the arena in m, and boxes."""
    key, path = "arena.map.image", beside(where, table.image)
    occupied = read_grey(path, where, key) < table.occupied_below
    rows, columns = occupied.shape
    size_m = columns * table.resolution_m, rows * table.resolution_m
    if wanted_m is not None and not np.allclose(wanted_m, size_m, rtol=1e-6, atol=0.0):
        size, got = (" x ".join(f"{side:g}" for side in sides) for sides in (size_m, wanted_m))
        raise BadInput(where, "arena.size_m", f"expected {size} m, the size of the map, or none; got {got} m")
    if max(size_m) > LONGEST_M:
        raise BadInput(where, "arena.map.resolution_m", f"expected an arena of at most {LONGEST_M:g} m a side")
    if occupied.all():
        expected = f"expected free space: no pixel is as bright as occupied_below = {table.occupied_below:g}"
        raise BadInput(where, key, f"{expected}: {path}")
    merged = merged_boxes(occupied, MOST_BOXES)
    if len(merged) > MOST_BOXES:
        expected = f"expected a picture that makes at most {MOST_BOXES} boxes: make it coarser, or free of specks"
        raise BadInput(where, key, f"{expected}: {path}")
    height_m, side_m = inf if table.height_m is None else table.height_m, table.resolution_m
    return size_m, tuple(
        Obstacle(
            "box",
            (column + 0.5 * wide - 0.5 * columns) * side_m,
            (0.5 * rows - row - 0.5 * tall) * side_m,
            size_m=(wide * side_m, tall * side_m),
            height_m=height_m,
        )
        for row, column, tall, wide in merged.tolist()
    )


def _read_floor(table: GroundTable, where: str) -> Floor:
    image = None
    if table.image is not None:
        grey = read_grey(beside(where, table.image), where, "arena.ground.image")
        image = packed_image(np.round(255.0 * grey).astype(np.uint8))
    patches = (
        Patch("disc", *patch.at, patch.shade, radius_m=patch.radius_m)
        if isinstance(patch, DiscPatchTable)
        else Patch("polygon", *patch.at, patch.shade, points_m=patch.points)
        for patch in table.patches
    )
    return Floor(table.shade, tuple(patches), image)
