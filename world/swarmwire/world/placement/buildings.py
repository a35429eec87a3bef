"""Buildings of a GeoJSON or SDF file as obstacles.

Obstacles are cylinders and convex polygons. `convex_parts` divides other footprints, also with holes, along a
constrained Delaunay triangulation, without a change of their outline.
"""

import math
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from swarmwire.comms.base.config import from_json
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.extras import MAPS
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.world.motion.traces.emane import Geodetic, to_local
from swarmwire.world.placement import sdf

LEVEL_M = 3.0  # height of a storey where OpenStreetMap has building:levels alone
SDF_SUFFIXES = (".sdf", ".world")

Footprint = tuple[Any, float]  # a polygon or several, and the height in m
LEAST_SIDE_M = 0.1  # 0.1 degrees are 10 km

Corner = tuple[float, float]
Corners = list[Corner]  # of a polygon, counter-clockwise


@dataclass(frozen=True)
class Buildings:
    """The obstacles of a file, and the number of its things that are none, by kind."""

    obstacles: tuple[Obstacle, ...]
    left_out: Counter[str]


def read_buildings(
    path: Path, origin: tuple[float, float] | None, height_m: float | None, named_by: tuple[str, str]
) -> Buildings:
    """Read a file of buildings; BadInput for a file that is missing or unreadable names `named_by`.

    `origin` is the latitude and longitude of the arena's origin; without it coordinates are in m. `height_m` is that of
    buildings whose height the file does not have; None: infinite.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(*named_by, f"expected a readable file: {path}: {error}") from None
    if path.suffix.lower() in SDF_SUFFIXES:
        if origin is not None:
            raise BadInput(*named_by, f"expected no origin: coordinates of SDF are in m: {path}")
        return Buildings(*sdf.read_models(text, str(path)))
    MAPS.need("arena.buildings")
    left_out: Counter[str] = Counter()
    obstacles: list[Obstacle] = []
    for number, (polygon, top_m) in enumerate(_footprints(text, str(path), origin, height_m, left_out)):
        if not polygon.is_valid or polygon.is_empty:
            expected = f"expected a polygon that does not cross itself: {_fault(polygon)}"
            raise BadInput(str(path), f"polygon {number}", expected)
        left, bottom, right, top = polygon.bounds
        if origin is None and max(right - left, top - bottom) < LEAST_SIDE_M:
            expected = (
                "expected arena.buildings.origin with coordinates in degrees: in m it is too small for a building"
            )
            raise BadInput(str(path), f"polygon {number}", expected)
        obstacles += [_obstacle(part, top_m) for part in convex_parts(polygon)]
    return Buildings(tuple(obstacles), left_out)


def _fault(polygon: Any) -> str:
    from shapely import is_valid_reason

    return str(cast("Any", is_valid_reason(polygon)))


def _footprints(
    text: str, where: str, origin: tuple[float, float] | None, height_m: float | None, left_out: Counter[str]
) -> Iterator[Footprint]:
    """Return the polygons of a GeoJSON text: those with a property `building`, or all if none has one."""
    from shapely import transform
    from shapely.errors import ShapelyError
    from shapely.geometry import shape

    try:
        content: Any = from_json(text)
        features: list[Any] = content["features"] if content["type"] == "FeatureCollection" else [content]
        tables = [_tags(feature) for feature in features]
        is_osm = any(tags.get("building") for tags in tables)
        for feature, tags in zip(features, tables, strict=True):
            geometry = shape(feature["geometry"])
            if geometry.geom_type not in ("Polygon", "MultiPolygon"):
                left_out[geometry.geom_type] += 1
            elif is_osm and not tags.get("building"):
                left_out["polygon without a building"] += 1
            else:
                if origin is not None:
                    geometry = transform(geometry, lambda points: _local(points, origin))
                yield geometry, _height_m(tags, height_m)
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError, ShapelyError) as error:
        raise BadInput(where, "", f"expected GeoJSON with polygons: {error}") from None


def _tags(feature: dict[str, Any]) -> dict[str, Any]:
    """Return a feature's properties, and those that some exporters of OpenStreetMap put into `tags`."""
    properties: dict[str, Any] = feature.get("properties") or {}
    tags: Any = properties.get("tags")
    return {**properties, **tags} if isinstance(tags, dict) else properties


def _local(points: Any, origin: tuple[float, float]) -> Any:
    """Return longitudes and latitudes (n, 2) as x and y in m, on the plane that touches the ellipsoid at the origin."""
    longitude_deg, latitude_deg = points[:, 0], points[:, 1]
    east, north, _ = to_local(Geodetic(latitude_deg, longitude_deg, 0.0), Geodetic(*origin, 0.0))
    return np.column_stack([east, north])


def _height_m(tags: dict[str, Any], default_m: float | None) -> float:
    """Return the height in OpenStreetMap's tags: `height` in m, else `building:levels`, else the default."""
    for key, unit_m in (("height", 1.0), ("building:levels", LEVEL_M)):
        match = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*m?\s*", str(tags.get(key, "")))
        if match and float(match[1]) > 0.0:
            return float(match[1]) * unit_m
    return math.inf if default_m is None else default_m


def convex_parts(polygon: Any) -> list[Any]:
    """Return convex polygons that cover a valid polygon, or several, with their holes left open.

    Triangles are joined across each side between two of them as long as the result is convex (Hertel and Mehlhorn,
    1983): at most four times as many parts as are necessary.
    """
    from shapely import constrained_delaunay_triangles
    from shapely.geometry import Polygon
    from shapely.geometry.polygon import orient

    triangles = cast("Any", constrained_delaunay_triangles(polygon))
    corners: list[Corners] = [
        [(x, y) for x, y, *_ in orient(triangle, 1.0).exterior.coords[:-1]] for triangle in triangles.geoms
    ]
    owner = {side: part for part, points in enumerate(corners) for side in _sides(points)}
    for start, end in list(owner):
        left, right = owner.get((start, end)), owner.get((end, start))
        if left is None or right is None:  # a side of the outline, or joined already
            continue
        joined = [*_from(corners[left], end), *_from(corners[right], start)[1:-1]]
        if all(_turn(joined, joined.index(corner)) >= 0.0 for corner in (start, end)):
            corners[left], corners[right] = joined, []
            owner |= dict.fromkeys(_sides(joined), left)
            del owner[start, end], owner[end, start]
    return [Polygon(points).convex_hull for points in corners if points]  # without corners on a straight side


def _sides(points: Corners) -> list[tuple[Corner, Corner]]:
    return list(zip(points, points[1:] + points[:1], strict=True))


def _from(points: Corners, first: Corner) -> Corners:
    """Return the corners in the same order, from this one on."""
    index = points.index(first)
    return points[index:] + points[:index]


def _turn(points: Corners, i: int) -> float:
    """Return twice the area of the triangle at corner i; positive where the polygon is convex there."""
    (ax, ay), (bx, by), (cx, cy) = points[i - 1], points[i], points[(i + 1) % len(points)]
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


def _obstacle(part: Any, top_m: float) -> Obstacle:
    from shapely.geometry.polygon import orient

    corners = np.array(orient(part, 1.0).exterior.coords)[:-1]
    x_m, y_m = (float(middle) for middle in corners.mean(axis=0))
    points_m = tuple((float(x) - x_m, float(y) - y_m) for x, y in corners)
    return Obstacle("polygon", x_m, y_m, points_m=points_m, height_m=top_m)
