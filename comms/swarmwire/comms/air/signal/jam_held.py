"""The jammers under the poses held."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.air.jammers import Jammers
from swarmwire.comms.air.signal.jamming import powers_of
from swarmwire.comms.air.signal.link_table import Surroundings
from swarmwire.comms.air.signal.tables import Jam
from swarmwire.comms.air.stage import Medium
from swarmwire.comms.arrays import FloatArray


class JamHeld:
    """What jammers do to robots, and when."""

    def __init__(self, medium: Medium) -> None:
        self._medium, self._jammers = medium, Jammers.none()
        self._power_mw = np.empty((0, medium.robots))

    @property
    def anything(self) -> bool:
        """Whether there are jammers."""
        return len(self._jammers.arena) > 0

    def move(self, pose: FloatArray, around: Surroundings) -> None:
        """Robots stand at `pose` (rows, 3) from now on, and jammers are those of the disruption that holds."""
        self._jammers = self._medium.disruption.jammers
        self._power_mw = powers_of(self._jammers, pose, self._medium.robots, self._medium.obstacles, around)

    def between(self, from_ns: int, until_ns: int) -> Jam:
        """The jammers as they are just before `from_ns`, and when they go on or off from then to before `until_ns`."""
        at_ns, which = self._jammers.toggles(from_ns, until_ns)
        is_on = self._jammers.is_on(from_ns - 1)
        return Jam(self._jammers.arena, self._power_mw, is_on, at_ns, which, np.zeros(1, np.int64))

    def at_worst(self) -> tuple[FloatArray, FloatArray]:
        """By robot row (rows,): the power in mW with all jammers on, and for what share of time none of them is."""
        arenas = len(self._medium.keys)
        power_mw, clear = np.zeros((arenas, self._medium.robots)), np.ones((arenas, self._medium.robots))
        for jammer, arena in enumerate(self._jammers.arena.tolist()):
            power_mw[arena] += self._power_mw[jammer]
            clear[arena, self._power_mw[jammer] > 0.0] *= 1.0 - self._jammers.duty[jammer]
        return power_mw.ravel(), clear.ravel()
