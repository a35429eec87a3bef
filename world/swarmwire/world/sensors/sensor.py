"""The sensor interface: fields and their truth, and the `Scene` that sensors read. `pipeline` adds the errors."""

from dataclasses import dataclass, field
from math import inf, nan
from typing import Any, Literal, Protocol, runtime_checkable

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.geometry.ground import Ground
from swarmwire.comms.geometry.obstacles import Obstacles
from swarmwire.comms.truth import Boundary, Group, Light


@dataclass(frozen=True, slots=True)
class Noise:
    """An error of `size + relative * |value|`: half the width if uniform, the standard deviation if normal."""

    kind: Literal["uniform", "normal"] = "normal"
    size: float = 0.0  # in the field's unit
    relative: float = 0.0


NO_NOISE = Noise()


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a sense. Values that are not finite (a ray that meets nothing) have no noise and are not clipped."""

    name: str  # "value"
    width: int = 0  # 0: one number per robot, (n,); else (n, width)
    noise: Noise = NO_NOISE
    step: float = 0.0  # rounded to whole multiples of it; 0: not
    low: float = -inf  # clipped to low and high
    high: float = inf
    blank: float = nan  # what a reading reads that is lost
    angle: bool = False  # wrapped to (-pi, pi]
    span: tuple[float, float] | None = None  # where an outlier may lie; None: from low to high


class Sensor(Protocol):
    """One kind of sense of one group, in all arenas, without any error of the sensor."""

    fields: tuple[Field, ...]

    def truth(self, tick: int) -> tuple[FloatArray, ...]:
        """For each field an array of its own, (arenas, n) or (arenas, n, width), C-contiguous, which may be written to.

        A value depends on the robot's own arena, its index and the tick, not on other arenas.
        """
        ...


@runtime_checkable
class Following(Protocol):
    """A sense that adds up what happens from tick to tick, whether or not a reading is taken."""

    def follow(self, tick: int) -> None:
        """Add what the time since the last tick brought; called instead of `truth` where no reading is taken."""
        ...


@dataclass(frozen=True, slots=True)
class Scene:
    """The arenas and the bodies in them; the arrays are the physics' own and always show the present."""

    keys: KeyArray  # (arenas,)
    size_m: tuple[float, float]  # full extents of an arena
    boundary: Boundary
    obstacles: Obstacles
    lights: tuple[tuple[Light, ...], ...]  # of each arena
    ground: Ground  # the floor of all arenas
    tick_s: float
    radius_m: FloatArray  # (robots,) of each robot index
    bottom_m: FloatArray  # (robots,) height above the floor of the lower end of the body
    top_m: FloatArray  # (robots,) of its upper end
    state: FloatArray  # (arenas, robots, 6) x, y in m, heading in rad (not wrapped), velocities; arena frame
    travel_m: FloatArray  # (arenas, robots, 2) rolled by the left and right wheel since the start
    touched: FloatArray  # (arenas, robots) 1 if it touched anything in the tick before, else 0
    target: FloatArray  # (arenas, robots, 3) what the engine was given in the tick before
    alive: BoolArray  # (arenas, robots) the dead stand where they are, dark
    running: BoolArray  # (arenas,) whose robots read their sensors; of others nothing needs to be told
    charge: FloatArray  # (arenas, robots) of the battery, 1 full, 0 empty
    leds: IntArray  # (arenas, robots, most LEDs of a robot) 0xRRGGBB, 0 dark
    led_places_m: FloatArray  # (robots, most LEDs of a robot, 3) x ahead, y to the left, z above the body's lower side
    obstacles_move: bool = False  # some can be pushed: `obstacles` is written to in each tick
    own: dict[str, Any] = field(default_factory=dict[str, Any])  # shared by custom sensors and actuators


def led_places_m(groups: tuple[Group, ...], most: int) -> FloatArray:
    """Where the LEDs of each robot sit, as a scene has them, with room for so many."""
    places = np.zeros((groups[-1].stop, most, 3))
    for group in groups:
        places[group.start : group.stop, : group.body.led_count] = group.body.led_places_m
    return places
