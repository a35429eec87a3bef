"""Custom actuators: the base class, the loading of a user's class, and the actuators of all groups of a run."""

import traceback
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.errors import BadInput, CustomCodeFailed
from swarmwire.comms.observe.truth import Group
from swarmwire.comms.robot.bodies.custom import MAX_WIDTH, CustomActuatorSpec
from swarmwire.comms.robot.tick_io import SparseTable
from swarmwire.world.actuation.actuators import select_existing
from swarmwire.world.sensors.loading import attribute_of, entry_point, instance_of
from swarmwire.world.sensors.sensor import Scene

ACTUATORS = "swarmwire.actuators"  # group of entry points


class CustomActuator(ABC):
    """The base of users' actuators. Subclasses are dataclasses: fields made by `parameter` are keys.

    One instance serves all robots of a group, in all arenas.
    """

    scene: Scene  #: the arenas and all bodies, from `start` on
    group: Group  #: the robots with this actuator: indices `group.start` to `group.stop` - 1 in each arena

    @property
    def width(self) -> int:
        """Number of values that an agent sets; read before there is a scene."""
        return 1

    @abstractmethod
    def act(self, tick: int, rows: IntArray, values: FloatArray) -> None:
        """Apply the values that agents set in a tick, before bodies move; called in every tick, also without values.

        It may change `target`, `leds`, `charge` and `shared` of the scene.

        Args:
            tick: the tick.
            rows: (k,) rows of the robots that are alive and set values, rising: arena x robots + index; see `at`.
            values: (k, width) their values.
        """

    def start(self) -> None:  # noqa: B027 - a hook that may stay empty
        """Prepare the actuator; called once, before the first tick."""

    def at(self, rows: IntArray) -> tuple[IntArray, IntArray]:
        """Return arena and index in the arena of robot rows, to index arrays of the scene: `scene.state[at(rows)]`."""
        arena, robot = np.divmod(rows, self.scene.state.shape[1])
        return arena, robot


def custom_actuator(spec: CustomActuatorSpec) -> CustomActuator:
    """Return a new instance of the class of a fitted spec."""
    return instance_of(CustomActuator, spec.kind, spec.params, "", "")


def fitted_actuator(spec: CustomActuatorSpec, where: str, key: str) -> CustomActuatorSpec:
    """Return the spec with the width of its class; BadInput for a faulty class."""
    spec = replace(spec, kind=entry_point(spec.kind, ACTUATORS))
    actuator = instance_of(CustomActuator, spec.kind, spec.params, where, key)
    width: Any = attribute_of(actuator, "width", where, key)
    if type(width) is not int or not 1 <= width <= MAX_WIDTH:
        got = f"{type(actuator).__name__} has {width!r}"
        raise BadInput(where, f"{key}.kind", f"expected a width from 1 to {MAX_WIDTH}; {got}")
    return replace(spec, width=width)


class _Fitted(NamedTuple):
    """A started actuator of one group."""

    label: str  # its name in messages
    actuator: CustomActuator
    columns: slice  # its values among those of the group's robots


class CustomActuators:
    """The custom actuators of all groups.

    Attributes:
        any: True if any group has one.
        missing: (arenas,) number of values that were set for actuators that the robots' bodies do not have.
    """

    def __init__(self, groups: Sequence[Group], scene: Scene) -> None:
        """Make and start the actuators; CustomCodeFailed if one raises."""
        self._scene = scene
        self._fitted: list[_Fitted] = []
        for group in groups:
            for name, spec in group.body.actuators.items():
                actuator = custom_actuator(spec)
                actuator.scene, actuator.group = scene, group
                label = f"the actuator {name} of {group.name} ({spec.kind})"
                self._fitted.append(_Fitted(label, actuator, group.body.actuator_slices[name]))
                _call(label, actuator.start)
        self.any = bool(self._fitted)
        arenas, robots = len(scene.keys), len(scene.radius_m)
        widths = [sum(spec.width for spec in group.body.actuators.values()) for group in groups]
        self._widths = np.repeat(widths, [group.stop - group.start for group in groups])
        self._index: IntArray = np.tile(np.arange(robots, dtype=np.int64), arenas)
        self.missing: IntArray = np.zeros(arenas, np.int64)
        self._ticks = 0

    def act(self, commands: SparseTable, alive: BoolArray) -> None:
        """Apply the values of robots `alive` (rows,) in a tick.

        CustomCodeFailed if an actuator raises, or leaves numbers that are not finite.
        """
        commands = select_existing(commands, self._widths, alive, self.missing)
        numbers = np.full((len(alive), self._widths.max(initial=0)), np.nan)
        numbers[commands.rows, commands.slot] = commands.value
        for label, actuator, columns in self._fitted:
            in_group = (self._index >= actuator.group.start) & (self._index < actuator.group.stop)
            values = numbers[:, columns]
            rows = np.flatnonzero(in_group & ~np.isnan(values).any(axis=1))
            _call(label, actuator.act, self._ticks, rows, values[rows])
            self._check(label)
        self._ticks += 1

    def _check(self, label: str) -> None:
        """Raise CustomCodeFailed for a number that is not finite; checked per actuator, so that the error names it."""
        for name, values in (("target", self._scene.target), ("charge", self._scene.charge)):
            finite = np.isfinite(values)
            if not finite.all():
                arena, robot = np.argwhere(~finite)[0, :2]
                value = values[arena, robot].tolist()
                expected = f"expected finite numbers in scene.{name}, got {value} of robot {robot} in arena {arena}"
                raise CustomCodeFailed(label, f"act: {expected}")


def _call(label: str, method: Any, *args: Any) -> None:
    try:
        method(*args)
    except (Exception, SystemExit) as error:
        raise CustomCodeFailed(label, traceback.format_exc()) from error
