"""The jammers under the poses held."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.air.jammers import Jammers
from swarmwire.comms.air.signal.jamming import powers_of
from swarmwire.comms.air.signal.surroundings import Surroundings
from swarmwire.comms.air.signal.tables import Jam
from swarmwire.comms.air.stages.stage import Medium
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
        if not self.anything:
            self._power_mw = np.empty((0, self._medium.robots))
            return
        self._power_mw = powers_of(self._jammers, pose, self._medium.robots, self._medium.obstacles, around)

    def between(self, from_ns: int, until_ns: int) -> Jam:
        """The jammers as they are just before `from_ns`, and when they go on or off from then to before `until_ns`."""
        at_ns, which = self._jammers.toggles(from_ns, until_ns)
        is_on = self._jammers.is_on(from_ns - 1)
        return Jam(self._jammers.arena, self._power_mw, is_on, at_ns, which, np.zeros(1, np.int64))

    def by_robot(self, least_mw: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """By robot row (rows,): the power in mW of jammers that never pause, that of all, and the clear share of time.

        Clear is when none of the others is on; less than `least_mw` of one does not count.
        """
        shape = len(self._medium.keys), self._medium.robots
        steady_mw, all_mw, clear = np.zeros(shape), np.zeros(shape), np.ones(shape)
        for jammer, arena in enumerate(self._jammers.arena.tolist()):
            power_mw, duty = self._power_mw[jammer], self._jammers.duty[jammer]
            all_mw[arena] += power_mw
            if duty == 1.0:
                steady_mw[arena] += power_mw
            else:
                clear[arena, power_mw >= least_mw] *= 1.0 - duty
        return steady_mw.ravel(), all_mw.ravel(), clear.ravel()
