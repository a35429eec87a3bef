"""What a sense is to the world: its fields, and the truth about them. What goes wrong with it is left to the stages."""

from dataclasses import dataclass
from math import inf, nan
from typing import Literal, Protocol, runtime_checkable

from swarmwire.comms.arrays import FloatArray


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


class TrueSense(Protocol):
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
