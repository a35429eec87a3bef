"""The truth of a sensor: its interface, and the `Scene` that sensors read. `pipeline` adds the errors.

Each built-in sensor is declared in `swarmwire.comms.robot.sensors`; its spec names the class of its truth, a
`BuiltInSensor`. The class of a user's sensor is a `CustomSensor`, which declares keys and fields itself.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.base.geometry.ground import Ground
from swarmwire.comms.base.geometry.obstacles import Obstacles
from swarmwire.comms.base.geometry.shapes import Boundary
from swarmwire.comms.base.threads import Threads
from swarmwire.comms.observe.truth import Group, Light
from swarmwire.comms.robot.sensors.sensor import Field, SensorSpec

S = TypeVar("S", bound=SensorSpec)


@dataclass(frozen=True, slots=True)
class Scene:
    """The arenas and the bodies in them; the arrays are those of the physics and always show the present."""

    keys: KeyArray  #: (arenas,)
    size_m: tuple[float, float]  #: full extents of an arena
    boundary: Boundary
    obstacles: Obstacles
    lights: tuple[tuple[Light, ...], ...]  #: lights of each arena
    ground: Ground  #: the floor of all arenas
    tick_s: float
    radius_m: FloatArray  #: (robots,) radius of each robot index
    bottom_m: FloatArray  #: (robots,) height above the floor of the lower end of the body
    top_m: FloatArray  #: (robots,) height of its upper end
    state: FloatArray  #: (arenas, robots, 6) x, y in m, heading in rad (not wrapped), m/s, m/s, rad/s; arena frame
    travel_m: FloatArray  #: (arenas, robots, 2) travel of the left and right wheel since the start
    touched: FloatArray  #: (arenas, robots) 1 if it touched anything in the tick before, else 0
    target: FloatArray  #: (arenas, robots, 3) target of the engine in the tick before
    alive: BoolArray  #: (arenas, robots) dead robots stand still, and are dark
    running: BoolArray  #: (arenas,) arenas whose robots read their sensors; readings of others are not used
    charge: FloatArray  #: (arenas, robots) charge of the battery, 1 full, 0 empty
    leds: IntArray  #: (arenas, robots, LEDs) 0xRRGGBB, 0 dark
    led_positions_m: FloatArray  #: (robots, LEDs, 3) x ahead, y to the left, z above the body's lower side
    obstacles_move: bool = False  #: True: some can be pushed, and `obstacles` is written to in each tick
    threads: Threads = field(default_factory=Threads)
    shared: dict[str, Any] = field(default_factory=dict[str, Any])  #: memory of custom sensors and actuators


def led_positions_m(groups: tuple[Group, ...], max_leds: int) -> FloatArray:
    """Return `Scene.led_positions_m` of these groups, (robots, max_leds, 3)."""
    positions_m = np.zeros((groups[-1].stop, max_leds, 3))
    for group in groups:
        positions_m[group.start : group.stop, : group.body.led_count] = group.body.led_positions_m
    return positions_m


class Sensor(ABC):
    """The truth of one sensor of one group, in all arenas, without any error of the sensor.

    The world sets `scene` and `group`, calls `start` once, and then in each tick either `truth` or `follow`.
    """

    scene: Scene  #: the arenas and all bodies, from `start` on
    group: Group  #: the robots with this sensor: indices `group.start` to `group.stop` - 1 in each arena

    @property
    @abstractmethod
    def fields(self) -> Sequence[Field]:
        """The fields of a reading."""

    @abstractmethod
    def truth(self, tick: int) -> FloatArray | Sequence[FloatArray]:
        """Return the truth of each field, (arenas, n) or (arenas, n, width); a single array for a single field.

        The arrays are C-contiguous and may be written to. A value must depend only on the robot's arena, its index and
        the tick: then an arena is the same alone and among others.
        """

    def start(self) -> None:  # noqa: B027 - a hook that may stay empty
        """Prepare the sensor; called once, before the first tick."""

    def follow(self, tick: int) -> None:  # noqa: B027 - a hook that may stay empty
        """Update values that accumulate; called in place of `truth` in ticks without a reading."""

    @property
    def pose(self) -> FloatArray:
        """Poses of the group's robots, (arenas, n, 3): x, y in m, heading in rad, not wrapped; arena frame."""
        return self.scene.state[:, self.group.start : self.group.stop, :3]


class BuiltInSensor(Sensor, Generic[S]):
    """The truth of a sensor with a spec, which has its keys and declares its fields."""

    def __init__(self, spec: S) -> None:
        self.spec = spec

    @property
    def fields(self) -> Sequence[Field]:
        """The fields of the spec."""
        return self.spec.reading_fields()


class CustomSensor(Sensor):
    """The truth of a user's sensor. Subclasses are dataclasses: fields made by `parameter` are keys.

    One instance serves all robots of a group, in all arenas. Noise and range are part of its `fields`; rate, delay and
    drop-out are keys of the body's sheet. Its `fields` are read before there is a scene.
    """
