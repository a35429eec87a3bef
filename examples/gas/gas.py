"""A gas leak: a sense and an actuator of one's own, which share what leaks.

The leak is at one place of each arena. Far from obstacles, gas that leaks evenly and is carried away by diffusion and
decay settles to strength x exp(-distance / reach): that is what the sensor tells, in parts of what it is at the leak.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swarmwire.agent import portable
from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.world.custom import CustomActuator, CustomSensor, Field, Noise, Scene, parameter


class Leak:
    """The leak of each arena: created at the first request, then read from `scene.shared`."""

    def __init__(self, arenas: int) -> None:
        self.strength = np.ones(arenas)  # 1 at the start, 0 once it is sealed

    @classmethod
    def shared_in(cls, scene: Scene) -> "Leak":
        """The leak of a scene."""
        return scene.shared.setdefault("leak", cls(len(scene.keys)))


@dataclass
class Gas(CustomSensor):
    """Concentration of the gas where the robot is."""

    x_m: float = parameter(help="where it leaks, arena frame", unit="m")
    y_m: float = parameter(help="where it leaks, arena frame", unit="m")
    reach_m: float = parameter(1.0, help="distance at which the concentration has fallen to 37 %", unit="m", above=0)
    noise: float = parameter(0.0, help="standard deviation of the error", at_least=0)

    @property
    def fields(self) -> Sequence[Field]:
        noise, meaning = Noise("normal", self.noise), "share of the concentration at the leak"
        return (Field("concentration", noise=noise, low=0.0, blank=0.0, help=meaning),)

    def start(self) -> None:
        self.leak = Leak.shared_in(self.scene)

    def truth(self, tick: int) -> FloatArray:
        distance_m = portable.hypot(self.pose[:, :, 0] - self.x_m, self.pose[:, :, 1] - self.y_m)
        return self.leak.strength[:, None] * portable.exp(-distance_m / self.reach_m)


@dataclass
class Sealer(CustomActuator):
    """Closes the leak, bit by bit, as long as the robot stands near it: set to how hard it works, 0 to 1."""

    x_m: float = parameter(help="where it leaks, arena frame", unit="m")
    y_m: float = parameter(help="where it leaks, arena frame", unit="m")
    arm_m: float = parameter(0.3, help="how far it reaches", unit="m", above=0)
    rate_per_s: float = parameter(0.05, help="share of the leak that one robot closes in 1 s", unit="1/s", above=0)

    def start(self) -> None:
        self.leak = Leak.shared_in(self.scene)

    def act(self, tick: int, rows: IntArray, values: FloatArray) -> None:
        arena, robot = self.at(rows)
        position_m: FloatArray = self.scene.state[arena, robot]
        distance_m = portable.hypot(position_m[:, 0] - self.x_m, position_m[:, 1] - self.y_m)
        work = (
            np.where(distance_m <= self.arm_m, np.clip(values[:, 0], 0.0, 1.0), 0.0)
            * self.rate_per_s
            * self.scene.tick_s
        )
        np.subtract.at(self.leak.strength, arena, work)
        np.maximum(self.leak.strength, 0.0, out=self.leak.strength)
