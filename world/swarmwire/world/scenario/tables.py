"""The tables of robots' placement, of metrics and of stop conditions, and the base of all tables of a scenario.

The docstring below each key is its description in the JSON schema.
"""

from typing import Annotated, Any, Literal, get_args

from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    StringConstraints,
    Tag,
    model_validator,
)
from pydantic_core import PydanticCustomError

from swarmwire.world.scenario.schema import TABLE, form_of


def _metres(**bounds: Any) -> Any:
    return Field(json_schema_extra={"unit": "m"}, **bounds)


Coordinate = Annotated[float, _metres(ge=-10_000, le=10_000)]
Length = Annotated[float, _metres(gt=0, le=10_000)]
Gap = Annotated[float, _metres(ge=0, le=10_000)]
Point = Annotated[tuple[Coordinate, Coordinate], Field(strict=False)]
Extents = Annotated[tuple[Length, Length], Field(strict=False)]
Heading = Annotated[float, Field(ge=-7, le=7, json_schema_extra={"unit": "rad"})]
Pose = Annotated[tuple[Coordinate, Coordinate, Heading], Field(strict=False)]


class ScenarioTable(BaseModel):
    """A table of the file."""

    model_config = TABLE


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
    def _check_radii(self) -> "RingTable":
        if self.inner_radius_m > self.radius_m:
            text = "expected an inner_radius_m of at most radius_m, {outer}; got {inner}"
            raise PydanticCustomError("place", text, {"outer": self.radius_m, "inner": self.inner_radius_m})
        return self


RegionTable = Annotated[DiscTable | RectangleTable | RingTable, Field(discriminator="how")]


class _PositionTable(ScenarioTable):
    """Positions of robots; they have the same heading or random ones."""

    heading_rad: Heading | None = None
    """Heading of all robots; default: random."""


class _RandomPositionTable(_PositionTable):
    """Random positions of robots."""

    apart_m: Gap = 0.0
    """Least gap between the surfaces of a robot and of obstacles, robots of earlier groups and one another."""


class InDisc(_RandomPositionTable, DiscTable):
    """Uniform in a disc."""


class InBox(_RandomPositionTable, RectangleTable):
    """Uniform in a rectangle."""


class InRing(_RandomPositionTable, RingTable):
    """Uniform in a ring."""


class InArena(_RandomPositionTable):
    """Uniform in the arena."""

    how: Literal["arena"]
    """Uniform in the arena."""


class OnGrid(_PositionTable):
    """A grid around the origin, as square as possible."""

    how: Literal["grid"]
    """A grid around the origin, as square as possible."""
    spacing_m: Length
    """Distance between neighbours in a row and between rows."""


class AtPoses(ScenarioTable):
    """Listed poses."""

    how: Literal["poses"]
    """Listed poses."""
    poses: tuple[Pose, ...] = Field(strict=False, min_length=1)
    """x, y and heading of each robot."""


PlacementTable = Annotated[InDisc | InBox | InRing | InArena | OnGrid | AtPoses, Field(discriminator="how")]


# The tables of `metrics` and `[stop]` check only their form: names and parameters of metrics are checked when the run
# is built.
Name = Annotated[str, StringConstraints(min_length=1)]
Comparison = Literal["at_least", "at_most", "above", "below"]
COMPARISONS: tuple[Comparison, ...] = get_args(Comparison)


class MetricTable(ScenarioTable):
    """A metric with parameters, which are further keys of its table."""

    model_config = ConfigDict(extra="allow")

    metric: Name
    """Its name or its class; its parameters are further keys."""

    @property
    def params(self) -> dict[str, Any]:
        """The parameters in the table, by name."""
        return dict(self.model_extra or {})


class StopTable(ScenarioTable):
    """[stop]: the arena ends when a comparison of a metric with a number holds."""

    metric: Name
    """The metric's name; it is measured even if `metrics` does not list it."""
    at_least: float | None = None
    """The arena ends when the metric is at least this; exactly one of the four comparisons is required."""
    at_most: float | None = None
    """The arena ends when the metric is at most this."""
    above: float | None = None
    """The arena ends when the metric is above this."""
    below: float | None = None
    """The arena ends when the metric is below this."""
    hold_s: float = Field(default=0.0, ge=0, le=1e9, json_schema_extra={"unit": "s"})
    """Time for which the comparison must hold in every tick; 0: the first tick suffices."""
    keep_running: bool = False
    """The arena continues to `duration_s`, so that other times and final values are complete; only the time of the stop
    is recorded."""

    @model_validator(mode="after")
    def _check_comparison(self) -> "StopTable":
        comparisons = [name for name in COMPARISONS if getattr(self, name) is not None]
        if len(comparisons) != 1:
            text = "expected just one of {all}; got {present}"
            raise PydanticCustomError(
                "stop", text, {"all": ", ".join(COMPARISONS), "present": " and ".join(comparisons) or "none"}
            )
        return self

    @property
    def comparison(self) -> tuple[Comparison, float]:
        """The comparison and its limit."""
        return next((name, limit) for name in COMPARISONS if (limit := getattr(self, name)) is not None)


_Item = Annotated[Name, Tag("string")] | Annotated[MetricTable, Tag("object")]
MetricItem = Annotated[_Item, Discriminator(form_of)]

_Stops = Annotated[tuple[StopTable, ...], Field(strict=False), Tag("array")]
StopTables = Annotated[Annotated[StopTable, Tag("object")] | _Stops, Discriminator(form_of)]
