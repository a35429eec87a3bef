"""Maps of Nav2: a YAML file and a picture, read as nav2_map_server does (map_io.cpp of ros-navigation/navigation2).

`read_nav2_map` returns the cells as an OccupancyGrid has them: 0 free, 100 occupied, UNKNOWN, and in the modes "scale"
and "raw" numbers between. As in Nav2's costmap, only 100 is occupied and all below is free. The arena's frame is that
of the map: `known_size_m` and `blocked` lay an arena, whose centre is the frame's origin, over the cells.
"""

from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import yaml
from numpy.typing import NDArray

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import BoolArray, IntArray
from swarmwire.comms.base.config import converted
from swarmwire.comms.base.errors import BadInput
from swarmwire.world.placement.pictures import read_picture

if TYPE_CHECKING:
    from PIL import Image

FREE, OCCUPIED, UNKNOWN = 0, 100, -1
MODES = ("trinary", "scale", "raw")
MAX_ORIGIN = 1e6
TOUCH = 1e-4  # cells that reach less into the arena, as a share of their side, are left out

ByteArray = NDArray[np.uint8]
CellArray = NDArray[np.int8]


@dataclass(frozen=True)
class Nav2File:
    """The keys of the YAML file; others are ignored, as by nav2_map_server."""

    image: str
    resolution: float  #: side of a cell in m
    origin: tuple[float, float, float]  #: x, y in m and yaw in rad of the lower left corner, in the map's frame
    negate: bool | int
    occupied_thresh: float
    free_thresh: float
    mode: str = "trinary"


@dataclass(frozen=True)
class Nav2Map:
    """A map: its cells (rows, columns), top row first, their side in m, and the pose of the lower left corner."""

    cells: CellArray
    resolution_m: float
    origin: tuple[float, float, float]

    @property
    def free(self) -> BoolArray:
        """Cells in which robots can stand, (rows, columns)."""
        return (self.cells != UNKNOWN) & (self.cells < OCCUPIED)

    def known_size_m(self) -> tuple[float, float]:
        """Return the extents of the smallest rectangle around the frame's origin that holds all known cells."""
        row, column = np.nonzero(self.cells != UNKNOWN)
        x_m, y_m = self._at(column + 0.5, len(self.cells) - row - 0.5)
        half_m = (np.abs(ends_m).max() + self._half_cell_m() for ends_m in (x_m, y_m))
        width_m, height_m = (round(2.0 * float(half), 6) for half in half_m)
        return width_m, height_m

    def blocked(self, size_m: tuple[float, float]) -> tuple[BoolArray, tuple[float, float, float]]:
        """Return which cells of an arena are not free, top row first, and the pose of their centre.

        These are cells of the map and, beyond it, further ones of the same grid, which count as unknown.
        """
        half_m, (left_m, bottom_m, yaw_rad) = 0.5 * np.array(size_m), self.origin
        c, s = portable.cos(yaw_rad), portable.sin(yaw_rad)
        x_m, y_m = half_m[0] * np.array([-1, 1, 1, -1]) - left_m, half_m[1] * np.array([-1, -1, 1, 1]) - bottom_m
        corners = np.stack([c * x_m + s * y_m, c * y_m - s * x_m]) / self.resolution_m  # of the arena, in cells
        first, low = (int(end) for end in np.floor(corners.min(axis=1) + TOUCH))
        last, high = (int(end) for end in np.ceil(corners.max(axis=1) - TOUCH))
        column: IntArray = np.arange(first, last)
        up: IntArray = np.arange(low, high)[::-1]
        row = len(self.cells) - 1 - up
        blocked = np.ones((len(row), len(column)), np.bool_)
        rows, columns = (row >= 0) & (row < len(self.cells)), (column >= 0) & (column < self.cells.shape[1])
        blocked[np.ix_(rows, columns)] = ~self.free[np.ix_(row[rows], column[columns])]
        x_m, y_m = self._at(column + 0.5, up[:, None] + 0.5)
        reach_m = half_m + self._half_cell_m()
        blocked &= (np.abs(x_m) < reach_m[0]) & (np.abs(y_m) < reach_m[1])
        x_m, y_m = self._at(0.5 * (first + last), 0.5 * (low + high))
        return blocked, (float(x_m), float(y_m), yaw_rad)

    def _at(self, column: Any, up: Any) -> tuple[Any, Any]:
        """Return the position in m of points of the grid, in cells from its lower left corner."""
        left_m, bottom_m, yaw_rad = self.origin
        c, s = portable.cos(yaw_rad), portable.sin(yaw_rad)
        along_m, up_m = column * self.resolution_m, up * self.resolution_m
        return left_m + (c * along_m - s * up_m), bottom_m + (s * along_m + c * up_m)

    def _half_cell_m(self) -> float:
        """Return half the extent of a cell along x and along y."""
        yaw_rad = self.origin[2]
        return 0.5 * self.resolution_m * (abs(portable.cos(yaw_rad)) + abs(portable.sin(yaw_rad)))


def read_nav2_file(path: Path, where: str, key: str) -> Nav2File:
    """Read the YAML file; BadInput names `where` and `key` if it is missing, else the file and its own key."""
    try:
        content: object = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadInput(where, key, f"expected a readable file: {path}: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        raise BadInput(where, key, f"expected YAML: {path}: {' '.join(str(error).split())}") from None
    if not isinstance(content, dict):
        raise BadInput(where, key, f"expected a YAML file with image, resolution, origin, …: {path}")
    file = converted(
        Nav2File, cast("object", content), str(path), strict=False
    )  # yaml-cpp also reads 1e-2 and "0.05" as numbers
    if not (isfinite(file.resolution) and file.resolution > 0.0):
        raise BadInput(str(path), "resolution", f"expected the side of a cell above 0 m, got {file.resolution!r}")
    if not all(abs(number) <= MAX_ORIGIN for number in file.origin):
        raise BadInput(str(path), "origin", f"expected x and y in m and yaw in rad, got {file.origin!r}")
    if file.mode.lower() not in MODES:
        raise BadInput(str(path), "mode", f"expected one of {', '.join(MODES)}, got {file.mode!r}")
    return file


def read_nav2_map(path: Path, where: str, key: str) -> Nav2Map:
    """Read a map from its YAML file and picture; BadInput as in `read_nav2_file`."""
    file = read_nav2_file(path, where, key)
    grey, opaque = read_picture(path.parent / file.image, str(path), "image", _grey_and_opaque)
    return Nav2Map(_cells(file, grey, opaque), file.resolution, file.origin)


def _grey_and_opaque(image: "Image.Image") -> tuple[ByteArray, BoolArray]:
    """Return the grey values, of 8 bits and without regard to transparency, and which pixels are opaque.

    Weights and rounding are those of GraphicsMagick, which nav2_map_server uses: grey values of 16 bits, rounded, of
    which 8 bits are left, rounded down.
    """
    if image.mode.startswith("I"):  # 16 bits a pixel
        wide = np.asarray(image, np.int64)
        return (wide // 257).astype(np.uint8), np.ones(wide.shape, np.bool_)
    colors = np.asarray(image.convert("RGBA"), np.int64)  # an image without transparency becomes opaque
    wide = (257 * (colors[..., :3] @ np.array([299, 587, 114])) + 500) // 1000
    return (wide // 257).astype(np.uint8), colors[..., 3] == 255


def _cells(file: Nav2File, grey: ByteArray, opaque: BoolArray) -> CellArray:
    if file.mode.lower() == "raw":
        return np.where(grey <= OCCUPIED, grey, UNKNOWN).astype(np.int8)
    shade = grey.astype(np.float32) / np.float32(255)  # single precision, as there
    occupancy = shade if file.negate else np.float32(1) - shade
    low, high = np.float32(file.free_thresh), np.float32(file.occupied_thresh)
    between = np.full(grey.shape, UNKNOWN, np.float32)
    if file.mode.lower() == "scale" and high > low:
        between = np.floor((occupancy - low) / np.float32(file.occupied_thresh - file.free_thresh) * 100 + 0.5)
    cells = np.where(occupancy <= low, FREE, np.where(occupancy >= high, OCCUPIED, between))
    return np.where(opaque, cells, UNKNOWN).astype(np.int8)
