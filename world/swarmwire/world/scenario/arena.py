"""The tables of `[arena]`: size and boundary, obstacles, lights, a map, and the floor's colours.

The docstring below each key is its description in the JSON schema.
"""

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Discriminator, Field, StringConstraints, Tag, field_validator, model_validator
from pydantic_core import PydanticCustomError

from swarmwire.comms.base.geometry.shapes import Boundary
from swarmwire.world.scenario.schema import UNFIT, form_of
from swarmwire.world.scenario.tables import Extents, Gap, Heading, Length, Point, RegionTable, ScenarioTable

Corners = Annotated[tuple[Point, ...], Field(strict=False, json_schema_extra={"unit": "m"})]
Mass = Annotated[float, Field(gt=0, le=10_000, json_schema_extra={"unit": "kg"})]
Shade = Annotated[float, Field(ge=0, le=1)]
FileName = Annotated[str, StringConstraints(min_length=1)]
Corner = tuple[float, float]

MAX_POINTS = 100
NEEDS_MASS = "is missing; expected the mass of a movable obstacle (kg)"
NO_MASS = "expected a mass only with movable = true"


def counter_clockwise(points: Sequence[Corner]) -> tuple[Corner, ...]:
    """Return the corners of a convex polygon in counter-clockwise order; ValueError for other corners."""
    if not 3 <= len(points) <= MAX_POINTS:
        raise ValueError(f"expected 3 to {MAX_POINTS} points, got {len(points)}")
    corners = tuple(points) if _turn(points[0], points[1], points[2]) > 0.0 else tuple(reversed(points))
    for i, start in enumerate(corners):
        after = (i + 1) % len(corners)
        end = corners[after]
        for j, other in enumerate(corners):
            if j not in (i, after) and not _turn(start, end, other) > 0.0:
                raise ValueError(
                    "expected the corners of a convex polygon in order; "
                    f"({other[0]:g}, {other[1]:g}) lies on or beyond the side from "
                    f"({start[0]:g}, {start[1]:g}) to ({end[0]:g}, {end[1]:g})"
                )
    return corners


def _turn(a: Corner, b: Corner, c: Corner) -> float:
    """Return twice the area of the triangle a, b, c; positive if it is counter-clockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _convex(points: tuple[Point, ...]) -> tuple[Point, ...]:
    try:
        return counter_clockwise(points)
    except ValueError as error:
        raise PydanticCustomError("points", "{fault}", {"fault": str(error)}) from None


class _PositionedTable(ScenarioTable):
    """One object at a point, or several at random positions."""

    at: Point | None = None
    """Position of the only object, in the arena's frame."""
    place: Literal["random"] | None = None
    """"random": random positions in the arena, free of obstacles, by the seed."""
    count: int = Field(default=1, ge=1, le=100_000)
    """Number of objects; only with place = "random"."""
    within: RegionTable | None = None
    """Part of the arena for their centres; only with place = "random"."""
    apart_m: Gap = 0.0
    """Least gap to the surfaces of obstacles and of objects of the same kind; only with place = "random"."""

    @model_validator(mode="after")
    def _check_position(self) -> "_PositionedTable":
        if (self.at is None) == (self.place is None):
            raise PydanticCustomError("place", 'expected either at = [x, y] or place = "random"')
        if self.at is not None and self.count != 1:
            raise PydanticCustomError("place", 'expected place = "random" with a count; at = [x, y] sets only one')
        if self.at is not None and (self.within or self.apart_m):
            raise PydanticCustomError("place", 'expected place = "random" with within or apart_m, not at = [x, y]')
        return self


class _ObstacleTable(_PositionedTable):
    """An obstacle of any shape."""

    height_m: Length | None = None
    """Its height; default: infinite. Robots above it neither touch nor see it."""
    movable: bool = False
    """Whether robots can push it; it slides on the floor with friction. Only the pymunk engine moves obstacles."""
    mass_kg: Mass | None = None
    """Its mass; required for movable obstacles, and only for these."""

    @model_validator(mode="after")
    def _check_mass(self) -> "_ObstacleTable":
        if self.movable and self.mass_kg is None:
            raise PydanticCustomError(UNFIT, "{expected}", {"key": "mass_kg", "expected": NEEDS_MASS})
        if self.mass_kg is not None and not self.movable:
            raise PydanticCustomError(UNFIT, "{expected}", {"key": "mass_kg", "expected": NO_MASS})
        return self


class CylinderTable(_ObstacleTable):
    """A round obstacle."""

    shape: Literal["cylinder"]
    """Its shape."""
    radius_m: Length
    """Its radius."""


class _OrientedObstacleTable(_ObstacleTable):
    """An obstacle with a heading."""

    heading_rad: Heading | None = None
    """Counter-clockwise rotation; default: 0, or random with place = "random"."""


class BoxTable(_OrientedObstacleTable):
    """A rectangular obstacle."""

    shape: Literal["box"]
    """Its shape."""
    size_m: Extents
    """Full extents along and across its heading."""


class PolygonTable(_OrientedObstacleTable):
    """A convex obstacle with straight sides."""

    shape: Literal["polygon"]
    """Its shape."""
    points: Corners
    """Its corners in order, relative to the polygon's origin, which is the centre of rotation and lies at `at`."""

    _check_points = field_validator("points")(_convex)


ObstacleTable = CylinderTable | BoxTable | PolygonTable


class LightTable(_PositionedTable):
    """A light; it has no body, so robots can drive and start at its position."""

    intensity: Length
    """Its range: the brightness at d m is exp(-2 d / intensity), and 0 beyond 2.5 x intensity."""


class MapTable(ScenarioTable):
    """Obstacles from a picture, whose dark pixels are merged into boxes; its centre is the arena's."""

    image: FileName
    """The picture's file, relative to the scenario: PNG, PGM or the like. Its top is at the greatest y."""
    resolution_m: Length
    """Side of a pixel."""
    occupied_below: Annotated[float, Field(gt=0, le=1)] = 0.5
    """Pixels darker than this are obstacles, from 0 (black) to 1 (white)."""
    height_m: Length | None = None
    """Height of the obstacles; default: infinite."""


class BuildingsTable(ScenarioTable):
    """Obstacles from a file of buildings or of a simulator's world."""

    file: FileName
    """GeoJSON (.geojson, .json) or SDF (.sdf, .world), relative to the scenario."""
    origin: Annotated[tuple[float, float], Field(strict=False)] | None = None
    """Latitude and longitude in degrees of the arena's origin, for GeoJSON; default: its coordinates are in m."""
    height_m: Length | None = None
    """Height of buildings for which GeoJSON has neither height nor building:levels; default: infinite."""


MapForms = Annotated[Annotated[FileName, Tag("string")] | Annotated[MapTable, Tag("object")], Discriminator(form_of)]


class DiscPatchTable(ScenarioTable):
    """A round patch."""

    shape: Literal["disc"]
    """Its shape."""
    at: Point
    """Its centre."""
    radius_m: Length
    """Its radius."""
    shade: Shade
    """Its brightness, from 0 (black) to 1 (white)."""


class PolygonPatchTable(ScenarioTable):
    """A convex patch with straight sides."""

    shape: Literal["polygon"]
    """Its shape."""
    at: Point = (0.0, 0.0)
    """Position of the polygon's origin."""
    points: Corners
    """Its corners in order, relative to the polygon's origin."""
    shade: Shade
    """Its brightness, from 0 (black) to 1 (white)."""

    _check_points = field_validator("points")(_convex)


PatchTable = Annotated[DiscPatchTable | PolygonPatchTable, Field(discriminator="shape")]


class GroundTable(ScenarioTable):
    """The floor's shades of grey, from bottom to top: one shade, a picture, patches."""

    shade: Shade = 1.0
    """Brightness of the floor without picture and patches, from 0 (black) to 1 (white)."""
    image: FileName | None = None
    """A picture's file, relative to the scenario, stretched over the arena; its top is at the greatest y."""
    patches: tuple[PatchTable, ...] = Field(default=(), strict=False)
    """Patches; later ones cover earlier ones."""


class ArenaTable(ScenarioTable):
    """[arena]: a bounded plane with obstacles, lights and a floor; the origin is its centre."""

    size_m: Extents | None = None
    """Full extents along x and y; default: the map's, for one of Nav2 those of its known cells, else the buildings'."""
    boundary: Boundary = "walls"
    """Walls that bodies hit and sensors see; nothing; or a torus: opposite sides meet, for bodies without contacts."""
    obstacles: tuple[Annotated[ObstacleTable, Field(discriminator="shape")], ...] = Field(default=(), strict=False)
    """Objects that bodies hit, sensors see and that block radio signals."""
    lights: tuple[LightTable, ...] = Field(default=(), strict=False)
    """Lights that sensors see."""
    map: MapForms | None = None
    """More obstacles: the YAML file of a Nav2 map, relative to the scenario, or the table of a picture."""
    buildings: BuildingsTable | None = None
    """More obstacles, from a file of buildings."""
    ground: GroundTable | None = None
    """The floor; default: white."""

    @model_validator(mode="after")
    def _check_size(self) -> "ArenaTable":
        if self.size_m is None and self.map is None and self.buildings is None:
            expected = "is missing; expected a list of 2 numbers above 0 and at most 10000 (m), a map or buildings"
            raise PydanticCustomError(UNFIT, "{expected}", {"key": "size_m", "expected": expected})
        return self
