"""Custom actuators: the base class, and how the world runs it."""

from abc import ABC, abstractmethod

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.sensor import Scene


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
        """Do what agents set it to in a tick, before bodies move; called in every tick, also for nobody.

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
