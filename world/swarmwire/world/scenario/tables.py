"""What the tables of a scenario's file are made of: metres, points, headings."""

from typing import Annotated, Any

from pydantic import BaseModel, Field

from swarmwire.world.scenario.schema import TABLE


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


class Table(BaseModel):
    """A table of the file."""

    model_config = TABLE
