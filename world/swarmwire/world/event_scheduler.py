"""The event scheduler: events that are due at the start of a tick change the world and the radio medium."""

from bisect import insort
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import KeyArray
from swarmwire.comms.base.clock import NS_PER_S, to_ns, to_s
from swarmwire.comms.base.sentinels import NO_SERIAL
from swarmwire.comms.observe.truth import BATTERY_EMPTY, EventRecord, Static
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import Disruption
from swarmwire.world.events.effects import ActiveEffects
from swarmwire.world.events.event import Event
from swarmwire.world.events.selection import Swarm
from swarmwire.world.world import World


@dataclass
class EventProgress:
    """Progress of the events of a run, by number; the loop writes it, others may read it."""

    begin_tick: dict[int, int] = field(default_factory=dict[int, int])  # the tick at whose start each event began
    ended: set[int] = field(default_factory=set[int])  # events that happen once, and events that were undone
    radio: Radio | None = None  # the present parameters, after all events so far


class Effects(NamedTuple):
    """The effects of the events of one tick."""

    records: tuple[EventRecord, ...]  # one per event, in the order of the events
    disruption: Disruption | None  # disruption of the radio medium from this tick on; None: unchanged
    radio: Radio | None  # the radio's parameters from this tick on; None: unchanged


class EventScheduler:
    """The events of a run in order of time; at equal times, ends come before begins, then by number.

    The number of an event is its index in the scenario; live events have higher numbers.
    """

    def __init__(
        self,
        events: Sequence[Event],
        static: Static,
        keys: KeyArray,
        radio: Radio | None = None,
        progress: EventProgress | None = None,
    ) -> None:
        """Plan the scenario's events, with its `radio`; `progress` is updated."""
        self._events = dict(enumerate(events))
        self._progress, self._rate_hz = progress or EventProgress(), static.rate_hz
        groups = {group.name: range(group.start, group.stop) for group in static.groups}
        rows = len(keys) * static.robots
        self._swarm = Swarm(groups, static.robots, keys, np.zeros((rows, 3)))
        self._radio = self._progress.radio = radio
        self._active = ActiveEffects(self._swarm.rows)
        self._evolving: list[int] = []  # numbers of begun events that change with time
        self._schedule: list[tuple[int, bool, int]] = []  # sorted: time in ns, True for a begin, number
        for number, event in self._events.items():
            self._plan(number, event, to_ns(event.at_s))

    def begin(self, number: int, event: Event, start_ns: int) -> None:
        """Plan the begin of an event at the start of the next tick, in ns."""
        self._events[number] = event
        self._plan(number, event, start_ns)

    def end(self, number: int, start_ns: int) -> None:
        """Plan the end of an event at the start of the next tick, in ns, in place of its planned end."""
        self._schedule = [item for item in self._schedule if item[2] != number or item[1]]
        if number in self._progress.begin_tick and number not in self._progress.ended:
            insort(self._schedule, (start_ns, False, number))

    def apply(self, start_ns: int, world: World) -> Effects:
        """Apply the events that are due by the start of a tick, in ns, to the world, and return their effects."""
        records: list[EventRecord] = []
        if world.batteries.any:  # before the events: a robot revived in this tick gets a full battery first
            records.extend(self._kill_empty(start_ns, world))
        if self._evolving or (self._schedule and self._schedule[0][0] <= start_ns):
            self._swarm = replace(self._swarm, pose=world.pose)
        while self._schedule and self._schedule[0][0] <= start_ns:
            _, begins, number = self._schedule.pop(0)
            records.extend(self._begin_or_end(number, begins, start_ns, world))
        for number in self._evolving:
            records.extend(self._advance(number, start_ns, world))
        if records:
            world.set_alive(self._active.alive)
            world.set_failed(self._active.failed_parts)
            if (by_mps := self._active.pop_impulses()) is not None:
                world.apply_impulse(by_mps)
        disruption = self._active.disruption() if records else None
        return Effects(tuple(records), disruption, self._new_radio(start_ns))

    def _new_radio(self, start_ns: int) -> Radio | None:
        """Return the radio's new parameters; None if they are unchanged, or the run has no radio."""
        if self._radio is None:
            return None
        radio, current = self._active.radio_at(self._radio, start_ns), self._progress.radio
        if radio is current or radio == current:  # `is` saves the comparison in most ticks
            return None
        self._progress.radio = radio
        return radio

    def _plan(self, number: int, event: Event, at_ns: int) -> None:
        insort(self._schedule, (at_ns, True, number))
        if event.duration_s is not None:
            insort(self._schedule, (at_ns + to_ns(event.duration_s), False, number))

    def _begin_or_end(self, number: int, begins: bool, start_ns: int, world: World) -> list[EventRecord]:
        event, active = self._events[number], self._active
        if begins:
            # The tick is rounded up, since its start was rounded down to a whole number of ns.
            self._progress.begin_tick[number] = -(-start_ns * self._rate_hz // NS_PER_S)
        if not begins or not event.undoable:
            self._progress.ended.add(number)
        if event.evolves:
            (self._evolving.append if begins else self._evolving.remove)(number)
        changed = event.begin(number, self._swarm, active) if begins else event.end(number, active)
        changed = changed & world.rows_running
        if event.evolves and not changed.any():  # its first change comes later
            return []
        return [EventRecord(number, event.at_s, event.do, not begins, changed, event.failing_part)]

    def _kill_empty(self, start_ns: int, world: World) -> list[EventRecord]:
        """Kill the robots whose battery is empty at the start of a tick."""
        empty = world.batteries.empty
        dead = self._active.kills.get(NO_SERIAL, np.zeros_like(empty))
        dying = empty & ~dead & world.rows_running
        if not dying.any():
            return []
        self._active.kills[NO_SERIAL] = dead | dying
        return [EventRecord(NO_SERIAL, to_s(start_ns), BATTERY_EMPTY, False, dying, singly=True)]

    def _advance(self, number: int, start_ns: int, world: World) -> list[EventRecord]:
        event, running = self._events[number], world.rows_running
        began, ended = (rows & running for rows in event.advance(number, start_ns, self._swarm, self._active))
        at_s, part, changes = to_s(start_ns), event.failing_part, ((began, False), (ended, True))
        return [EventRecord(number, at_s, event.do, over, rows, part, True) for rows, over in changes if rows.any()]
