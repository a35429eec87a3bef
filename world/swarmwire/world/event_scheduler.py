"""The event scheduler: events that are due at the start of a tick change the world, and what holds in the medium."""

from bisect import insort
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import KeyArray
from swarmwire.comms.base.clock import NS_PER_S, to_ns, to_s
from swarmwire.comms.observe.truth import BATTERY_EMPTY, NO_SERIAL, EventRecord, Static
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.world.events.effects import ActiveEffects
from swarmwire.world.events.event import Event
from swarmwire.world.events.selection import Swarm
from swarmwire.world.world import World


@dataclass
class EventProgress:
    """How far the events of a run have come, by number; the loop writes it, others may look."""

    begun: dict[int, int] = field(default_factory=dict[int, int])  # the tick at whose start each one began
    over: set[int] = field(default_factory=set[int])  # those that happen once, and those that were undone
    radio: Radio | None = None  # as events have made it by now


class Effects(NamedTuple):
    """What the events of one tick did."""

    records: tuple[EventRecord, ...]  # in order
    disruption: Disruption | None  # of the radio medium from this tick on; None: unchanged
    radio: Radio | None  # the radio's parameters from this tick on; None: unchanged


class EventScheduler:
    """The events of a run in order of time; at equal times those that end come first, then by number.

    The number of an event is its place in the scenario; live events have higher ones.
    """

    def __init__(
        self,
        events: Sequence[Event],
        static: Static,
        keys: KeyArray,
        radio: Radio | None = None,
        progress: EventProgress | None = None,
    ) -> None:
        """`radio` is the scenario's; `progress` is told how far the events have come."""
        self._events = dict(enumerate(events))
        self._progress, self._rate_hz = progress or EventProgress(), static.rate_hz
        groups = {group.name: range(group.start, group.stop) for group in static.groups}
        rows = len(keys) * static.robots
        self._swarm = Swarm(groups, static.robots, keys, np.zeros((rows, 3)))
        self._radio = self._progress.radio = radio
        self._conditions = ActiveEffects(self._swarm.rows)
        self._evolving: list[int] = []  # numbers of events that go on changing things
        self._coming: list[tuple[int, bool, int]] = []  # in order: time in ns, whether it begins, number
        for serial, event in self._events.items():
            self._plan(serial, event, to_ns(event.at_s))

    def begin(self, serial: int, event: Event, start_ns: int) -> None:
        """Have an event begin in the tick that starts then, in ns, which is about to be applied."""
        self._events[serial] = event
        self._plan(serial, event, start_ns)

    def end(self, serial: int, start_ns: int) -> None:
        """Undo an event in the tick that starts then, instead of at its own time; none if it is over by then."""
        self._coming = [item for item in self._coming if item[2] != serial or item[1]]
        if serial in self._progress.begun and serial not in self._progress.over:
            insort(self._coming, (start_ns, False, serial))

    def apply(self, start_ns: int, world: World) -> Effects:
        """Apply to the world what is due by the start of a tick, in ns, and return what holds from then on."""
        happened: list[EventRecord] = []
        if world.batteries.any:  # first, so that who is revived in this tick is not found empty
            happened.extend(self._run_down(start_ns, world))
        if self._evolving or (self._coming and self._coming[0][0] <= start_ns):
            self._swarm = replace(self._swarm, pose=world.pose)
        while self._coming and self._coming[0][0] <= start_ns:
            _, begins, serial = self._coming.pop(0)
            happened.extend(self._happen(serial, begins, start_ns, world))
        for serial in self._evolving:
            happened.extend(self._go_on(serial, start_ns, world))
        if happened:
            world.live(self._conditions.alive)
            world.fail(self._conditions.failed_parts)
            if (by_mps := self._conditions.pop_impulses()) is not None:
                world.apply_impulse(by_mps)
        disruption = self._conditions.disruption() if happened else None
        return Effects(tuple(happened), disruption, self._new_radio(start_ns))

    def _new_radio(self, start_ns: int) -> Radio | None:
        """The radio's parameters from now on; None if the run has no radio, or if they stay."""
        if self._radio is None:
            return None
        radio, known = self._conditions.radio_at(self._radio, start_ns), self._progress.radio
        if radio is known or radio == known:  # mostly the same object, which costs nothing
            return None
        self._progress.radio = radio
        return radio

    def _plan(self, serial: int, event: Event, at_ns: int) -> None:
        insort(self._coming, (at_ns, True, serial))
        if event.duration_s is not None:
            insort(self._coming, (at_ns + to_ns(event.duration_s), False, serial))

    def _happen(self, serial: int, begins: bool, start_ns: int, world: World) -> list[EventRecord]:
        event, conditions = self._events[serial], self._conditions
        if begins:
            # The tick is rounded up, as its start was rounded down to a whole number of ns.
            self._progress.begun[serial] = -(-start_ns * self._rate_hz // NS_PER_S)
        if not begins or not event.undoable:
            self._progress.over.add(serial)
        if event.evolves:
            (self._evolving.append if begins else self._evolving.remove)(serial)
        changed = event.begin(serial, self._swarm, conditions) if begins else event.end(serial, conditions)
        changed = changed & world.rows_running
        if event.evolves and not changed.any():  # what it does is yet to come
            return []
        return [EventRecord(serial, event.at_s, event.do, not begins, changed, event.failing_part)]

    def _run_down(self, start_ns: int, world: World) -> list[EventRecord]:
        """Robots whose battery is empty are dead, from the first tick on that begins so."""
        empty = world.batteries.empty
        known = self._conditions.kills.get(NO_SERIAL, np.zeros_like(empty))
        fell = empty & ~known & world.rows_running
        if not fell.any():
            return []
        self._conditions.kills[NO_SERIAL] = known | fell
        return [EventRecord(NO_SERIAL, to_s(start_ns), BATTERY_EMPTY, False, fell, singly=True)]

    def _go_on(self, serial: int, start_ns: int, world: World) -> list[EventRecord]:
        event, here = self._events[serial], world.rows_running
        began, ended = (rows & here for rows in event.advance(serial, start_ns, self._swarm, self._conditions))
        at_s, part, told = to_s(start_ns), event.failing_part, ((began, False), (ended, True))
        return [EventRecord(serial, at_s, event.do, over, rows, part, True) for rows, over in told if rows.any()]
