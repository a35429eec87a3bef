"""The colours of an arena's floor as plain values; `geometry.ground` has them as arrays."""

import base64
import zlib
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import ByteArray


@dataclass(frozen=True, slots=True)
class Patch:
    """A patch of one shade: a disc has radius_m, a convex polygon points_m."""

    shape: str  #: "disc" | "polygon"
    x_m: float
    y_m: float
    shade: float  #: 0 black … 1 white
    radius_m: float = 0.0
    points_m: tuple[tuple[float, float], ...] = ()  #: counter-clockwise, around (x_m, y_m)


@dataclass(frozen=True, slots=True)
class FloorImage:
    """A grey picture that is stretched over the whole arena."""

    rows: int
    columns: int
    packed: str  #: the greys 0 … 255, row by row from the top, deflated, in base64

    @property
    def grey(self) -> ByteArray:
        """The greys, (rows, columns), 0 black … 255 white, top row first; ValueError if some are missing."""
        limit = self.rows * self.columns
        grey = zlib.decompressobj().decompress(base64.b64decode(self.packed), limit) if limit else b""
        return np.frombuffer(grey, np.uint8).reshape(self.rows, self.columns)


@dataclass(frozen=True, slots=True)
class Floor:
    """The floor of every arena: a shade, on it a picture, on it patches, of which the last wins."""

    shade: float = 1.0  #: 0 black … 1 white, where neither picture nor patch covers the floor
    patches: tuple[Patch, ...] = ()
    image: FloorImage | None = None


def packed_image(grey: ByteArray) -> FloorImage:
    """Return the picture of greys (rows, columns), top row first."""
    rows, columns = grey.shape
    return FloorImage(rows, columns, base64.b64encode(zlib.compress(grey.tobytes(), 6)).decode("ascii"))
