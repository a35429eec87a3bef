"""The active effects of events on robots and radios, and the failures of parts of robots.

`ActiveEffects` holds the effects by event. World and radio medium read from it: which robots are alive, which parts
failed, and, as a `Disruption`, all effects on the medium. Parts fail at once, or at a rate by `Lifetimes`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import reduce

import numpy as np

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
        failed: (rows,) True: the part does not work; written in place.
        next_ns: (rows,) time at which each robot's part fails or recovers; NEVER_NS: it keeps its state.
        lives: (rows,) number of times to failure drawn so far.
    """

    def __init__(self, part: str, failed: BoolArray) -> None:
        self.part, self.failed = part, failed
        self.next_ns: IntArray = np.full(len(failed), NEVER_NS)
        self.lives: IntArray = np.zeros(len(failed), np.int64)

    def renew(self, rows: BoolArray, now_ns: int) -> None:
        """Restore the part of these robots (rows,); one that fails at a rate is due for recovery now."""
        down = rows & self.failed
        at_rate = self.lives > 0
        self.next_ns[down & at_rate] = now_ns
        self.failed[down & ~at_rate] = False


@dataclass(frozen=True, slots=True)
class Lifetimes:
    """Times to failure, exponential with a mean of an hour over `per_hour`; drawn for each robot and each of its lives.

    Draws are keyed by robot, event and life, so that they depend neither on other arenas nor on the length of a tick.
    """

    per_hour: float
    lasts_ns: int | None  # duration of each failure; None: permanent
    keys: KeyArray  # (arenas,)
    serial: int  # the event's index in the scenario

    def begun(self, part: str, chosen: BoolArray, now_ns: int) -> Failures:
        """The failures of the chosen robots (rows,) at the start: all parts still work."""
        failing = Failures(part, np.zeros(len(chosen), np.bool_))
        self._live(failing, chosen, np.full(len(chosen), now_ns))
        return failing

    def go_on(self, failing: Failures, now_ns: int) -> None:
        """Apply all failures and recoveries that are due."""
        next_ns = failing.next_ns
        while (due := next_ns <= now_ns).any():
            at_ns = next_ns.copy()
            fails, recovers = due & ~failing.failed, due & failing.failed
            failing.failed ^= due
            next_ns[fails] = NEVER_NS if self.lasts_ns is None else at_ns[fails] + self.lasts_ns
            self._live(failing, recovers, at_ns)

    def _live(self, failing: Failures, rows: BoolArray, from_ns: IntArray) -> None:
        """Draw the next lifetime of these robots."""
        row = np.flatnonzero(rows)
        robots = len(rows) // len(self.keys)
        share = uniform(self.keys[row // robots], row % robots, self.serial, failing.lives[row], LIFETIME_PURPOSE)
        life_ns = -np.log1p(-share) * (HOUR_NS / self.per_hour)
        failing.next_ns[row] = from_ns[row] + np.minimum(life_ns, NEVER_NS // 4).astype(np.int64)
        failing.lives[row] += 1


class ActiveEffects:
    """The effects of all active events; each ends with its event, so overlapping events do not undo one another.

    A robot is dead while any kill applies to it. A radio is off while any blackout applies to it. Two robots are
    partitioned while any partition has them in different sets; a one-way partition stops only packets from the first
    set to the second.
    """

    def __init__(self, rows: int) -> None:
        self.rows = rows  # robots of all arenas
        # All other attributes are by event: its index in the scenario -> its effect.
        self.kills: dict[int, BoolArray] = {}  # (rows,) dead robots
        self.failures: dict[int, Failures] = {}  # failed parts
        self.blackouts: dict[int, BoolArray] = {}  # (rows,) robots whose radios are off
        self.backlogs: dict[int, int] = {}  # by blackout: DROP, NEWEST or ALL
        self.gains: dict[int, FloatArray] = {}  # (2, rows) dB added to sent signals, and to received signals
        self.jammers: dict[int, Jammers] = {}
        self.slopes: dict[int, ParameterRamp] = {}  # in the order in which they began
        self.partitions: dict[int, IntArray] = {}  # (rows,) each robot's set, from 1; 0: in none
        self.one_way: dict[int, IntArray] = {}  # (rows,) the same, for one-way partitions
        # (rows, 2) m/s added to velocities at once, in the arena's frame
        self.impulses_mps: dict[int, FloatArray] = {}

    def release(self, serial: int) -> None:
        """Remove all effects of the event with this index in the scenario."""
        for name, by_event in vars(self).items():
            if name != "rows":
                by_event.pop(serial, None)

    def take_impulses(self) -> FloatArray | None:
        """Remove all impulses and return their sum, (rows, 2) in m/s; None: there are none."""
        if not self.impulses_mps:
            return None
        sum_mps = sum(self.impulses_mps.values(), np.zeros((self.rows, 2)))
        self.impulses_mps.clear()
        return sum_mps

    @property
    def alive(self) -> BoolArray:
        """Which robots are alive, (rows,)."""
        return ~union(self.rows, self.kills.values())

    def failed(self, part: str) -> BoolArray:
        """The robots whose part failed, (rows,)."""
        return union(self.rows, self.failed_by_event(part).values())

    def failed_by_event(self, part: str) -> dict[int, BoolArray]:
        """The robots whose part failed by each event, (rows,) each."""
        return {serial: failing.failed for serial, failing in self.failures.items() if failing.part == part}

    @property
    def failed_parts(self) -> dict[str, BoolArray]:
        """All parts with failures, and the robots whose part failed, (rows,) each."""
        return {part: self.failed(part) for part in dict.fromkeys(each.part for each in self.failures.values())}

    @property
    def radio_on(self) -> BoolArray:
        """Which robots' radios are on, (rows,)."""
        return ~union(self.rows, self.blackouts.values())

    @property
    def backlog(self) -> IntArray:
        """The queue policy of radios that are off, (rows,): the strictest of their blackouts."""
        strictest = np.full(self.rows, ALL)
        for serial, mask in self.blackouts.items():
            strictest[mask] = np.minimum(strictest[mask], self.backlogs[serial])
        return np.where(self.radio_on, DROP, strictest)

    def radio_at(self, radio: Radio, at_ns: int) -> Radio:
        """The scenario's radio with all ramps applied up to a time."""
        return radio_at(radio, self.slopes.values(), at_ns) if self.slopes else radio

    def disruption(self) -> Disruption:
        """The present effects on the radio medium."""
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
    """Robots that are in any of the masks, (rows,)."""
    any_mask = np.zeros(rows, np.bool_)
    for mask in masks:
        any_mask |= mask
    return any_mask


def alone(serial: int, masks: Mapping[int, BoolArray]) -> BoolArray:
    """Robots in the mask of this event and in that of no other, (rows,)."""
    mask = masks[serial]
    return mask & ~union(len(mask), (other for event, other in masks.items() if event != serial))
