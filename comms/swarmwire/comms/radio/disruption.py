"""Disruptions of the medium: dead robots, radios that are off, partitions, gain changes and jammers."""

from dataclasses import dataclass, fields
from typing import NamedTuple, Self

import numpy as np

from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.base.sentinels import NO_ROBOT


class Jammers(NamedTuple):
    """Noise sources, a row per jammer and arena: on for `on_ns` of each period, which starts at its phase."""

    arena: IntArray  # (k,)
    carrier: IntArray  # (k,) robot row that carries it, or NO_ROBOT
    x_m: FloatArray  # (k,) position, if no robot carries it
    y_m: FloatArray  # (k,)
    power_dbm: FloatArray  # (k,) radiated power
    on_ns: IntArray  # (k,)
    period_ns: IntArray  # (k,)
    phase_ns: IntArray  # (k,) 0 to period - 1

    @classmethod
    def none(cls) -> "Jammers":
        """No jammers."""
        integers, reals = np.empty(0, np.int64), np.empty(0)
        return cls(integers, integers, reals, reals, reals, integers, integers, integers)

    def followed_by(self, later: "Jammers") -> "Jammers":
        """Return these jammers and then the later ones."""
        if not len(self.arena):
            return later
        return Jammers._make(np.concatenate(columns) for columns in zip(self, later, strict=True))

    def positions(self, pose: FloatArray) -> FloatArray:
        """Return the position of each jammer with robots at `pose` (rows, 4): x, y, z in m, (k, 3).

        Those that no robot carries are on the floor.
        """
        fixed = np.stack([self.x_m, self.y_m, np.zeros(len(self.x_m))], axis=1)
        return np.where((self.carrier == NO_ROBOT)[:, None], fixed, pose[self.carrier][:, [0, 1, 3]])

    def is_on(self, at_ns: int) -> BoolArray:
        """Return True for each jammer that is on from `at_ns` on, (k,)."""
        return (at_ns - self.phase_ns) % self.period_ns < self.on_ns

    @property
    def duty(self) -> FloatArray:
        """Duty cycle: the share of time for which each jammer is on, (k,)."""
        return self.on_ns / self.period_ns

    def toggles(self, from_ns: int, until_ns: int) -> tuple[IntArray, IntArray]:
        """Return the switching times in [`from_ns`, `until_ns`) and the jammers that switch, sorted by (time, row)."""
        at_ns, switching = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
        for row in np.flatnonzero(self.on_ns < self.period_ns).tolist():
            period_ns = self.period_ns[row]
            for first_ns in (self.phase_ns[row], self.phase_ns[row] + self.on_ns[row]):
                start_ns = from_ns + (first_ns - from_ns) % period_ns
                times_ns = np.arange(start_ns, until_ns, period_ns, dtype=np.int64)
                at_ns.append(times_ns)
                switching.append(np.full(len(times_ns), row))
        times_ns, rows = np.concatenate(at_ns), np.concatenate(switching)
        order = np.lexsort((rows, times_ns))
        return times_ns[order], rows[order]


# Backlog policies for packets to send while the radio is off. DROP: they end at the usual pace. NEWEST: the newest
# waits until the radio is on again. ALL: they wait in its queue.
BACKLOGS = ("drop", "newest", "all")
DROP, NEWEST, ALL = range(3)


@dataclass(slots=True)
class Disruption:
    """Robots, radios, partitions, gains and jammers at one time."""

    alive: BoolArray  # (rows,)
    radio_on: BoolArray  # (rows,)
    backlog: IntArray  # (rows,) DROP, NEWEST or ALL: policy while the radio is off
    sides: IntArray  # (partitions, rows) number of each robot's set in each partition, from 1; 0: in none
    one_way: IntArray  # (partitions, rows) as `sides`, of partitions in which only set 2 does not receive from set 1
    send_gain_db: FloatArray  # (rows,) added to the power of each frame that a robot sends
    receive_gain_db: FloatArray  # (rows,) added to the power of each frame that a robot receives
    jammers: Jammers

    @classmethod
    def none(cls, rows: int) -> Self:
        """No disruption: all robots alive, all radios on, no partitions."""
        no_sets = np.empty((0, rows), np.int64)
        return cls(
            alive=np.ones(rows, np.bool_),
            radio_on=np.ones(rows, np.bool_),
            backlog=np.full(rows, DROP),
            sides=no_sets,
            one_way=no_sets,
            send_gain_db=np.zeros(rows),
            receive_gain_db=np.zeros(rows),
            jammers=Jammers.none(),
        )

    @property
    def is_active(self) -> bool:
        """True if any robot is dead, any radio off, or any partition active."""
        return len(self.sides) + len(self.one_way) > 0 or self.has_outages

    @property
    def has_outages(self) -> bool:
        """True if any robot is dead or any radio off."""
        return not (self.alive.all() and self.radio_on.all())

    @property
    def active_backlog(self) -> IntArray:
        """Policy of each radio, (rows,): NEWEST or ALL while packets wait for it to be on again, else DROP."""
        return np.where(self.radio_on | ~self.alive, DROP, self.backlog)

    def separates(self, sender: IntArray, receiver: IntArray) -> BoolArray:
        """Return True where a partition separates a sender from its receiver, robot rows, (k,)."""
        separated = np.zeros(len(sender), np.bool_)
        for side in self.sides:
            separated |= (side[sender] != side[receiver]) & (side[sender] > 0) & (side[receiver] > 0)
        for side in self.one_way:
            separated |= (side[sender] == 1) & (side[receiver] == 2)
        return separated

    def connects(self, a: IntArray, b: IntArray) -> BoolArray:
        """Return True for each pair of robot rows whose radios are on and that no partition separates, (k,)."""
        return self.radio_on[a] & self.radio_on[b] & ~self.separates(a, b) & ~self.separates(b, a)


class Cuts(NamedTuple):
    """Columns of a `Disruption` as input of kernels."""

    alive: BoolArray
    radio_on: BoolArray
    sides: IntArray
    one_way: IntArray


class ActiveDisruption(Disruption):
    """The disruption that the parts of a medium share; it changes by `update` alone, and so caches its properties.

    Attributes:
        cuts: the columns that end links.
    """

    __slots__ = ("_has_outages", "_is_active", "cuts")

    @classmethod
    def none(cls, rows: int) -> Self:
        """No disruption, until an `update`."""
        active = super().none(rows)
        active.update(active, active.alive)
        return active

    def update(self, other: Disruption, alive: BoolArray) -> None:
        """Set all fields to those of `other`, but `alive` (rows,); the arrays are shared."""
        for column in fields(other):
            setattr(self, column.name, getattr(other, column.name))
        self.alive = alive
        self._has_outages = super().has_outages
        self._is_active = super().is_active
        self.cuts = Cuts(alive, self.radio_on, self.sides, self.one_way)

    @property
    def has_outages(self) -> bool:
        """True if any robot is dead or any radio off."""
        return self._has_outages

    @property
    def is_active(self) -> bool:
        """True if any robot is dead, any radio off, or any partition active."""
        return self._is_active
