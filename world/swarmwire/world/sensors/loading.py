"""Loading of sensors from the specs of a body: the class of each truth is loaded by name, users' classes are checked.

`fitted_sensor` completes the spec of a custom sensor before a run; `sensor_of` makes the sensor for the pipeline.
"""

import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import isfinite, isnan
from numbers import Real
from typing import Any, Literal, TypeVar, cast, get_args, get_type_hints

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.errors import BadInput, CustomCodeFailed
from swarmwire.comms.base.plugins import custom_class, entry_points_of, load_named
from swarmwire.comms.observe.truth import Group
from swarmwire.comms.robot.bodies.custom import MAX_WIDTH, CustomSensorSpec
from swarmwire.comms.robot.bodies.tables import parse_table
from swarmwire.comms.robot.sensors.sensor import Field, Noise, SensorSpec
from swarmwire.world.sensors.sensor import BuiltInSensor, CustomSensor, Scene, Sensor

T = TypeVar("T")
SENSORS = "swarmwire.sensors"  # group of entry points


def sensor_of(name: str, spec: SensorSpec, scene: Scene, group: Group) -> Sensor:
    """Return the started sensor `name` of a group, an instance of the class that its spec names."""
    if isinstance(spec, CustomSensorSpec):
        sensor: Sensor = CheckedSensor(name, custom_sensor(spec), spec)
    else:
        sensor = truth_of(type(spec))(spec)
    sensor.scene, sensor.group = scene, group
    sensor.start()
    return sensor


def truth_of(spec: type[SensorSpec]) -> type[BuiltInSensor[Any]]:
    """Return the class of the truth that a built-in spec names; NotLoaded or TypeError without such a class."""
    kind = load_named(spec.truth)
    if not isinstance(kind, type) or not issubclass(kind, BuiltInSensor):
        raise TypeError(f"{spec.__name__}.truth: expected a BuiltInSensor, got {spec.truth!r}")
    return cast("type[BuiltInSensor[Any]]", kind)


def custom_sensor(spec: CustomSensorSpec) -> CustomSensor:
    """Return a new instance of the class of a fitted spec."""
    return instance_of(CustomSensor, spec.kind, spec.params, "", "")


def fitted_sensor(spec: SensorSpec, where: str, key: str) -> SensorSpec:
    """Return the spec, that of a custom sensor with the fields of its class; BadInput for a faulty class."""
    if not isinstance(spec, CustomSensorSpec):
        return spec
    spec = replace(spec, kind=entry_point(spec.kind, SENSORS))
    sensor = instance_of(CustomSensor, spec.kind, spec.params, where, key)
    value: Any = attribute_of(sensor, "fields", where, key)
    if (
        not isinstance(value, tuple | list)
        or not value
        or not all(isinstance(item, Field) for item in cast(Any, value))
    ):
        got = f"{type(sensor).__name__} has {value!r}"
        raise BadInput(where, f"{key}.kind", f"expected fields as a tuple of Field; {got}")
    fields = cast("tuple[Field, ...]", value)
    names: list[Any] = [field.name for field in fields]
    if not all(isinstance(name, str) and name.isidentifier() for name in names) or len(set(names)) < len(names):
        expected = "expected fields with names of their own, of letters, digits and _"
        raise BadInput(where, f"{key}.kind", f"{expected}; got {', '.join(map(str, names))}")
    for field in fields:
        fault = field_fault(field)
        if fault:
            raise BadInput(where, f"{key}.kind", f"the field {field.name} of {type(sensor).__name__}: {fault}")
    return replace(spec, fields={field.name: field.width for field in fields})


def entry_point(kind: str, group: str) -> str:
    """Return the "package.module:Class" of the entry point of this name; any other text unchanged."""
    points = () if ":" in kind else entry_points_of(group)
    return next((point.value for point in points if point.name == kind), kind)


def attribute_of(instance: object, name: str, where: str, key: str) -> object:
    """Return an attribute of an instance of a user's class; BadInput if it raises."""
    try:
        return getattr(instance, name)
    except Exception as error:
        expected = f"{type(instance).__name__}.{name} fails: {type(error).__name__}: {error}"
        raise BadInput(where, f"{key}.kind", expected) from error


def instance_of(base: type[T], kind: str, params: Mapping[str, Any], where: str, key: str) -> T:
    """Return an instance of the subclass `kind` of `base`; BadInput without such a class, or for wrong parameters."""
    loaded = custom_class(base, kind, where, f"{key}.kind")
    if cast("Any", loaded).__dataclass_params__.frozen:  # the world sets its scene and group
        raise BadInput(where, f"{key}.kind", f"expected a dataclass that is not frozen; {loaded.__name__} is")
    try:
        return parse_table(loaded, params, where, key)
    except BadInput:
        raise
    except Exception as error:  # raised by the class's __post_init__
        raise BadInput(where, key, f"{loaded.__name__} refuses: {type(error).__name__}: {error}") from error


class CheckedSensor(Sensor):
    """A `CustomSensor` whose truth is checked and copied; CustomCodeFailed if it raises."""

    def __init__(self, name: str, sensor: CustomSensor, spec: CustomSensorSpec) -> None:
        self._name, self._sensor, self._spec = name, sensor, spec
        self._fields = tuple(replace(field, step=field.step or spec.step) for field in sensor.fields)

    @property
    def fields(self) -> tuple[Field, ...]:
        """The fields of the class, with the step of the spec."""
        return self._fields

    def start(self) -> None:
        """Start the user's sensor; see `Sensor.start`."""
        sensor, group = self._sensor, self.group
        sensor.scene, sensor.group = self.scene, group
        self._label = f"the sense {self._name} of {group.name} ({self._spec.kind})"
        robots = len(self.scene.keys), group.stop - group.start
        self._shapes = [(*robots, field.width) if field.width else robots for field in self._fields]
        self._call(sensor.start)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """Return the truth of each field."""
        truth: Any = self._call(self._sensor.truth, tick)
        if not isinstance(cast("object", truth), np.ndarray | tuple | list):
            raise CustomCodeFailed(self._label, f"truth: expected an array, or a tuple of arrays, got {truth!r:.80}")
        single = isinstance(cast("object", truth), np.ndarray)
        arrays: tuple[Any, ...] = (truth,) if single else tuple(truth)
        if len(arrays) != len(self._shapes):
            raise CustomCodeFailed(self._label, f"truth: expected {len(self._shapes)} arrays, got {len(arrays)}")
        return tuple(self._checked(*each) for each in zip(self._fields, arrays, self._shapes, strict=True))

    def follow(self, tick: int) -> None:
        """Update the user's sensor; see `Sensor.follow`."""
        self._call(self._sensor.follow, tick)

    def _checked(self, field: Field, array: Any, shape: tuple[int, ...]) -> FloatArray:
        try:
            numbers = np.array(array, np.float64, order="C")
        except (TypeError, ValueError) as error:
            raise CustomCodeFailed(self._label, f"truth: expected numbers as {field.name}: {error}") from error
        if numbers.shape != shape:
            raise CustomCodeFailed(self._label, f"truth: expected {field.name} of shape {shape}, got {numbers.shape}")
        return numbers

    def _call(self, method: Any, *args: int) -> Any:
        try:
            return method(*args)
        except (Exception, SystemExit) as error:
            raise CustomCodeFailed(self._label, traceback.format_exc()) from error


KINDS: tuple[Literal["uniform", "normal"], ...] = get_args(get_type_hints(Noise)["kind"])


def field_fault(field: Field) -> str | None:
    """Return the expectation that a value of the field violates, with the value; None if all are valid.

    The name is not checked.
    """
    untyped: Any = field  # a user's values may be of any type
    width, noise, low, high, blank, span = (
        getattr(untyped, name) for name in ("width", "noise", "low", "high", "blank", "span")
    )
    if type(width) is not int or not 0 <= width <= MAX_WIDTH:
        return f"expected a width from 0 to {MAX_WIDTH}; got {width!r}"
    if not isinstance(noise, Noise):
        return f"expected noise as a Noise; got {noise!r}"
    if noise.kind not in KINDS:
        return f"expected noise of the kind {' or '.join(KINDS)}; got {noise.kind!r}"
    for name, value in (("noise.size", noise.size), ("noise.relative", noise.relative), ("step", untyped.step)):
        if not _is_number(value, lambda number: isfinite(number) and number >= 0.0):
            return f"expected {name} as a finite number from 0; got {value!r}"
    for name, value in (("low", low), ("high", high)):
        if not _is_number(value, lambda number: not isnan(number)):
            return f"expected {name} as a number; got {value!r}"
    if low > high:
        return f"expected low not above high; got {low!r} and {high!r}"
    if not _is_number(blank):
        return f"expected blank as a number; got {blank!r}"
    if span is not None and not _is_span(span):
        return f"expected span as two finite numbers that do not fall; got {span!r}"
    for name, value in (("unit", untyped.unit), ("help", untyped.help), ("per", untyped.per)):
        if not isinstance(value, str):
            return f"expected {name} as a text; got {value!r}"
    return None


def _is_number(value: Any, is_valid: Callable[[float], bool] = lambda _: True) -> bool:
    return isinstance(value, Real) and value is not True and value is not False and is_valid(float(value))


def _is_span(span: object) -> bool:
    if not isinstance(span, tuple | list):
        return False
    ends = cast("Sequence[Any]", span)
    return len(ends) == 2 and all(_is_number(end, isfinite) for end in ends) and ends[0] <= ends[1]
