"""The declaration of a sensor: its keys in a body file, the fields of its readings, and the property that reads it.

A `SensorSpec` has the keys, and derives the `Field`s from them: names, widths, units, noise and ranges. A reading is a
dataclass with the same names, typed for agents. `SensorProperty` connects the two in the class `Sensors` of this
package. The spec names the class in the world that computes the sensor's truth; `swarmwire.world.sensors` describes
the interface of that class.
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
Reading = TypeVar("Reading")
VectorReading = TypeVar("VectorReading")
Draw = Callable[[str, int], FloatArray]  # purpose, width -> uniform draws in [0, 1), (n,) for width 0, else (n, width)
SPEC = "spec"  # the field of a reading that holds the sensor's spec


@dataclass(frozen=True, slots=True)
class Noise:
    """Random error of size `size + relative * |value|`: half width if uniform, standard deviation if normal."""

    kind: Literal["uniform", "normal"] = "normal"
    size: float = 0.0  #: unit of the field
    relative: float = 0.0


NO_NOISE = Noise()


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a reading. Values that are not finite (a ray without an echo) get no noise and are not clipped."""

    name: str  #: "value"
    width: int = 0  #: 0: a number per robot, (n,); otherwise (n, width)
    noise: Noise = NO_NOISE
    step: float = 0.0  #: values are rounded to multiples of the step; 0: no rounding
    low: float = -inf  #: values are clipped to [low, high]
    high: float = inf
    blank: float = nan  #: value of a lost reading
    angle: bool = False  #: True: values are wrapped to (-pi, pi]
    span: tuple[float, float] | None = None  #: range of outliers; None: low to high
    unit: str = ""
    help: str = ""  #: meaning, for descriptions
    per: str = ""  #: plural of the parts that have a value each, for descriptions: "rays"

    @property
    def shape(self) -> str:
        """Shape of the values of n robots, for descriptions: "(n, rays)"."""
        return f"(n, {self.per or self.width})" if self.width else "(n,)"

    @property
    def meaning(self) -> str:
        """Meaning for descriptions, with the interval of an angle."""
        return f"{self.help}, in (-pi, pi]" if self.angle else self.help


@dataclass(frozen=True, kw_only=True)
class SensorSpec:
    """The keys that all sensors have; a subclass adds the keys of its sensor.

    A reading passes through these stages, in this order: the truth, sampled at `rate_hz`; noise; outliers; rounding to
    steps; clipping to the range; drop-out. The agent sees it from `delay_s` later until the next reading arrives.
    """

    is_global: ClassVar[bool] = False  #: True: it measures more than the robot and its surroundings
    truth: ClassVar[str] = ""  #: "package.module:Class" of the truth in the world

    rate_hz: float = parameter(
        0.0, help="new readings per second, taken at ticks; 0: one in each tick", unit="Hz", at_least=0
    )
    delay_s: float = parameter(0.0, help="delay until the agent gets a reading, in whole ticks", unit="s", at_least=0)
    drop_out: float = parameter(0.0, help="probability that a reading is lost", at_least=0, at_most=1)
    step: float = parameter(0.0, help="step to which readings are rounded, in their unit; 0: no rounding", at_least=0)

    def fault(self, radius_m: float) -> tuple[str, str] | None:
        """Return a key whose value contradicts the others or the body's radius, and the expectation; None if none does.

        Overridden by sensors whose keys depend on each other.
        """
        return None

    @classmethod
    def unsupported(cls, drive: object, altitude_m: float) -> str | None:
        """Return why no body with this kind of drive at this altitude can have the sensor; None if it can."""
        return None

    @classmethod
    def example(cls) -> Self:
        """Return a typical sensor, for descriptions and tests."""
        return cls()

    def reading_fields(self) -> tuple[Field, ...]:
        """Return the fields of a reading, in the order of the reading's class."""
        return ()

    def blank(self, name: str, n: int) -> dict[str, FloatArray]:
        """Return lost readings of n robots with this sensor: "sensor.field" -> (n,) or (n, width)."""
        return {
            f"{name}.{field.name}": np.full((n, field.width) if field.width else n, field.blank)
            for field in self.reading_fields()
        }

    def synthetic(self, name: str, tick: int, draw: Draw) -> tuple[FloatArray, ...]:
        """Return random values of each field, for trials of agents: uniform in the field's range, or from 0 to 1."""
        return tuple(_within(field, draw(f"{name}.{field.name}", field.width)) for field in self.reading_fields())


def _within(field: Field, share: FloatArray) -> FloatArray:
    finite = isfinite(field.low) and isfinite(field.high)
    return field.low + share * (field.high - field.low) if finite else share


@dataclass(frozen=True, kw_only=True)
class RangedSensorSpec(SensorSpec):
    """The spec of a sensor whose readings lie within a known range."""

    outlier: float = parameter(
        0.0, help="probability that a reading is replaced by a random value within the range", at_least=0, at_most=1
    )


class SensorProperty(Generic[Reading, VectorReading]):
    """The property of a handle that reads a sensor: a `Reading` of one robot, or a `VectorReading` of n robots.

    A reading is made from its columns, in the order of the fields of the class for n robots, and from the spec if that
    class has a field `spec`. The column of a field without a width is a float for one robot, and (n,) for n robots;
    other columns are (width,) and (n, width).

    Attributes:
        name: name of the sensor in body files and in the `needs` of agents.
        columns: keys "sensor.field" of the fields.
        has_spec: True if readings hold the spec.
    """

    name: str
    columns: tuple[str, ...]
    has_spec: bool

    def __init__(
        self, spec: type[SensorSpec], make_reading: Callable[..., Reading], make_readings: type[VectorReading]
    ) -> None:
        """Define the sensor of a spec.

        Args:
            spec: class of the sensor's spec.
            make_reading: dataclass of the reading of one robot, or a function of its columns.
            make_readings: dataclass of the readings of n robots.
        """
        self.spec = spec
        # The class itself is called faster than a parametrized ImuReading[FloatArray].
        self.make_reading: Callable[..., Reading] = get_origin(make_reading) or make_reading
        self.make_readings: type[VectorReading] = get_origin(make_readings) or make_readings

    def __set_name__(self, owner: type[Any], name: str) -> None:
        names = [field.name for field in fields(cast("Any", self.make_readings))]
        self.name, self.has_spec = name, SPEC in names
        field_names = [field_name for field_name in names if field_name != SPEC]
        self.columns = tuple(f"{name}.{field_name}" for field_name in field_names)
        self.__doc__ = f"{cleandoc(self.make_readings.__doc__ or '')}\n\nFields: {', '.join(field_names)}."

    @overload
    def __get__(self, handle: None, owner: type[Any]) -> Self: ...
    @overload
    def __get__(self, handle: "Sensors[float]", owner: type[Any]) -> Reading: ...
    @overload
    def __get__(self, handle: "Sensors[FloatArray]", owner: type[Any]) -> VectorReading: ...
    def __get__(self, handle: Any, owner: type[Any]) -> Any:
        """Return the reading of this tick."""
        return self if handle is None else handle._reading(self)

    def __set__(self, handle: object, value: object) -> None:
        """Refuse an assignment."""
        raise AttributeError(f"the reading of the sensor {self.name} cannot be set")


class LazyArray:
    """A field of a reading that turns a memoryview into an array when it is first read.

    A plain `Agent` often reads no arrays, and numpy's memory is cold in a process that steps one robot.
    """

    def __set_name__(self, owner: type[Any], name: str) -> None:
        self._name = name

    def __get__(self, reading: object, owner: type[Any] | None = None) -> FloatArray:
        if reading is None:
            raise AttributeError(self._name)  # otherwise `dataclass` would take the descriptor as the field's default
        values = reading.__dict__[self._name]
        if isinstance(values, memoryview):
            values = reading.__dict__[self._name] = np.asarray(values)
        return values

    def __set__(self, reading: object, values: FloatArray | memoryview) -> None:
        reading.__dict__[self._name] = values


class CustomReading:
    """The reading of a custom sensor, with an attribute for each of its fields.

    The value of a field is a float or (width,) for one robot, and (n,) or (n, width) for n robots.
    """

    def __init__(self, sensor: str, fields: Mapping[str, Any]) -> None:
        self._sensor, self._fields = sensor, fields

    def __getattr__(self, name: str) -> Any:
        """Return a field by its name."""
        if name.startswith("_") or name not in self._fields:
            raise AttributeError(f"the sensor {self._sensor} has the fields {', '.join(self._fields)}, not {name}")
        return self._fields[name]
