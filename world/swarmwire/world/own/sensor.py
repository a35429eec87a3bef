"""A sense of the user's own: the class to write, and how the world asks it."""

import traceback
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.sensors import OwnSheet
from swarmwire.comms.errors import OwnCodeFailed
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.scene import Scene
from swarmwire.world.sensors.sensor import Field


class OwnSensor(ABC):
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


class AskedSensor:
    """An `OwnSensor` as the stages ask it: what it tells is checked and copied; OwnCodeFailed if it raises."""

    def __init__(self, name: str, own: OwnSensor, sheet: OwnSheet, scene: Scene, group: Group) -> None:
        own.scene, own.group = scene, group
        self._what, self._own = f"the sense {name} of {group.name} ({sheet.kind})", own
        self.fields = tuple(replace(field, step=field.step or sheet.step) for field in own.fields)
        robots = len(scene.keys), group.stop - group.start
        self._shapes = [(*robots, field.width) if field.width else robots for field in self.fields]
        self._call(own.start)

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """The truth about each field."""
        told: Any = self._call(self._own.truth, tick)
        if not isinstance(cast("object", told), np.ndarray | tuple | list):
            raise OwnCodeFailed(self._what, f"truth: expected an array, or a tuple of arrays, got {told!r:.80}")
        single = isinstance(cast("object", told), np.ndarray)
        arrays: tuple[Any, ...] = (told,) if single else tuple(told)
        if len(arrays) != len(self._shapes):
            raise OwnCodeFailed(self._what, f"truth: expected {len(self._shapes)} arrays, got {len(arrays)}")
        return tuple(self._checked(*each) for each in zip(self.fields, arrays, self._shapes, strict=True))

    def follow(self, tick: int) -> None:
        """Let it add up what happens."""
        self._call(self._own.follow, tick)

    def _checked(self, field: Field, array: Any, shape: tuple[int, ...]) -> FloatArray:
        try:
            numbers = np.array(array, np.float64, order="C")
        except (TypeError, ValueError) as error:
            raise OwnCodeFailed(self._what, f"truth: expected numbers as {field.name}: {error}") from error
        if numbers.shape != shape:
            raise OwnCodeFailed(self._what, f"truth: expected {field.name} of shape {shape}, got {numbers.shape}")
        return numbers

    def _call(self, method: Any, *args: int) -> Any:
        try:
            return method(*args)
        except (Exception, SystemExit) as error:
            raise OwnCodeFailed(self._what, traceback.format_exc()) from error
