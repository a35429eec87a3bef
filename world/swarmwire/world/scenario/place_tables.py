"""Where things stand at the start: in a region, at random and apart from one another, in rows, or at given poses."""

from typing import Annotated, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from swarmwire.world.scenario.tables import Extents, Gap, Heading, Length, Point, Pose, Table


class Disc(Table):
    """Uniform in a disc."""

    how: Literal["disc"]
    """Uniform in a disc."""
    radius_m: Length
    """Radius of the disc in which the centres lie."""
    at: Point = (0.0, 0.0)
    """Centre of the disc."""


class Box(Table):
    """Uniform in a rectangle."""

    how: Literal["box"]
    """Uniform in a rectangle."""
    size_m: Extents
    """Full extents along x and y of the rectangle in which the centres lie."""
    at: Point = (0.0, 0.0)
    """Centre of the rectangle."""


class Ring(Table):
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
    def _not_inside_out(self) -> "Ring":
        if self.inner_radius_m > self.radius_m:
            text = "expected an inner_radius_m of at most radius_m, {outer}; got {inner}"
            raise PydanticCustomError("place", text, {"outer": self.radius_m, "inner": self.inner_radius_m})
        return self


RegionTable = Annotated[Disc | Box | Ring, Field(discriminator="how")]


class _Turned(Table):
    """Robots that are placed, but not turned yet."""

    heading_rad: Heading | None = None
    """The heading of each of them; a random one each if left out."""


class _AtRandom(_Turned):
    """Robots at random places."""

    apart_m: Gap = 0.0
    """Least gap between the surface of each of them and those of obstacles, of robots put before and of one another."""


class InDisc(_AtRandom, Disc):
    """Uniform in a disc."""


class InBox(_AtRandom, Box):
    """Uniform in a rectangle."""


class InRing(_AtRandom, Ring):
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


class AtPoses(Table):
    """At poses that are given."""

    how: Literal["poses"]
    """At poses that are given."""
    poses: tuple[Pose, ...] = Field(strict=False, min_length=1)
    """x, y and heading of each robot."""


RandomPlace = InDisc | InBox | InRing | InArena
PlaceTable = Annotated[RandomPlace | OnGrid | AtPoses, Field(discriminator="how")]
