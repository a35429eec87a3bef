"""The declaration of a sensor: its keys in a body file, the fields of its readings, and the property that reads it.

A `SensorSpec` has the keys, and derives the `Field`s from them: names, widths, units, noise and ranges. A reading is a
dataclass with the same names, typed for agents. `SensorProperty` joins both in the class `Sensors` of this package.
The truth is a class of the world, which the spec names; `swarmwire.world.sensors` describes its interface.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from inspect import cleandoc
from math import inf, isfinite, nan
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Literal, Self, TypeVar, cast, get_origin, overload

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.config import parameter

if TYPE_CHECKING:
    from swarmwire.comms.robot.sensors import Sensors

N = TypeVar("N", bound=float | FloatArray)  # a float for an Agent; (n,) for a VectorAgent
One = TypeVar("One")
Many = TypeVar("Many")
Draw = Callable[[str, int], FloatArray]  # purpose, width -> uniform draws in [0, 1), (n,) for width 0, else (n, width)
SPEC = "spec"  # the field of a reading that holds the sensor's spec


@dataclass(frozen=True, slots=True)
class Noise:
    """An error of `size + relative * |value|`: half the width if uniform, the standard deviation if normal."""

    kind: Literal["uniform", "normal"] = "normal"
    size: float = 0.0  # in the field's unit
    relative: float = 0.0


NO_NOISE = Noise()


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a reading. Values that are not finite (a ray without an echo) get no noise and are not clipped."""

    name: str  # "value"
    width: int = 0  # 0: one number per robot, (n,); else (n, width)
    noise: Noise = NO_NOISE
    step: float = 0.0  # rounded to whole multiples of it; 0: not
    low: float = -inf  # clipped to low and high
    high: float = inf
    blank: float = nan  # the value of a reading that is lost
    angle: bool = False  # wrapped to (-pi, pi]
    span: tuple[float, float] | None = None  # range of outliers; None: from low to high
    unit: str = ""
    help: str = ""  # its meaning, for descriptions
    per: str = ""  # what the width counts, in the plural: "rays"

    @property
    def shape(self) -> str:
        """The shape of its values for n robots, for descriptions: "(n, rays)"."""
        return f"(n, {self.per or self.width})" if self.width else "(n,)"

    @property
    def meaning(self) -> str:
        """Its meaning with its interval if it is an angle, for descriptions."""
        return f"{self.help}, in (-pi, pi]" if self.angle else self.help


@dataclass(frozen=True, kw_only=True)
class SensorSpec:
    """The keys that all sensors have; a subclass adds those of one sensor.

    A reading passes through these stages, in this order: the truth, taken at `rate_hz`; noise; outliers; rounding to
    steps; clipping to the range; drop-out. The agent gets it `delay_s` later, and until the next one arrives.
    """

    is_global: ClassVar[bool] = False  # True: it measures more than the robot and its surroundings
    truth: ClassVar[str] = ""  # "package.module:Class" of its truth in the world

    rate_hz: float = parameter(
        0.0, help="new readings per second, taken at ticks; 0: one in each tick", unit="Hz", at_least=0
    )
    delay_s: float = parameter(0.0, help="a reading is shown that much later, in whole ticks", unit="s", at_least=0)
    drop_out: float = parameter(0.0, help="probability that a reading is lost", at_least=0, at_most=1)
    step: float = parameter(
        0.0, help="readings are rounded to whole multiples of it, in their unit; 0: they are not", at_least=0
    )

    def fault(self, radius_m: float) -> tuple[str, str] | None:
        """A key whose value contradicts the others or this body radius, and the expectation; None if there is none."""
        return None

    @classmethod
    def unsupported(cls, drive: object, altitude_m: float) -> str | None:
        """The reason why no body with this kind of drive at this altitude can have the sensor; None if it can."""
        return None

    @classmethod
    def example(cls) -> Self:
        """A typical sensor, for descriptions and tests."""
        return cls()

    def reading_fields(self) -> tuple[Field, ...]:
        """The fields of a reading, in the order of the reading's class."""
        return ()

    def blank(self, name: str, n: int) -> dict[str, FloatArray]:
        """The lost readings of n robots with this sensor: "sensor.field" -> (n,) or (n, width)."""
        return {
            f"{name}.{field.name}": np.full((n, field.width) if field.width else n, field.blank)
            for field in self.reading_fields()
        }

    def synthetic(self, name: str, tick: int, draw: Draw) -> tuple[FloatArray, ...]:
        """Made-up values of each field for trials of agents: uniform in the field's range, or from 0 to 1."""
        return tuple(_within(field, draw(f"{name}.{field.name}", field.width)) for field in self.reading_fields())


def _within(field: Field, share: FloatArray) -> FloatArray:
    finite = isfinite(field.low) and isfinite(field.high)
    return field.low + share * (field.high - field.low) if finite else share


@dataclass(frozen=True, kw_only=True)
class RangedSensorSpec(SensorSpec):
    """The spec of a sensor whose readings lie within a known range."""

    outlier: float = parameter(
        0.0, help="probability that a reading is anything within the range instead", at_least=0, at_most=1
    )


class SensorProperty(Generic[One, Many]):
    """The property of a handle that reads one sensor: a `One` of one robot, a `Many` of n robots.

    Both are made from the columns of the reading, in the order of the fields of `Many`, and from the spec if it has a
    field `spec`. A single number per robot is a float for `One`, and (n,) for `Many`; others are (width,), (n, width).

    Attributes:
        name: of the sensor in body files and in the `needs` of agents.
        columns: the keys "sensor.field" of its fields.
        has_spec: whether its readings hold the spec.
    """

    name: str
    columns: tuple[str, ...]
    has_spec: bool

    def __init__(self, spec: type[SensorSpec], one: Callable[..., One], many: type[Many]) -> None:
        """`one` and `many` are the dataclasses of the readings; `one` may be another function of the columns."""
        self.spec = spec
        self.make_reading: Callable[..., One] = get_origin(one) or one
        self.make_readings: type[Many] = get_origin(many) or many

    def __set_name__(self, owner: type[Any], name: str) -> None:
        names = [of.name for of in fields(cast("Any", self.make_readings))]
        self.name, self.has_spec = name, SPEC in names
        columns = [of for of in names if of != SPEC]
        self.columns = tuple(f"{name}.{of}" for of in columns)
        self.__doc__ = f"{cleandoc(self.make_readings.__doc__ or '')}\n\nFields: {', '.join(columns)}."

    @overload
    def __get__(self, handle: None, owner: type[Any]) -> Self: ...
    @overload
    def __get__(self, handle: "Sensors[float]", owner: type[Any]) -> One: ...
    @overload
    def __get__(self, handle: "Sensors[FloatArray]", owner: type[Any]) -> Many: ...
    def __get__(self, handle: Any, owner: type[Any]) -> Any:
        """The reading of this tick."""
        return self if handle is None else handle._reading(self)  # the handle's own method

    def __set__(self, handle: object, value: object) -> None:
        """Readings cannot be assigned."""
        raise AttributeError(f"the reading of the sensor {self.name} cannot be set")


class LazyArray:
    """A field of a reading whose numbers become an array when it is first read, if they were given as a memoryview.

    A plain `Agent` often needs none, and numpy's memory is cold in a process that steps one robot.
    """

    def __set_name__(self, owner: type[Any], name: str) -> None:
        self._name = name

    def __get__(self, reading: object, owner: type[Any] | None = None) -> FloatArray:
        if reading is None:
            raise AttributeError(self._name)  # it is no default of the field
        values = reading.__dict__[self._name]
        if isinstance(values, memoryview):
            values = reading.__dict__[self._name] = np.asarray(values)
        return values

    def __set__(self, reading: object, values: FloatArray | memoryview) -> None:
        reading.__dict__[self._name] = values


class CustomReading:
    """The reading of a custom sensor: each of its fields is an attribute.

    For one robot a float, or (width,); for n robots (n,), or (n, width).
    """

    def __init__(self, sensor: str, fields: Mapping[str, Any]) -> None:
        self._sensor, self._fields = sensor, fields

    def __getattr__(self, name: str) -> Any:
        """A field by its name."""
        if name.startswith("_") or name not in self._fields:
            raise AttributeError(f"the sensor {self._sensor} has the fields {', '.join(self._fields)}, not {name}")
        return self._fields[name]
