"""[arena]: its size and boundary, and what stands, shines or is painted in it."""

from typing import Annotated, Literal

from pydantic import Field, StringConstraints, field_validator, model_validator
from pydantic_core import PydanticCustomError

from swarmwire.comms.truth import Boundary
from swarmwire.world.scenario.convex import counter_clockwise
from swarmwire.world.scenario.place_tables import RegionTable
from swarmwire.world.scenario.schema import UNFIT
from swarmwire.world.scenario.tables import Corners, Extents, Gap, Heading, Length, Mass, Point, Shade, Table

NEEDS_MASS = "is missing; expected the mass of what is movable (kg)"
NO_MASS = "expected a mass only with movable = true"
ImageFile = Annotated[str, StringConstraints(min_length=1)]


def _convex(points: tuple[Point, ...]) -> tuple[Point, ...]:
    try:
        return counter_clockwise(points)
    except ValueError as error:
        raise PydanticCustomError("points", "{fault}", {"fault": str(error)}) from None


class _StandingTable(Table):
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
    """Its height; taller than anything if left out. What is above it neither touches nor sees it."""
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


class MapTable(Table):
    """Obstacles from a picture, whose dark pixels are merged into boxes; its middle is the arena's."""

    image: ImageFile
    """The picture's file, beside the scenario: PNG, PGM or the like. Its top is at the greatest y."""
    resolution_m: Length
    """Side of a pixel."""
    occupied_below: Annotated[float, Field(gt=0, le=1)] = 0.5
    """Pixels darker than this are obstacles, from 0 (black) to 1 (white)."""
    height_m: Length | None = None
    """Height of the obstacles; taller than anything if left out."""


class DiscPatchTable(Table):
    """A round patch."""

    shape: Literal["disc"]
    """Its shape."""
    at: Point
    """Its centre."""
    radius_m: Length
    """Its radius."""
    shade: Shade
    """How bright it is, from 0 (black) to 1 (white)."""


class PolygonPatchTable(Table):
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


class GroundTable(Table):
    """The colour of the floor, in greys: one shade, on it a picture, on it patches."""

    shade: Shade = 1.0
    """How bright the floor is where neither picture nor patch covers it, from 0 (black) to 1 (white)."""
    image: ImageFile | None = None
    """A picture's file, beside the scenario, stretched over the whole arena; its top is at the greatest y."""
    patches: tuple[PatchTable, ...] = Field(default=(), strict=False)
    """Patches, of which the last covers those before it."""


class ArenaTable(Table):
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
