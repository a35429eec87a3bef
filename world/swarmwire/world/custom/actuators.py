"""Custom actuators: the base class, the loading of a user's class, and the actuators of all groups of a run.

`CustomActuators` holds them: agents set them, and they act in each tick.
"""

import traceback
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.errors import BadInput, CustomCodeFailed
from swarmwire.comms.observe.truth import Group
from swarmwire.comms.robot.bodies.custom import MAX_WIDTH, CustomActuatorSpec
from swarmwire.comms.robot.tick_io import SparseTable
from swarmwire.world.actuation.actuators import fitting
from swarmwire.world.sensors.loading import attribute_of, entry_point, instance_of
from swarmwire.world.sensors.sensor import Scene

ACTUATORS = "swarmwire.actuators"  # group of entry points


class CustomActuator(ABC):
    """What an actuator of your own does. Subclasses are dataclasses: fields made by `parameter` are keys.

    One instance serves all robots of a group, in all arenas.
    """

    scene: Scene  # the arenas and all bodies, from `start` on
    group: Group  # the robots whose actuator it is: of index `group.start` to before `group.stop` in each arena

    @property
    def width(self) -> int:
        """How many numbers an agent sets it to; asked for before there is a scene."""
        return 1

    @abstractmethod
    def act(self, tick: int, rows: IntArray, values: FloatArray) -> None:
        """Do what agents set it to in a tick, before bodies move; called in every tick, also for no robot.

        Of the scene it may change what engines are given, `target`, the `leds`, the `charge`, and what lies in `own`.

        Args:
            tick: the tick.
            rows: (k,) robot row of those who set it and are alive, rising: arena x robots + index; see `at`.
            values: (k, width) what they set it to.
        """

    def start(self) -> None:  # noqa: B027 - there may be nothing to do
        """Called once, before the first tick."""

    def at(self, rows: IntArray) -> tuple[IntArray, IntArray]:
        """Arena and index in the arena of robot rows, any shape: `self.scene.state[self.at(rows)]` are their states."""
        arena, robot = np.divmod(rows, self.scene.state.shape[1])
        return arena, robot


def custom_actuator(spec: CustomActuatorSpec) -> CustomActuator:
    """A new instance of the class of a spec that is fitted."""
    return instance_of(CustomActuator, spec.kind, spec.params, "", "")


def fitted_actuator(spec: CustomActuatorSpec, where: str, key: str) -> CustomActuatorSpec:
    """The spec with the width of its class; BadInput names what is wrong."""
    spec = replace(spec, kind=entry_point(spec.kind, ACTUATORS))
    actuator = instance_of(CustomActuator, spec.kind, spec.params, where, key)
    width: Any = attribute_of(actuator, "width", where, key)
    if type(width) is not int or not 1 <= width <= MAX_WIDTH:
        got = f"{type(actuator).__name__} has {width!r}"
        raise BadInput(where, f"{key}.kind", f"expected a width from 1 to {MAX_WIDTH}; {got}")
    return replace(spec, width=width)


class CustomActuators:
    """The custom actuators of all groups; `any` is whether there are some.

    Attributes:
        not_there: (arenas,) numbers set for places that the robots' bodies do not have.
    """

    def __init__(self, groups: Sequence[Group], scene: Scene) -> None:
        """Each is started; CustomCodeFailed if one raises."""
        self._scene = scene
        self._fitted: list[tuple[str, CustomActuator, slice]] = []
        for group in groups:
            for name, spec in group.body.actuators.items():
                actuator = custom_actuator(spec)
                actuator.scene, actuator.group = scene, group
                what = f"the actuator {name} of {group.name} ({spec.kind})"
                self._fitted.append((what, actuator, group.body.actuator_slices[name]))
                _call(what, actuator.start)
        self.any = bool(self._fitted)
        arenas, robots = len(scene.keys), len(scene.radius_m)
        places = [sum(spec.width for spec in group.body.actuators.values()) for group in groups]
        self._places = np.repeat(places, [group.stop - group.start for group in groups])
        self._index: IntArray = np.tile(np.arange(robots, dtype=np.int64), arenas)
        self.not_there: IntArray = np.zeros(arenas, np.int64)
        self._ticks = 0

    def act(self, commands: SparseTable, alive: BoolArray) -> None:
        """Let those of robots `alive` (rows,) act in a tick; CustomCodeFailed if one raises or leaves inf or nan."""
        commands = fitting(commands, self._places, alive, self.not_there)
        numbers = np.full((len(alive), self._places.max(initial=0)), np.nan)
        numbers[commands.rows, commands.slot] = commands.value
        for what, actuator, places in self._fitted:
            here = (self._index >= actuator.group.start) & (self._index < actuator.group.stop)
            values = numbers[:, places]
            set_ = np.flatnonzero(here & ~np.isnan(values).any(axis=1))
            _call(what, actuator.act, self._ticks, set_, values[set_])
            self._check(what)
        self._ticks += 1

    def _check(self, what: str) -> None:
        """After each of them: later nobody could tell whose number made poses nan."""
        for name, values in (("target", self._scene.target), ("charge", self._scene.charge)):
            finite = np.isfinite(values)
            if not finite.all():
                arena, robot = np.argwhere(~finite)[0, :2]
                value = values[arena, robot].tolist()
                said = f"expected finite numbers in scene.{name}, got {value} of robot {robot} in arena {arena}"
                raise CustomCodeFailed(what, f"act: {said}")


def _call(what: str, method: Any, *args: Any) -> None:
    try:
        method(*args)
    except (Exception, SystemExit) as error:
        raise CustomCodeFailed(what, traceback.format_exc()) from error
