"""The tables of a scenario's file below the top level: places, metrics and stop conditions, the arena.

The docstring below each key is its description in the JSON schema.
"""

from collections.abc import Sequence
from typing import Annotated, Any, Literal, get_args

from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    StringConstraints,
    Tag,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from swarmwire.comms.base.geometry.shapes import Boundary
from swarmwire.world.scenario.schema import TABLE, UNFIT, form_of


def _metres(**bounds: Any) -> Any:
    return Field(json_schema_extra={"unit": "m"}, **bounds)


Coordinate = Annotated[float, _metres(ge=-10_000, le=10_000)]
Length = Annotated[float, _metres(gt=0, le=10_000)]
Gap = Annotated[float, _metres(ge=0, le=10_000)]
Point = Annotated[tuple[Coordinate, Coordinate], Field(strict=False)]
Extents = Annotated[tuple[Length, Length], Field(strict=False)]
Heading = Annotated[float, Field(ge=-7, le=7, json_schema_extra={"unit": "rad"})]
Pose = Annotated[tuple[Coordinate, Coordinate, Heading], Field(strict=False)]
Corners = Annotated[tuple[Point, ...], Field(strict=False, json_schema_extra={"unit": "m"})]
Mass = Annotated[float, Field(gt=0, le=10_000, json_schema_extra={"unit": "kg"})]
Shade = Annotated[float, Field(ge=0, le=1)]


class ScenarioTable(BaseModel):
    """A table of the file."""

    model_config = TABLE


Corner = tuple[float, float]
MAX_POINTS = 100


def counter_clockwise(points: Sequence[Corner]) -> tuple[Corner, ...]:
    """The corners of a convex polygon in counter-clockwise order; ValueError names the fault of other corners."""
    if not 3 <= len(points) <= MAX_POINTS:
        raise ValueError(f"expected 3 to {MAX_POINTS} points, got {len(points)}")
    turned = tuple(points) if _turn(points[0], points[1], points[2]) > 0.0 else tuple(reversed(points))
    for i, start in enumerate(turned):
        after = (i + 1) % len(turned)
        end = turned[after]
        for j, other in enumerate(turned):
            if j not in (i, after) and not _turn(start, end, other) > 0.0:
                raise ValueError(
                    "expected the corners of a convex polygon in order; "
                    f"({other[0]:g}, {other[1]:g}) lies on or beyond the side from "
                    f"({start[0]:g}, {start[1]:g}) to ({end[0]:g}, {end[1]:g})"
                )
    return turned


def _turn(a: Corner, b: Corner, c: Corner) -> float:
    """Twice the area of the triangle a, b, c; positive if it is counter-clockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


class DiscTable(ScenarioTable):
    """Uniform in a disc."""

    how: Literal["disc"]
    """Uniform in a disc."""
    radius_m: Length
    """Radius of the disc in which the centres lie."""
    at: Point = (0.0, 0.0)
    """Centre of the disc."""


class RectangleTable(ScenarioTable):
    """Uniform in a rectangle."""

    how: Literal["box"]
    """Uniform in a rectangle."""
    size_m: Extents
    """Full extents along x and y of the rectangle in which the centres lie."""
    at: Point = (0.0, 0.0)
    """Centre of the rectangle."""


class RingTable(ScenarioTable):
    """Uniform in a ring."""

    how: Literal["ring"]
    """Uniform in a ring."""
    inner_radius_m: Length
    """Inner radius of the ring in which the centres lie."""
    radius_m: Length
    """Its outer radius."""
    at: Point = (0.0, 0.0)
    """Centre of the ring."""

    @model_validator(mode="after")
    def _not_inside_out(self) -> "RingTable":
        if self.inner_radius_m > self.radius_m:
            text = "expected an inner_radius_m of at most radius_m, {outer}; got {inner}"
            raise PydanticCustomError("place", text, {"outer": self.radius_m, "inner": self.inner_radius_m})
        return self


RegionTable = Annotated[DiscTable | RectangleTable | RingTable, Field(discriminator="how")]


class _Turned(ScenarioTable):
    """Robots that are placed, but not turned yet."""

    heading_rad: Heading | None = None
    """The heading of each of them; a random one each if left out."""


class _AtRandom(_Turned):
    """Robots at random places."""

    apart_m: Gap = 0.0
    """Least gap between the surface of each of them and those of obstacles, of robots put before and of one another."""


class InDisc(_AtRandom, DiscTable):
    """Uniform in a disc."""


class InBox(_AtRandom, RectangleTable):
    """Uniform in a rectangle."""


class InRing(_AtRandom, RingTable):
    """Uniform in a ring."""


class InArena(_AtRandom):
    """Uniform in the whole arena."""

    how: Literal["arena"]
    """Uniform in the whole arena."""


class OnGrid(_Turned):
    """In rows, as square as can be, around the origin."""

    how: Literal["grid"]
    """In rows, as square as can be, around the origin."""
    spacing_m: Length
    """Distance between neighbours in a row and between rows."""


class AtPoses(ScenarioTable):
    """At poses that are given."""

    how: Literal["poses"]
    """At poses that are given."""
    poses: tuple[Pose, ...] = Field(strict=False, min_length=1)
    """x, y and heading of each robot."""


RandomPlace = InDisc | InBox | InRing | InArena
PlaceTable = Annotated[RandomPlace | OnGrid | AtPoses, Field(discriminator="how")]


# The tables of `metrics` and `[stop]`. Only their form is checked here; the names and parameters of metrics are checked
# when the run is built.
Name = Annotated[str, StringConstraints(min_length=1)]
Comparison = Literal["at_least", "at_most", "above", "below"]
COMPARISONS: tuple[Comparison, ...] = get_args(Comparison)


class MetricTable(ScenarioTable):
    """A metric with parameters, which stand beside its name."""

    model_config = ConfigDict(extra="allow")

    metric: Name
    """Its name, or its class; its parameters stand beside it."""

    @property
    def params(self) -> dict[str, Any]:
        """The parameters that are given, by name."""
        return dict(self.model_extra or {})


class StopTable(ScenarioTable):
    """[stop]: a metric of an arena, compared with a number; the arena ends when that holds."""

    metric: Name
    """The metric's name; it is measured then, also if nothing lists it."""
    at_least: float | None = None
    """The arena ends when the metric is at least this; just one of the four comparisons is given."""
    at_most: float | None = None
    """When it is at most this."""
    above: float | None = None
    """When it is above this."""
    below: float | None = None
    """When it is below this."""
    hold_s: float = Field(default=0.0, ge=0, le=1e9, json_schema_extra={"unit": "s"})
    """How long that must hold, in every tick; with 0 the first tick in which it does is enough."""
    keep_running: bool = False
    """Whether the arena runs on to `duration_s`, so that other times and final values are not cut; only the time of
    stopping is recorded then."""

    @model_validator(mode="after")
    def _one_comparison(self) -> "StopTable":
        comparisons = [name for name in COMPARISONS if getattr(self, name) is not None]
        if len(comparisons) != 1:
            text = "expected just one of {all}; got {given}"
            raise PydanticCustomError(
                "stop", text, {"all": ", ".join(COMPARISONS), "given": " and ".join(comparisons) or "none"}
            )
        return self

    @property
    def comparison(self) -> tuple[Comparison, float]:
        """How the metric is compared, and with what."""
        return next((name, limit) for name in COMPARISONS if (limit := getattr(self, name)) is not None)


_Item = Annotated[Name, Tag("string")] | Annotated[MetricTable, Tag("object")]
MetricItem = Annotated[_Item, Discriminator(form_of)]

_Stops = Annotated[tuple[StopTable, ...], Field(strict=False), Tag("array")]
StopTables = Annotated[Annotated[StopTable, Tag("object")] | _Stops, Discriminator(form_of)]


NEEDS_MASS = "is missing; expected the mass of a movable obstacle (kg)"
NO_MASS = "expected a mass only with movable = true"
ImageFile = Annotated[str, StringConstraints(min_length=1)]


def _convex(points: tuple[Point, ...]) -> tuple[Point, ...]:
    try:
        return counter_clockwise(points)
    except ValueError as error:
        raise PydanticCustomError("points", "{fault}", {"fault": str(error)}) from None


class _StandingTable(ScenarioTable):
    """Where a thing stands: either one at a point, or several at random."""

    at: Point | None = None
    """Where the one thing stands, in the arena's frame."""
    place: Literal["random"] | None = None
    """"random": anywhere in the arena, free of obstacles, by the seed."""
    count: int = Field(default=1, ge=1, le=100_000)
    """How many; only with place = "random"."""
    within: RegionTable | None = None
    """The part of the arena in which their centres lie; only with place = "random"."""
    apart_m: Gap = 0.0
    """Least gap to the surfaces of its like that were put before and of obstacles; only with place = "random"."""

    @model_validator(mode="after")
    def _one_place(self) -> "_StandingTable":
        if (self.at is None) == (self.place is None):
            raise PydanticCustomError("place", 'expected either at = [x, y] or place = "random"')
        if self.at is not None and self.count != 1:
            raise PydanticCustomError("place", 'expected place = "random" with a count; at = [x, y] sets only one')
        if self.at is not None and (self.within or self.apart_m):
            raise PydanticCustomError("place", 'expected place = "random" with within or apart_m, not at = [x, y]')
        return self


class _ObstacleTable(_StandingTable):
    """An obstacle of any shape."""

    height_m: Length | None = None
    """Its height; default: taller than anything. Robots above it neither touch nor see it."""
    movable: bool = False
    """Whether robots can push it; it slides on the floor with friction. Only the pymunk engine moves obstacles."""
    mass_kg: Mass | None = None
    """Its mass; only of a movable obstacle, which needs one."""

    @model_validator(mode="after")
    def _weighs_something(self) -> "_ObstacleTable":
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


class _TurnedTable(_ObstacleTable):
    """An obstacle with a heading."""

    heading_rad: Heading | None = None
    """Counter-clockwise turn; 0 if left out, or a random one with place = "random"."""


class BoxTable(_TurnedTable):
    """A rectangular obstacle."""

    shape: Literal["box"]
    """Its shape."""
    size_m: Extents
    """Full extents along and across its heading."""


class PolygonTable(_TurnedTable):
    """A convex obstacle with straight sides."""

    shape: Literal["polygon"]
    """Its shape."""
    points: Corners
    """Its corners in order, around its own origin, which `at` puts somewhere and about which it turns."""

    _is_convex = field_validator("points")(_convex)


ObstacleTable = CylinderTable | BoxTable | PolygonTable


class LightTable(_StandingTable):
    """A light: it has no body, so that it neither holds robots back nor keeps them away from its place."""

    intensity: Length
    """How far it reaches: seen as exp(-2 d / intensity) at d m, and not at all beyond 2.5 of it."""


class MapTable(ScenarioTable):
    """Obstacles from a picture, whose dark pixels are merged into boxes; its middle is the arena's."""

    image: ImageFile
    """The picture's file, beside the scenario: PNG, PGM or the like. Its top is at the greatest y."""
    resolution_m: Length
    """Side of a pixel."""
    occupied_below: Annotated[float, Field(gt=0, le=1)] = 0.5
    """Pixels darker than this are obstacles, from 0 (black) to 1 (white)."""
    height_m: Length | None = None
    """Height of the obstacles; taller than anything if left out."""


class DiscPatchTable(ScenarioTable):
    """A round patch."""

    shape: Literal["disc"]
    """Its shape."""
    at: Point
    """Its centre."""
    radius_m: Length
    """Its radius."""
    shade: Shade
    """How bright it is, from 0 (black) to 1 (white)."""


class PolygonPatchTable(ScenarioTable):
    """A convex patch with straight sides."""

    shape: Literal["polygon"]
    """Its shape."""
    at: Point = (0.0, 0.0)
    """Where its own origin lies."""
    points: Corners
    """Its corners in order, around its own origin."""
    shade: Shade
    """How bright it is, from 0 (black) to 1 (white)."""

    _is_convex = field_validator("points")(_convex)


PatchTable = Annotated[DiscPatchTable | PolygonPatchTable, Field(discriminator="shape")]


class GroundTable(ScenarioTable):
    """The colour of the floor, in greys: one shade, on it a picture, on it patches."""

    shade: Shade = 1.0
    """How bright the floor is where neither picture nor patch covers it, from 0 (black) to 1 (white)."""
    image: ImageFile | None = None
    """A picture's file, beside the scenario, stretched over the whole arena; its top is at the greatest y."""
    patches: tuple[PatchTable, ...] = Field(default=(), strict=False)
    """Patches, of which the last covers those before it."""


class ArenaTable(ScenarioTable):
    """[arena]: a bounded plane and what stands in it; the origin is its centre."""

    size_m: Extents | None = None
    """Full extents along x and y; those of the map if left out."""
    boundary: Boundary = "walls"
    """Walls that bodies hit and sensors see; nothing; or a torus: opposite sides meet, for bodies without contacts."""
    obstacles: tuple[Annotated[ObstacleTable, Field(discriminator="shape")], ...] = Field(default=(), strict=False)
    """Fixed things that bodies hit, sensors see and radio signals are blocked by."""
    lights: tuple[LightTable, ...] = Field(default=(), strict=False)
    """Lights that sensors see."""
    map: MapTable | None = None
    """More obstacles, from a picture."""
    ground: GroundTable | None = None
    """The colour of the floor; white if left out."""

    @model_validator(mode="after")
    def _has_a_size(self) -> "ArenaTable":
        if self.size_m is None and self.map is None:
            expected = "is missing; expected a list of 2 numbers above 0 and at most 10000 (m), or a map"
            raise PydanticCustomError(UNFIT, "{expected}", {"key": "size_m", "expected": expected})
        return self
