"""What a run comes to, for comparing runs: by name, one number each."""

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import Static, Truth
from swarmwire.deploy import ArenaResult

METRICS = {
    "order": "final",
    "mean order": "mean",
    "min_gap": "mean",
    "target_best": "final",
    "target_mean": "final",
    "collisions": "final",
    "wall_contacts": "final",
}

COUNTS = ("collisions", "wall_contacts")


class Speeds(Observer):
    """Observer that knows how fast robots were on average, and how fast they turned."""

    def begin(self, static: Static) -> None:
        self.static, self.ticks = static, 0
        self.moved = np.zeros((2, static.arenas))

    def see(self, truth: Truth) -> None:
        of = truth.velocity.reshape(self.static.arenas, -1, 3)
        self.moved += np.stack([np.hypot(of[..., 0], of[..., 1]).mean(1), np.abs(of[..., 2]).mean(1)])
        self.ticks += 1

    def of(self, arena: int) -> dict[str, float]:
        """Mean speed in m/s and mean turn rate in rad/s of the robots of an arena."""
        speed, turn = self.moved[:, arena] / self.ticks
        return {"speed": float(speed), "turn": float(turn)}


def measured(arena: ArenaResult, speeds: dict[str, float]) -> dict[str, float]:
    """All numbers that the run has."""
    found = dict(speeds)
    for name, which in METRICS.items():
        value = getattr(arena.metrics[name.removeprefix("mean ")], which)
        if value is not None:
            found[name] = value
    return found


def outside(found: dict[str, float], spread: dict[str, FloatArray], names: tuple[str, ...]) -> list[str]:
    """Which of these numbers lie outside the range of `spread`, told.

    The range is widened on either side by its width, or by a tenth of its highest value, if that is more.

    If a number is drawn as those of the spread are, one of twenty seeds, it lies outside of their range with a
    probability of 2 in 21, and outside of the widened one with one of 2e-3 if it is normal. Counts may be two more.
    """
    told: list[str] = []
    for name in names:
        low, high = float(spread[name].min()), float(spread[name].max())
        more = high - low + 2.0 if name in COUNTS else max(high - low, 0.1 * high)
        if not low - more <= found[name] <= high + more:
            told.append(f"{name} is {found[name]:.4g}, expected {low:.4g} to {high:.4g}, and {more:.4g} beyond at most")
    return told
