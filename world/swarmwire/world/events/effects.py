"""The active effects of events on robots and radios, and the failures of parts of robots.

`ActiveEffects` holds the effects by event. World and radio medium read from it: which robots are alive, which parts
failed, and, as a `Disruption`, all effects on the medium. Parts fail at once, or at a rate by `Lifetimes`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import reduce

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.base.draws import purpose, uniform
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.config.ramps import ParameterRamp, radio_at
from swarmwire.comms.radio.disruption import ALL, DROP, Disruption, Jammers

BATTERY = "battery"  # the part without which a robot is dead
LIFETIME_PURPOSE = purpose("time to failure")
NEVER_NS = np.iinfo(np.int64).max
HOUR_NS = 3600 * 10**9


class Failures:
    """The failures of one part of some robots.

    Attributes:
        failed: (rows,) True: the part does not work; updated in place.
        next_ns: (rows,) time at which each robot's part fails or recovers; NEVER_NS: it keeps its state.
        lives: (rows,) number of lifetimes drawn so far.
    """

    def __init__(self, part: str, failed: BoolArray) -> None:
        self.part, self.failed = part, failed
        self.next_ns: IntArray = np.full(len(failed), NEVER_NS)
        self.lives: IntArray = np.zeros(len(failed), np.int64)

    def renew(self, rows: BoolArray, now_ns: int) -> None:
        """Restore the part of these robots (rows,); a part that fails at a rate is due for recovery now."""
        failed = rows & self.failed
        fails_at_rate = self.lives > 0
        self.next_ns[failed & fails_at_rate] = now_ns
        self.failed[failed & ~fails_at_rate] = False


@dataclass(frozen=True, slots=True)
class Lifetimes:
    """Times to failure, exponential with a mean of an hour over `per_hour`; drawn for each robot and each life.

    A robot's next life begins when its part recovers. Draws are keyed by robot, event and life, so they depend neither
    on other arenas nor on the length of a tick.
    """

    per_hour: float
    duration_ns: int | None  # duration of each failure; None: permanent
    keys: KeyArray  # (arenas,)
    serial: int  # the event's index in the scenario

    def start(self, part: str, chosen: BoolArray, now_ns: int) -> Failures:
        """Start the first life of the chosen robots (rows,), and return their failures: all parts still work."""
        failures = Failures(part, np.zeros(len(chosen), np.bool_))
        self._draw_lives(failures, chosen, np.full(len(chosen), now_ns))
        return failures

    def advance(self, failures: Failures, now_ns: int) -> None:
        """Apply all failures and recoveries that are due."""
        next_ns = failures.next_ns
        while (due := next_ns <= now_ns).any():
            due_ns = next_ns.copy()
            fails, recovers = due & ~failures.failed, due & failures.failed
            failures.failed ^= due
            next_ns[fails] = NEVER_NS if self.duration_ns is None else due_ns[fails] + self.duration_ns
            self._draw_lives(failures, recovers, due_ns)

    def _draw_lives(self, failures: Failures, robots: BoolArray, start_ns: IntArray) -> None:
        """Draw the next lifetime of these robots (rows,); `start_ns` (rows,) is the time at which it begins."""
        row = np.flatnonzero(robots)
        arena, index = np.divmod(row, len(robots) // len(self.keys))
        u = uniform(self.keys[arena], index, self.serial, failures.lives[row], LIFETIME_PURPOSE)
        life_ns = -portable.log1p(-u) * (HOUR_NS / self.per_hour)
        failures.next_ns[row] = start_ns[row] + np.minimum(life_ns, NEVER_NS // 4).astype(np.int64)
        failures.lives[row] += 1


class ActiveEffects:
    """The effects of all active events; each ends with its event, so overlapping events do not undo one another.

    A robot is dead while any kill applies to it. A radio is off while any blackout applies to it. Two robots are
    partitioned while any partition has them in different sets; a one-way partition stops only packets from the first
    set to the second.
    """

    def __init__(self, rows: int) -> None:
        self.rows = rows  # robots of all arenas
        # All other attributes map an event's index in the scenario to its effect.
        self.kills: dict[int, BoolArray] = {}  # (rows,) dead robots
        self.failures: dict[int, Failures] = {}  # failed parts
        self.blackouts: dict[int, BoolArray] = {}  # (rows,) robots whose radios are off
        self.backlogs: dict[int, int] = {}  # queue policy of each blackout: DROP, NEWEST or ALL
        self.gains: dict[int, FloatArray] = {}  # (2, rows) dB added to sent signals, and to received signals
        self.jammers: dict[int, Jammers] = {}
        self.ramps: dict[int, ParameterRamp] = {}  # sorted by the start of the event
        self.partitions: dict[int, IntArray] = {}  # (rows,) number of each robot's set, from 1; 0: no set
        self.one_way: dict[int, IntArray] = {}  # the same for one-way partitions
        # (rows, 2) m/s added to velocities at once, in the arena's frame
        self.impulses_mps: dict[int, FloatArray] = {}

    def release(self, serial: int) -> None:
        """Remove all effects of the event with this index in the scenario."""
        for name, by_event in vars(self).items():
            if name != "rows":
                by_event.pop(serial, None)

    def pop_impulses(self) -> FloatArray | None:
        """Remove all impulses and return their sum, (rows, 2) in m/s; None if there are none."""
        if not self.impulses_mps:
            return None
        sum_mps = sum(self.impulses_mps.values(), np.zeros((self.rows, 2)))
        self.impulses_mps.clear()
        return sum_mps

    @property
    def alive(self) -> BoolArray:
        """True for robots that are alive, (rows,)."""
        return ~union(self.rows, self.kills.values())

    def failed(self, part: str) -> BoolArray:
        """True for robots whose part failed, (rows,)."""
        return union(self.rows, self.failed_by_event(part).values())

    def failed_by_event(self, part: str) -> dict[int, BoolArray]:
        """True for robots whose part failed, (rows,), by event."""
        return {serial: failures.failed for serial, failures in self.failures.items() if failures.part == part}

    @property
    def failed_parts(self) -> dict[str, BoolArray]:
        """True for robots whose part failed, (rows,), by part."""
        return {part: self.failed(part) for part in dict.fromkeys(failures.part for failures in self.failures.values())}

    @property
    def radio_on(self) -> BoolArray:
        """True for robots whose radios are on, (rows,)."""
        return ~union(self.rows, self.blackouts.values())

    @property
    def backlog(self) -> IntArray:
        """Queue policy of radios that are off, (rows,): the strictest among their blackouts."""
        strictest = np.full(self.rows, ALL)
        for serial, mask in self.blackouts.items():
            strictest[mask] = np.minimum(strictest[mask], self.backlogs[serial])
        return np.where(self.radio_on, DROP, strictest)

    def radio_at(self, radio: Radio, at_ns: int) -> Radio:
        """Return the scenario's radio with all ramps applied up to a time."""
        return radio_at(radio, self.ramps.values(), at_ns) if self.ramps else radio

    def disruption(self) -> Disruption:
        """Return the present effects on the radio medium."""
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

    def _sides(self, sets: dict[int, IntArray]) -> IntArray:
        return np.array(list(sets.values()), np.int64).reshape(-1, self.rows)


def union(rows: int, masks: Iterable[BoolArray]) -> BoolArray:
    """True for robots in any of the masks, (rows,)."""
    any_mask = np.zeros(rows, np.bool_)
    for mask in masks:
        any_mask |= mask
    return any_mask


def exclusive(serial: int, masks: Mapping[int, BoolArray]) -> BoolArray:
    """True for robots in the mask of this event and of no other, (rows,)."""
    mask = masks[serial]
    return mask & ~union(len(mask), (other for event, other in masks.items() if event != serial))
