"""Custom sensors: the base class, how the world reads it, and checks of its fields at run time."""

import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import isfinite, isnan
from numbers import Real
from typing import Any, Literal, cast, get_args, get_type_hints

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.custom import MAX_WIDTH, CustomSensorSpec
from swarmwire.comms.errors import CustomCodeFailed
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.sensor import Field, Noise, Scene


class CustomSensor(ABC):
    """What the truth is about a sense of your own. Subclasses are dataclasses: fields made by `parameter` are keys.

    One instance serves all robots of a group, in all arenas. Noise, drop-out, rate and delay are not its affair: they
    stand in its `fields` and in the body's sheet.
    """

    scene: Scene  # the arenas and all bodies, from `start` on
    group: Group  # the robots whose sense it is: of index `group.start` to before `group.stop` in each arena

    @property
    @abstractmethod
    def fields(self) -> Sequence[Field]:
        """What is told; asked for before there is a scene."""

    @abstractmethod
    def truth(self, tick: int) -> FloatArray | Sequence[FloatArray]:
        """The truth about each field, (arenas, n) or (arenas, n, width); of a single field the array alone will do.

        A value must depend on the robot's own arena alone: then an arena is the same alone and among others.
        """

    def start(self) -> None:  # noqa: B027 - there may be nothing to do
        """Called once, before the first tick."""

    def follow(self, tick: int) -> None:  # noqa: B027 - there may be nothing to do
        """Called in place of `truth` in ticks in which nothing is read, for what adds up from tick to tick."""

    @property
    def pose(self) -> FloatArray:
        """Where the group's robots are, (arenas, n, 3): x, y in m, heading in rad, not wrapped; arena frame."""
        return self.scene.state[:, self.group.start : self.group.stop, :3]


class CheckedSensor:
    """An `CustomSensor` as the stages ask it: what it tells is checked and copied; CustomCodeFailed if it raises."""

    def __init__(self, name: str, own: CustomSensor, spec: CustomSensorSpec, scene: Scene, group: Group) -> None:
        own.scene, own.group = scene, group
        self._what, self._own = f"the sense {name} of {group.name} ({spec.kind})", own
        self.fields = tuple(replace(field, step=field.step or spec.step) for field in own.fields)
        robots = len(scene.keys), group.stop - group.start
        self._shapes = [(*robots, field.width) if field.width else robots for field in self.fields]
        self._call(own.start)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The truth about each field."""
        told: Any = self._call(self._own.truth, tick)
        if not isinstance(cast("object", told), np.ndarray | tuple | list):
            raise CustomCodeFailed(self._what, f"truth: expected an array, or a tuple of arrays, got {told!r:.80}")
        single = isinstance(cast("object", told), np.ndarray)
        arrays: tuple[Any, ...] = (told,) if single else tuple(told)
        if len(arrays) != len(self._shapes):
            raise CustomCodeFailed(self._what, f"truth: expected {len(self._shapes)} arrays, got {len(arrays)}")
        return tuple(self._checked(*each) for each in zip(self.fields, arrays, self._shapes, strict=True))

    def follow(self, tick: int) -> None:
        """Let it add up what happens."""
        self._call(self._own.follow, tick)

    def _checked(self, field: Field, array: Any, shape: tuple[int, ...]) -> FloatArray:
        try:
            numbers = np.array(array, np.float64, order="C")
        except (TypeError, ValueError) as error:
            raise CustomCodeFailed(self._what, f"truth: expected numbers as {field.name}: {error}") from error
        if numbers.shape != shape:
            raise CustomCodeFailed(self._what, f"truth: expected {field.name} of shape {shape}, got {numbers.shape}")
        return numbers

    def _call(self, method: Any, *args: int) -> Any:
        try:
            return method(*args)
        except (Exception, SystemExit) as error:
            raise CustomCodeFailed(self._what, traceback.format_exc()) from error


KINDS: tuple[Literal["uniform", "normal"], ...] = get_args(get_type_hints(Noise)["kind"])


def field_fault(field: Field) -> str | None:
    """What was expected of one of its values, and which there is; None if all are well. Its name may be anything."""
    of: Any = field  # what a user wrote may be of any type
    if type(of.width) is not int or not 0 <= of.width <= MAX_WIDTH:
        return f"expected a width from 0 to {MAX_WIDTH}; got {of.width!r}"
    if not isinstance(of.noise, Noise):
        return f"expected noise as a Noise; got {of.noise!r}"
    if of.noise.kind not in KINDS:
        return f"expected noise of the kind {' or '.join(KINDS)}; got {of.noise.kind!r}"
    for name, value in (("noise.size", of.noise.size), ("noise.relative", of.noise.relative), ("step", of.step)):
        if not _is(value, lambda number: isfinite(number) and number >= 0.0):
            return f"expected {name} as a finite number from 0; got {value!r}"
    for name, value in (("low", of.low), ("high", of.high)):
        if not _is(value, lambda number: not isnan(number)):
            return f"expected {name} as a number; got {value!r}"
    if of.low > of.high:
        return f"expected low not above high; got {of.low!r} and {of.high!r}"
    if not _is(of.blank, lambda _: True):
        return f"expected blank as a number; got {of.blank!r}"
    if of.span is not None and not _is_span(of.span):
        return f"expected span as two finite numbers that do not fall; got {of.span!r}"
    return None


def _is(value: Any, holds: Callable[[float], bool]) -> bool:
    return isinstance(value, Real) and value is not True and value is not False and holds(float(value))


def _is_span(span: object) -> bool:
    if not isinstance(span, tuple | list):
        return False
    ends = cast("Sequence[Any]", span)
    return len(ends) == 2 and all(_is(end, isfinite) for end in ends) and ends[0] <= ends[1]
