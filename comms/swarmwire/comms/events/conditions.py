"""What events hold over robots and radios now, by the event that does."""

from collections.abc import Iterable, Mapping
from functools import reduce

import numpy as np

from swarmwire.comms.air.disruption import ALL, DROP, Disruption
from swarmwire.comms.air.jammers import Jammers
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.air.tuning import Slope, radio_at
from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.events.failing import Failing


class Conditions:
    """Each event holds what it holds until it ends, so those that overlap do not undo one another.

    A robot is dead while any kill holds it; a radio is off while any blackout does; two robots are apart while any
    partition has them in different sets; a one-way partition keeps only what the first sends from the second.
    """

    def __init__(self, rows: int) -> None:
        self.rows = rows  # robots of all arenas
        # All else is by event: what stands under its place in the scenario.
        self.kills: dict[int, BoolArray] = {}  # (rows,) robots held dead
        self.failures: dict[int, Failing] = {}  # parts that do not work
        self.blackouts: dict[int, BoolArray] = {}  # (rows,) robots whose radios are held off
        self.backlogs: dict[int, int] = {}  # by blackout: DROP, NEWEST or ALL
        self.gains: dict[int, FloatArray] = {}  # (2, rows) dB added to what robots send, and to what they hear
        self.jammers: dict[int, Jammers] = {}
        self.slopes: dict[int, Slope] = {}  # in the order in which they began
        self.partitions: dict[int, IntArray] = {}  # (rows,) each robot's set, from 1; 0: in none
        self.one_way: dict[int, IntArray] = {}  # (rows,) the same, where the second does not hear the first
        self.pushes: dict[int, FloatArray] = {}  # (rows, 2) m/s that velocities change by at once, in the arena's frame

    def let_go(self, serial: int) -> None:
        """The event at this place in the scenario holds nothing any more."""
        for name, held in vars(self).items():
            if name != "rows":
                held.pop(serial, None)

    def take_pushes(self) -> FloatArray | None:
        """What all velocities change by now, (rows, 2) in m/s; None: nothing. It is taken once."""
        if not self.pushes:
            return None
        by_mps = sum(self.pushes.values(), np.zeros((self.rows, 2)))
        self.pushes.clear()
        return by_mps

    @property
    def alive(self) -> BoolArray:
        """Which robots are alive, (rows,)."""
        return ~union(self.rows, self.kills.values())

    def failed(self, part: str) -> BoolArray:
        """Of which robots this part does not work, (rows,)."""
        return union(self.rows, self.failed_by_event(part).values())

    def failed_by_event(self, part: str) -> dict[int, BoolArray]:
        """The robots of which each event holds this part, (rows,) each."""
        return {serial: failing.failed for serial, failing in self.failures.items() if failing.part == part}

    @property
    def failed_parts(self) -> dict[str, BoolArray]:
        """The parts that some robots may lack, and which, (rows,)."""
        return {part: self.failed(part) for part in dict.fromkeys(each.part for each in self.failures.values())}

    @property
    def radio_on(self) -> BoolArray:
        """Which robots' radios are on, (rows,)."""
        return ~union(self.rows, self.blackouts.values())

    @property
    def backlog(self) -> IntArray:
        """What becomes of the packets of radios that are off, (rows,): by the strictest of the blackouts."""
        least = np.full(self.rows, ALL)
        for serial, mask in self.blackouts.items():
            least[mask] = np.minimum(least[mask], self.backlogs[serial])
        return np.where(self.radio_on, DROP, least)

    def radio_at(self, radio: Radio, at_ns: int) -> Radio:
        """What ramps have made of the scenario's radio by a time."""
        return radio_at(radio, self.slopes.values(), at_ns) if self.slopes else radio

    def disruption(self) -> Disruption:
        """All that matters to the air, as it is now."""
        gain_db = sum(self.gains.values(), np.zeros((2, self.rows)))
        return Disruption(
            alive=self.alive,
            radio_on=self.radio_on,
            backlog=self.backlog,
            sides=self._sides(self.partitions),
            one_way=self._sides(self.one_way),
            send_gain_db=gain_db[0],
            receive_gain_db=gain_db[1],
            jammers=reduce(Jammers.followed_by, self.jammers.values(), Jammers.none()),
        )

    def _sides(self, of: dict[int, IntArray]) -> IntArray:
        return np.array(list(of.values()), np.int64).reshape(-1, self.rows)


def union(rows: int, held: Iterable[BoolArray]) -> BoolArray:
    """Robots that any of these holds, (rows,)."""
    found = np.zeros(rows, np.bool_)
    for one in held:
        found |= one
    return found


def alone(serial: int, held: Mapping[int, BoolArray]) -> BoolArray:
    """Robots that one event holds and no other, of those held by event, (rows,)."""
    own = held[serial]
    return own & ~union(len(own), (of for other, of in held.items() if other != serial))
