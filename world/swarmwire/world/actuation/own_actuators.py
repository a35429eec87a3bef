"""The actuators of the user's own, of all groups: set by agents, and let act in each tick."""

import traceback
from collections.abc import Sequence
from typing import Any

import numpy as np

from swarmwire.comms.arrays import BoolArray, IntArray
from swarmwire.comms.errors import OwnCodeFailed
from swarmwire.comms.tick_io import Actuations
from swarmwire.comms.truth import Group
from swarmwire.world.own.actuator import OwnActuator
from swarmwire.world.own.fitting import made_actuator
from swarmwire.world.sensors.scene import Scene


class OwnActuators:
    """The actuators of the user's own; `any` tells whether there are some.

    Attributes:
        not_there: (arenas,) numbers set for places that the robots' bodies do not have.
    """

    def __init__(self, groups: Sequence[Group], scene: Scene) -> None:
        """Each is started; OwnCodeFailed if one raises."""
        self._scene = scene
        self._fitted: list[tuple[str, OwnActuator, slice]] = []
        for group in groups:
            for name, sheet in group.body.actuators.items():
                own = made_actuator(sheet)
                own.scene, own.group = scene, group
                what = f"the actuator {name} of {group.name} ({sheet.kind})"
                self._fitted.append((what, own, group.body.actuator_places[name]))
                _call(what, own.start)
        self.any = bool(self._fitted)
        arenas, robots = len(scene.keys), len(scene.radius_m)
        places = [sum(sheet.width for sheet in group.body.actuators.values()) for group in groups]
        self._places = np.tile(np.repeat(places, [group.stop - group.start for group in groups]), arenas)
        self._index: IntArray = np.tile(np.arange(robots, dtype=np.int64), arenas)
        self.not_there: IntArray = np.zeros(arenas, np.int64)
        self._robots, self._ticks = robots, 0

    def act(self, actuations: Actuations, alive: BoolArray) -> None:
        """Let those of robots `alive` (rows,) act in a tick; OwnCodeFailed if one raises or leaves inf or nan."""
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
                raise OwnCodeFailed(what, f"act: {said}")


def _call(what: str, method: Any, *args: Any) -> None:
    try:
        method(*args)
    except (Exception, SystemExit) as error:
        raise OwnCodeFailed(what, traceback.format_exc()) from error
