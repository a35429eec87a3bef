"""The layout that all arenas of a scenario share: size, obstacles of the map image, floor.

`read_grey` reads an image file as grey values. `merged_boxes` (compiled) merges the occupied pixels of a map into
rectangles: few obstacles for engines, rays and the radio. `read_layout` builds the `Layout`.
"""

from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any
from warnings import catch_warnings, simplefilter

import numpy as np
from numpy.typing import NDArray

from swarmwire.comms.base.arrays import AnyArray, BoolArray, IntArray
from swarmwire.comms.base.config import folder_of
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.geometry.floor import Floor, Patch, packed_image
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.base.kernels import njit
from swarmwire.world.scenario.arena import ArenaTable, DiscPatchTable, GroundTable, MapTable

if TYPE_CHECKING:
    from PIL import Image

FORMATS = ("PNG", "PPM", "BMP", "JPEG", "GIF")  # PGM is one of PPM's family
MAX_PIXELS = 2**24
MAX_BOXES = 10_000
MAX_SIDE_M = 10_000.0

UNKNOWN = np.float32(205) / np.float32(255)  # map_saver and SLAM write unknown cells so (nav2_map_server, map_io.cpp)

GreyArray = NDArray[np.float32]


def path_near_scenario(where: str, name: str) -> Path:
    """Return the path of a file that a scenario names, relative to the scenario's folder."""
    return folder_of(where) / name


def read_grey(path: Path, where: str, key: str) -> GreyArray:
    """Return the grey values of a picture, (rows, columns), 0 black … 1 white, top row first, on a white background.

    BadInput names `where` and `key` for a file that is no image, or has more than `MAX_PIXELS`.
    """
    from PIL import Image

    too_large = BadInput(where, key, f"expected a picture of at most {MAX_PIXELS} pixels: {path}")
    try:
        with catch_warnings():
            simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(path, formats=FORMATS) as image:
                if image.width * image.height > MAX_PIXELS:
                    raise too_large
                return _greys(image)
    except FileNotFoundError:
        raise BadInput(where, key, f"expected a file beside the scenario: there is no {path}") from None
    except (Image.DecompressionBombWarning, Image.DecompressionBombError):
        raise too_large from None
    except (OSError, ValueError, SyntaxError, EOFError, IndexError):  # Pillow raises all of these for broken files
        raise BadInput(where, key, f"expected a picture, PNG, PGM, BMP, JPEG or GIF: {path}") from None


def _greys(image: "Image.Image") -> GreyArray:
    from PIL import Image

    if image.mode.startswith("I"):  # 16 bits a pixel
        return np.asarray(image, np.float32) / np.float32(65535)
    if image.has_transparency_data:
        white = Image.new("RGBA", image.size, "white")
        image = Image.alpha_composite(white, image.convert("RGBA"))
    return np.asarray(image.convert("L"), np.float32) / np.float32(255)


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
    """Size, map and floor, the same in every arena; random obstacles are not part of it."""

    size_m: tuple[float, float]
    boxes: tuple[Obstacle, ...] = ()  # obstacles of the map
    floor: Floor | None = None


def read_layout(arena: ArenaTable, where: str) -> Layout:
    """Return the layout that an arena's table describes; BadInput for pictures that are unreadable or do not fit."""
    size_m, boxes = arena.size_m, ()
    if arena.map is not None:
        size_m, boxes = _read_map(arena.map, size_m, where)
    assert size_m is not None  # checked by the table
    return Layout(size_m, boxes, _read_floor(arena.ground, where) if arena.ground else None)


def map_hint(arena: ArenaTable, where: str) -> str | None:
    """Return a line about a map whose unknown pixels, most of it, count as free, else None; see `read_layout`."""
    if arena.map is None or arena.map.occupied_below > UNKNOWN:
        return None
    greys = read_grey(path_near_scenario(where, arena.map.image), where, "arena.map.image")
    share = float(np.isclose(greys, UNKNOWN, rtol=0.0, atol=1e-4).mean())
    if share <= 0.5:
        return None
    return f"{share:.0%} of arena.map is unknown (205 of 255) and free: occupied_below = 0.9 makes this obstacles"


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
    merged = merged_boxes(occupied, MAX_BOXES)
    if len(merged) > MAX_BOXES:
        expected = f"expected a picture that makes at most {MAX_BOXES} boxes: make it coarser, or free of specks"
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
        grey = read_grey(path_near_scenario(where, table.image), where, "arena.ground.image")
        image = packed_image(np.round(255.0 * grey).astype(np.uint8))
    patches = (
        Patch("disc", *patch.at, patch.shade, radius_m=patch.radius_m)
        if isinstance(patch, DiscPatchTable)
        else Patch("polygon", *patch.at, patch.shade, points_m=patch.points)
        for patch in table.patches
    )
    return Floor(table.shade, tuple(patches), image)
