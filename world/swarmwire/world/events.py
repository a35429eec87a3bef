"""The dispatcher of events: what is due at the start of a tick changes world and air before anything else."""

from collections import deque
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from swarmwire.comms.air.air import Air
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.arrays import KeyArray
from swarmwire.comms.clock import to_ns, to_s
from swarmwire.comms.events.conditions import Conditions
from swarmwire.comms.events.event import Event
from swarmwire.comms.events.swarm import Swarm
from swarmwire.comms.truth import Happened, Static
from swarmwire.world.world import World

RUN_DOWN = -1  # in place of an event's place in the scenario: batteries that are empty


class Events:
    """The events of a run in order of time; at equal times those that end come first, then the scenario's order."""

    def __init__(self, events: Sequence[Event], static: Static, keys: KeyArray, radio: Radio | None = None) -> None:
        """`radio` is the scenario's."""
        self._events = tuple(events)
        groups = {group.name: range(group.start, group.stop) for group in static.groups}
        rows = len(keys) * static.robots
        self._swarm = Swarm(groups, static.robots, keys, np.zeros((rows, 3)))
        self._radio = self._tuned = radio
        self._conditions = Conditions(self._swarm.rows)
        self._evolving: list[int] = []  # places in the scenario of events that go on changing things
        due = [(to_ns(event.at_s), True, serial) for serial, event in enumerate(events)]
        for (at_ns, _, serial), event in zip(tuple(due), events, strict=True):
            if event.lasts_s is not None:
                due.append((at_ns + to_ns(event.lasts_s), False, serial))
        self._coming = deque(sorted(due))  # (time in ns, whether it begins, place in the scenario)

    def apply(self, start_ns: int, world: World, air: Air | None) -> tuple[Happened, ...]:
        """Let happen what is due by the start of a tick, in ns; world and air go on under what holds after that."""
        happened: list[Happened] = []
        if world.batteries.any:  # first, so that who is revived in this tick is not found empty
            happened.extend(self._run_down(start_ns, world))
        if self._evolving or (self._coming and self._coming[0][0] <= start_ns):
            self._swarm = replace(self._swarm, pose=world.pose)
        while self._coming and self._coming[0][0] <= start_ns:
            _, begins, serial = self._coming.popleft()
            happened.extend(self._happen(serial, begins, world))
        for serial in self._evolving:
            happened.extend(self._go_on(serial, start_ns, world))
        if happened:
            world.live(self._conditions.alive)
            world.fail(self._conditions.failed_parts)
            if air:
                air.disrupt(self._conditions.disruption())
        if air and self._radio:
            self._tune(air, self._conditions.radio_at(self._radio, start_ns))
        return tuple(happened)

    def _tune(self, air: Air, radio: Radio) -> None:
        if radio is not self._tuned and radio != self._tuned:  # as most often it is the same, which costs nothing
            air.tune(radio)
            self._tuned = radio

    def _happen(self, serial: int, begins: bool, world: World) -> list[Happened]:
        event, conditions = self._events[serial], self._conditions
        if event.evolves:
            self._evolving.append(serial)
        changed = event.begin(serial, self._swarm, conditions) if begins else event.end(serial, conditions)
        changed = changed & world.rows_running
        if event.evolves and not changed.any():  # what it does is yet to come
            return []
        return [Happened(serial, event.at_s, event.do, not begins, changed, event.failing_part)]

    def _run_down(self, start_ns: int, world: World) -> list[Happened]:
        """Robots whose battery is empty are dead, from the first tick on that begins so."""
        empty = world.batteries.empty
        known = self._conditions.kills.get(RUN_DOWN, np.zeros_like(empty))
        fell = empty & ~known & world.rows_running
        if not fell.any():
            return []
        self._conditions.kills[RUN_DOWN] = known | fell
        return [Happened(RUN_DOWN, to_s(start_ns), "run_down", False, fell, singly=True)]

    def _go_on(self, serial: int, start_ns: int, world: World) -> list[Happened]:
        event, here = self._events[serial], world.rows_running
        began, ended = (rows & here for rows in event.go_on(serial, start_ns, self._swarm, self._conditions))
        at_s, part, told = to_s(start_ns), event.failing_part, ((began, False), (ended, True))
        return [Happened(serial, at_s, event.do, over, rows, part, True) for rows, over in told if rows.any()]
