"""What sensors look at, and what every sensor is."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from swarmwire.comms.arrays import FloatArray, KeyArray
from swarmwire.comms.geometry import Obstacles
from swarmwire.comms.truth import Light


@dataclass(frozen=True, slots=True)
class Scene:
    """The arenas and the bodies in them; the arrays are the physics' own and always show the present."""

    keys: KeyArray  # (arenas,)
    size_m: tuple[float, float]  # full extents of an arena
    walled: bool
    obstacles: Obstacles
    lights: tuple[tuple[Light, ...], ...]  # of each arena
    radius_m: FloatArray  # (robots,) of each robot index
    state: FloatArray  # (arenas, robots, 6) x, y in m, heading in rad (not wrapped), velocities; arena frame
    travel_m: FloatArray  # (arenas, robots, 2) rolled by the left and right wheel since the start
    touched: FloatArray  # (arenas, robots) 1 if it touched anything in the tick before, else 0


class Sensor(Protocol):
    """One kind of sense of one group, in all arenas."""

    def read(self, tick: int) -> dict[str, FloatArray]:
        """Fields "sense.field" -> (n,) or (n, width), a row per robot of the group, arena by arena.

        Called once in each tick in which the group acts. A value depends on the robot's own arena, its index and the
        tick, not on other arenas.
        """
        ...


@runtime_checkable
class Accumulating(Protocol):
    """A sensor that adds up what happens from tick to tick, whether or not its group acts."""

    def follow(self, tick: int) -> None:
        """Add what the time since the last tick brought; called instead of `read` where the group does not act."""
        ...
