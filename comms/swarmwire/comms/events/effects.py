"""Parts of robots that fail, at once or one after the other at a rate, and may be mended."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import reduce

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray, KeyArray
from swarmwire.comms.draws import purpose, uniform
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.config.ramps import ParameterRamp, radio_at
from swarmwire.comms.radio.disruption import ALL, DROP, Disruption, Jammers

BATTERY = "battery"  # the part without which a robot is dead
LIFETIME = purpose("time to failure")
NEVER_NS = np.iinfo(np.int64).max
HOUR_NS = 3600 * 10**9


class Failures:
    """A part of some robots that does not work.

    Attributes:
        failed: (rows,) written in place.
        next_ns: (rows,) when each robot's part fails or works again by itself; NEVER_NS: it stays as it is.
        lives: (rows,) how many times to failure were drawn.
    """

    def __init__(self, part: str, failed: BoolArray) -> None:
        self.part, self.failed = part, failed
        self.next_ns: IntArray = np.full(len(failed), NEVER_NS)
        self.lives: IntArray = np.zeros(len(failed), np.int64)

    def renew(self, rows: BoolArray, now_ns: int) -> None:
        """Let the part of these robots (rows,) work again; one that fails at a rate is due to be mended now."""
        down = rows & self.failed
        at_rate = self.lives > 0
        self.next_ns[down & at_rate] = now_ns
        self.failed[down & ~at_rate] = False


@dataclass(frozen=True, slots=True)
class Lifetimes:
    """Times to failure, exponential with a mean of an hour over `per_hour`; drawn for each robot and each of its lives.

    Keyed by robot, event and life, so that neither other arenas nor the length of a tick matter.
    """

    per_hour: float
    lasts_ns: int | None  # of each failure; None: for good
    keys: KeyArray  # (arenas,)
    serial: int  # the event's place in the scenario

    def begun(self, part: str, chosen: BoolArray, now_ns: int) -> Failures:
        """The robots chosen (rows,), all of them working."""
        failing = Failures(part, np.zeros(len(chosen), np.bool_))
        self._live(failing, chosen, np.full(len(chosen), now_ns))
        return failing

    def go_on(self, failing: Failures, now_ns: int) -> None:
        """Let fail and be mended whatever is due by now."""
        next_ns = failing.next_ns
        while (due := next_ns <= now_ns).any():
            at_ns = next_ns.copy()
            falls, mended = due & ~failing.failed, due & failing.failed
            failing.failed ^= due
            next_ns[falls] = NEVER_NS if self.lasts_ns is None else at_ns[falls] + self.lasts_ns
            self._live(failing, mended, at_ns)

    def _live(self, failing: Failures, rows: BoolArray, from_ns: IntArray) -> None:
        """Draw the next lifetime of these robots."""
        row = np.flatnonzero(rows)
        robots = len(rows) // len(self.keys)
        share = uniform(self.keys[row // robots], row % robots, self.serial, failing.lives[row], LIFETIME)
        life_ns = -np.log1p(-share) * (HOUR_NS / self.per_hour)
        failing.next_ns[row] = from_ns[row] + np.minimum(life_ns, NEVER_NS // 4).astype(np.int64)
        failing.lives[row] += 1


# --- What events hold over robots and radios now, by the event that does.


class ActiveEffects:
    """Each event holds what it holds until it ends, so those that overlap do not undo one another.

    A robot is dead while any kill holds it; a radio is off while any blackout does; two robots are apart while any
    partition has them in different sets; a one-way partition keeps only what the first sends from the second.
    """

    def __init__(self, rows: int) -> None:
        self.rows = rows  # robots of all arenas
        # All else is by event: what stands under its place in the scenario.
        self.kills: dict[int, BoolArray] = {}  # (rows,) robots held dead
        self.failures: dict[int, Failures] = {}  # parts that do not work
        self.blackouts: dict[int, BoolArray] = {}  # (rows,) robots whose radios are held off
        self.backlogs: dict[int, int] = {}  # by blackout: DROP, NEWEST or ALL
        self.gains: dict[int, FloatArray] = {}  # (2, rows) dB added to what robots send, and to what they hear
        self.jammers: dict[int, Jammers] = {}
        self.slopes: dict[int, ParameterRamp] = {}  # in the order in which they began
        self.partitions: dict[int, IntArray] = {}  # (rows,) each robot's set, from 1; 0: in none
        self.one_way: dict[int, IntArray] = {}  # (rows,) the same, where the second does not hear the first
        self.impulses_mps: dict[
            int, FloatArray
        ] = {}  # (rows, 2) m/s that velocities change by at once, in the arena's frame

    def let_go(self, serial: int) -> None:
        """The event at this place in the scenario holds nothing any more."""
        for name, held in vars(self).items():
            if name != "rows":
                held.pop(serial, None)

    def take_impulses(self) -> FloatArray | None:
        """What all velocities change by now, (rows, 2) in m/s; None: nothing. It is taken once."""
        if not self.impulses_mps:
            return None
        by_mps = sum(self.impulses_mps.values(), np.zeros((self.rows, 2)))
        self.impulses_mps.clear()
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
        """All that matters to the medium, as it is now."""
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
