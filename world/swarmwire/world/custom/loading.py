"""Loading of custom sensors and actuators: classes are found and keys checked before a run.

`CustomActuators` holds the custom actuators of all groups: agents set them, and they act in each tick.
"""

import traceback
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar, cast

import numpy as np

from swarmwire.comms.arrays import BoolArray, IntArray
from swarmwire.comms.bodies.body import Body
from swarmwire.comms.bodies.custom import MAX_WIDTH, CustomActuatorSpec, CustomSensorSpec
from swarmwire.comms.bodies.spec import SensorSpec
from swarmwire.comms.bodies.tables import built
from swarmwire.comms.errors import BadInput, CustomCodeFailed
from swarmwire.comms.plugins import custom_class, entry_points_of
from swarmwire.comms.tick_io import ActuatorCommands
from swarmwire.comms.truth import Group
from swarmwire.world.custom.actuators import CustomActuator
from swarmwire.world.custom.sensors import CustomSensor, field_fault
from swarmwire.world.sensors.sensor import Field, Scene

K = TypeVar("K", CustomSensor, CustomActuator)
SENSORS, ACTUATORS = "swarmwire.sensors", "swarmwire.actuators"  # groups of entry points


def fitted(body: Body, where: str) -> Body:
    """The body with what the classes of its custom sensors and actuators tell agents; BadInput names what is wrong."""
    sensors = {name: _sensor(spec, where, f"sensors.{name}") for name, spec in body.sensors.items()}
    actuators = {name: _actuator(spec, where, f"actuators.{name}") for name, spec in body.actuators.items()}
    return replace(body, sensors=sensors, actuators=actuators)


def made_sensor(spec: CustomSensorSpec) -> CustomSensor:
    """A new instance of the class of a sheet that is `fitted`."""
    return _made(CustomSensor, spec.kind, spec.params, "", "")


def made_actuator(spec: CustomActuatorSpec) -> CustomActuator:
    """A new instance of the class of a sheet that is `fitted`."""
    return _made(CustomActuator, spec.kind, spec.params, "", "")


def _sensor(spec: SensorSpec, where: str, key: str) -> SensorSpec:
    if not isinstance(spec, CustomSensorSpec):
        return spec
    spec = replace(spec, kind=_entry_point(spec.kind, SENSORS))
    own = _made(CustomSensor, spec.kind, spec.params, where, key)
    found: Any = _asked(own, "fields", where, key)
    if not isinstance(found, tuple | list) or not found or not all(isinstance(of, Field) for of in cast(Any, found)):
        raise BadInput(where, f"{key}.kind", f"expected fields as a tuple of Field; {type(own).__name__} has {found!r}")
    fields = cast("tuple[Field, ...]", found)
    names: list[Any] = [of.name for of in fields]
    if not all(isinstance(name, str) and name.isidentifier() for name in names) or len(set(names)) < len(names):
        expected = "expected fields with names of their own, of letters, digits and _"
        raise BadInput(where, f"{key}.kind", f"{expected}; got {', '.join(map(str, names))}")
    for field in fields:
        fault = field_fault(field)
        if fault:
            raise BadInput(where, f"{key}.kind", f"the field {field.name} of {type(own).__name__}: {fault}")
    return replace(spec, fields={of.name: of.width for of in fields})


def _actuator(spec: CustomActuatorSpec, where: str, key: str) -> CustomActuatorSpec:
    spec = replace(spec, kind=_entry_point(spec.kind, ACTUATORS))
    own = _made(CustomActuator, spec.kind, spec.params, where, key)
    width: Any = _asked(own, "width", where, key)
    if type(width) is not int or not 1 <= width <= MAX_WIDTH:
        raise BadInput(
            where, f"{key}.kind", f"expected a width from 1 to {MAX_WIDTH}; {type(own).__name__} has {width!r}"
        )
    return replace(spec, width=width)


def _entry_point(kind: str, group: str) -> str:
    """The "package.module:Class" that an entry point of this name stands for; any other text as it is."""
    found = () if ":" in kind else entry_points_of(group)
    return next((point.value for point in found if point.name == kind), kind)


def _asked(own: object, name: str, where: str, key: str) -> object:
    try:
        return getattr(own, name)
    except Exception as error:
        expected = f"{type(own).__name__}.{name} fails: {type(error).__name__}: {error}"
        raise BadInput(where, f"{key}.kind", expected) from error


def _made(base: type[K], kind: str, params: Mapping[str, Any], where: str, key: str) -> K:
    """An instance of the class `kind` below `base`; BadInput if it is none, or does not take these parameters."""
    found = custom_class(base, kind, where, f"{key}.kind")
    if cast("Any", found).__dataclass_params__.frozen:  # it is told its scene and group
        raise BadInput(where, f"{key}.kind", f"expected a dataclass that is not frozen; {found.__name__} is")
    try:
        return built(found, params, where, key)
    except BadInput:
        raise
    except Exception as error:  # of its own __post_init__
        raise BadInput(where, key, f"{found.__name__} refuses: {type(error).__name__}: {error}") from error


class CustomActuators:
    """The actuators of the user's own; `any` tells whether there are some.

    Attributes:
        not_there: (arenas,) numbers set for places that the robots' bodies do not have.
    """

    def __init__(self, groups: Sequence[Group], scene: Scene) -> None:
        """Each is started; CustomCodeFailed if one raises."""
        self._scene = scene
        self._fitted: list[tuple[str, CustomActuator, slice]] = []
        for group in groups:
            for name, spec in group.body.actuators.items():
                own = made_actuator(spec)
                own.scene, own.group = scene, group
                what = f"the actuator {name} of {group.name} ({spec.kind})"
                self._fitted.append((what, own, group.body.actuator_places[name]))
                _call(what, own.start)
        self.any = bool(self._fitted)
        arenas, robots = len(scene.keys), len(scene.radius_m)
        places = [sum(spec.width for spec in group.body.actuators.values()) for group in groups]
        self._places = np.tile(np.repeat(places, [group.stop - group.start for group in groups]), arenas)
        self._index: IntArray = np.tile(np.arange(robots, dtype=np.int64), arenas)
        self.not_there: IntArray = np.zeros(arenas, np.int64)
        self._robots, self._ticks = robots, 0

    def act(self, actuations: ActuatorCommands, alive: BoolArray) -> None:
        """Let those of robots `alive` (rows,) act in a tick; CustomCodeFailed if one raises or leaves inf or nan."""
        rows, place = actuations.rows, actuations.place
        there = place < self._places[rows]
        np.add.at(self.not_there, rows[~there] // self._robots, 1)
        there &= alive[rows]
        asked = np.full((len(alive), self._places.max(initial=0)), np.nan)
        asked[rows[there], place[there]] = actuations.value[there]
        for what, own, places in self._fitted:
            here = (self._index >= own.group.start) & (self._index < own.group.stop)
            values = asked[:, places]
            set_ = np.flatnonzero(here & ~np.isnan(values).any(axis=1))
            _call(what, own.act, self._ticks, set_, values[set_])
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
