"""Jammers: what sends noise, where, how strong, and when."""

from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray

NO_ROBOT = -1


class Jammers(NamedTuple):
    """A row per jammer and arena: on for `on_ns` of each period, which begins at its phase, and off for the rest."""

    arena: IntArray  # (k,)
    carrier: IntArray  # (k,) robot row with which it moves, or NO_ROBOT
    x_m: FloatArray  # (k,) where it stands, if nobody carries it
    y_m: FloatArray  # (k,)
    power_dbm: FloatArray  # (k,) radiated
    on_ns: IntArray  # (k,)
    period_ns: IntArray  # (k,)
    phase_ns: IntArray  # (k,) 0 to period - 1

    @classmethod
    def none(cls) -> "Jammers":
        """No jammers."""
        whole, real = np.empty(0, np.int64), np.empty(0)
        return cls(whole, whole, real, real, real, whole, whole, whole)

    def followed_by(self, later: "Jammers") -> "Jammers":
        """These and then the later ones."""
        if not len(self.arena):
            return later
        return Jammers._make(np.concatenate(columns) for columns in zip(self, later, strict=True))

    def places(self, pose: FloatArray) -> FloatArray:
        """Where each is while robots stand at `pose` (rows, 3): x and y in m, (k, 2)."""
        own = np.stack([self.x_m, self.y_m], axis=1)
        return np.where((self.carrier == NO_ROBOT)[:, None], own, pose[self.carrier, :2])

    def is_on(self, at_ns: int) -> BoolArray:
        """Which are on at a time, and from it on, (k,)."""
        return (at_ns - self.phase_ns) % self.period_ns < self.on_ns

    @property
    def duty(self) -> FloatArray:
        """The share of time for which each is on, (k,)."""
        return self.on_ns / self.period_ns

    def toggles(self, from_ns: int, until_ns: int) -> tuple[IntArray, IntArray]:
        """When jammers go on or off from `from_ns` on and before `until_ns`, and which, in the order (time, row)."""
        at_ns, which = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
        for row in np.flatnonzero(self.on_ns < self.period_ns).tolist():
            period_ns = self.period_ns[row]
            for first_ns in (self.phase_ns[row], self.phase_ns[row] + self.on_ns[row]):
                start_ns = from_ns + (first_ns - from_ns) % period_ns
                times_ns = np.arange(start_ns, until_ns, period_ns, dtype=np.int64)
                at_ns.append(times_ns)
                which.append(np.full(len(times_ns), row))
        times_ns, rows = np.concatenate(at_ns), np.concatenate(which)
        order = np.lexsort((rows, times_ns))
        return times_ns[order], rows[order]
