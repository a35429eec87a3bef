"""What is measured, and what of it ends an arena: the tables of `metrics` and `[stop]`.

Only their form is known here: which metrics there are, with which parameters, is found where the run is put together.
"""

from typing import Annotated, Any, Literal, get_args

from pydantic import ConfigDict, Discriminator, Field, StringConstraints, Tag, model_validator
from pydantic_core import PydanticCustomError

from swarmwire.world.scenario.schema import form_of
from swarmwire.world.scenario.tables import Table

Name = Annotated[str, StringConstraints(min_length=1)]
Comparison = Literal["at_least", "at_most", "above", "below"]
COMPARISONS: tuple[Comparison, ...] = get_args(Comparison)


class MetricTable(Table):
    """A metric with parameters, which stand beside its name."""

    model_config = ConfigDict(extra="allow")

    metric: Name
    """Its name, or its class; its parameters stand beside it."""

    @property
    def params(self) -> dict[str, Any]:
        """The parameters that are given, by name."""
        return dict(self.model_extra or {})


class StopTable(Table):
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

    @model_validator(mode="after")
    def _one_comparison(self) -> "StopTable":
        given = [name for name in COMPARISONS if getattr(self, name) is not None]
        if len(given) != 1:
            text = "expected just one of {all}; got {given}"
            raise PydanticCustomError(
                "stop", text, {"all": ", ".join(COMPARISONS), "given": " and ".join(given) or "none"}
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
