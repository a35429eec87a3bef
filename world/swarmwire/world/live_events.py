"""Live events: events that users submit to a running simulation.

They are parsed and checked like the events of a scenario. The loop applies them at the next tick. The events of a
scenario are numbered by their index; live events continue these numbers. Every event is recorded before it takes
effect, so that the run can be repeated bit for bit.
"""

import json
import threading
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cache
from typing import Annotated, Any

from pydantic import ValidationError

from swarmwire.comms.base.clock import tick_start_ns, to_s
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.config.ramps import with_number
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.world.event_scheduler import EventProgress
from swarmwire.world.events import ACTIONS
from swarmwire.world.events.event import Event
from swarmwire.world.events.radio_events import Ramp
from swarmwire.world.scenario.faults import fault
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario.schema import Node, OneOf
from swarmwire.world.scenario.tables import ScenarioTable
from swarmwire.world.validation import check_event

KEY = "event"
AT_S = "at_s"


class SubmittedEvent(ScenarioTable):
    """The body of a live event: one event."""

    event: Annotated[Event, OneOf("do", ACTIONS)]


def event_of(table: Mapping[str, Any], scenario: Scenario, bodies: Mapping[str, Body]) -> Event:
    """Return the event of a table with the keys of a scenario's [[events]], except at_s, which is 0 until it begins.

    `bodies` are those of the groups, by name. BadInput names the key within the table and the expected value.
    """
    if AT_S in table:
        raise BadInput("", AT_S, "expected no time: a live event takes effect at the start of the next tick")
    submitted = {KEY: {**deepcopy(dict(table)), AT_S: 0.0}}
    try:
        event = SubmittedEvent.model_validate(submitted).event
        check_event(scenario, bodies, event, KEY, "")
    except ValidationError as error:
        raise _within_table(fault(error, _schema(), "")) from None
    except BadInput as error:
        raise _within_table(error) from None
    return event


def _within_table(error: BadInput) -> BadInput:
    """Return the error with the key within the submitted table."""
    return BadInput("", error.key.removeprefix(KEY).removeprefix("."), error.expected)


@cache
def _schema() -> Node:
    return SubmittedEvent.model_json_schema()


MAX_LISTED = 200
MAX_WAITING = 1000  # events for the next tick, which does not come while the run is paused


@dataclass(frozen=True, slots=True)
class LiveEvent:
    """The begin or the end of a live event at a tick's start."""

    tick: int
    number: int  # number of the event
    table: Mapping[str, Any] | None  # the submitted table; None: the event ends


class LiveEvents:
    """Events that any thread may submit and end; the loop pops them in the order of arrival.

    Attributes:
        progress: progress of all events, updated by the loop.
    """

    def __init__(
        self,
        scenario: Scenario,
        bodies: Mapping[str, Body],
        record: Callable[[LiveEvent], None] = lambda _: None,
        replayed: Sequence[LiveEvent] | None = None,
    ) -> None:
        """Accept events for a scenario; with `replayed`, repeat these events and accept no others.

        `record` stores a begin or end before it happens; it does not happen if `record` raises OSError. BadInput if a
        replayed event does not fit the scenario.
        """
        self._scenario, self._bodies, self._record = scenario, bodies, record
        self._lock = threading.Lock()
        self._next_number = len(scenario.events)
        self._events: dict[int, Event] = dict(enumerate(scenario.events))
        self._texts: dict[int, str] = {}  # descriptions of events, made when first listed
        self._waiting: list[tuple[int, Mapping[str, Any] | None]] = []
        self._dropped: set[int] = set()  # events that never begin: ended before, or not recorded
        self._replayed: dict[int, list[LiveEvent]] | None = None if replayed is None else {}
        for live_event in replayed or ():
            self._add_replayed(live_event)
        self.progress = EventProgress(radio=scenario.radio)

    def submit(self, table: Mapping[str, Any]) -> int:
        """Submit an event for the start of the next tick, a table of a scenario without at_s; return its number.

        An event that sets a number of the radio replaces an earlier live event for the same key. BadInput if the event
        does not fit.
        """
        self._check_open()
        table = _plain(table)
        event = event_of(table, self._scenario, self._bodies)
        with self._lock:
            if event.needs_radio:
                for radio in self._radios():
                    event.check_radio(radio)
            if len(self._waiting) >= MAX_WAITING:
                raise BadInput("", "", f"expected at most {MAX_WAITING} events that wait for a tick; resume the run")
            if isinstance(event, Ramp) and event.over_s == 0.0:
                for earlier in self._earlier_ramps(event.what):
                    self._undo(earlier)
            number = self._next_number
            self._next_number += 1
            self._events[number] = event
            self._waiting.append((number, table))
        return number

    def end(self, number: int) -> None:
        """Undo an event that lasts, at the start of the next tick; BadInput if there is nothing to undo."""
        self._check_open()
        with self._lock:
            event = self._events.get(number)
            if event is None:
                expected = f"a number from 0 to {self._next_number - 1}" if self._events else "an event: there is none"
                raise BadInput("", "event", f"expected {expected}, got {number}")
            if not event.undoable:
                raise BadInput(
                    "", "event", f"expected an event that lasts; {number} is a {event.do}, which happens once"
                )
            if self._is_over(number):
                raise BadInput("", "event", f"expected an active event; {number}, a {event.do}, is over")
            if number < len(self._scenario.events) and number not in self.progress.begin_tick:
                raise BadInput("", "event", f"expected an event that has begun; {number}, a {event.do}, has not")
            self._undo(number)

    def pop_due(self, tick: int, rate_hz: int) -> list[tuple[int, Event | None]]:
        """Return the number and the event of each begin at the start of a tick, and the number and None of each end."""
        if self._replayed is None and not self._waiting:  # most ticks, without the lock
            return []
        with self._lock:
            if self._replayed is not None:
                due = [(live_event.number, live_event.table) for live_event in self._replayed.get(tick, ())]
            else:
                due, self._waiting = self._waiting, []
            events: list[tuple[int, Event | None]] = []
            for number, table in due:
                try:
                    self._record(LiveEvent(tick, number, table))
                except OSError:  # without its record the run could not be repeated
                    if table is not None:  # an event whose end was not recorded continues
                        self._dropped.add(number)
                    continue
                if table is not None:
                    at_s = to_s(tick_start_ns(tick, rate_hz))
                    self._events[number] = replace(self._events[number], at_s=at_s)
                events.append((number, None if table is None else self._events[number]))
            return events

    def listing(self) -> list[dict[str, Any]]:
        """Return the newest events by number: tick of the begin, action, description, and True if `over`.

        `given` is True for live events, False for those of the scenario.
        """
        with self._lock:
            newest = sorted(self._events)[-MAX_LISTED:]
            return [
                {
                    "number": number,
                    "tick": self.progress.begin_tick.get(number),
                    "do": self._events[number].do,
                    "text": self._text(number),
                    "over": self._is_over(number),
                    "given": number >= len(self._scenario.events),
                }
                for number in newest
            ]

    def _text(self, number: int) -> str:
        if number not in self._texts:
            self._texts[number] = self._events[number].words
        return self._texts[number]

    def _radios(self) -> list[Radio]:
        """Return the radio's present parameters, and those at the end of all begun and waiting events."""
        present = final = self.progress.radio
        if present is None or final is None:
            return []
        for number, event in self._events.items():
            counts = number in self.progress.begin_tick or number >= len(self._scenario.events)
            if isinstance(event, Ramp) and counts and not self._is_over(number):
                final = with_number(final, event.what, event.to)
        return [present, final]

    def _earlier_ramps(self, key: str) -> list[int]:
        """Return the numbers of live events that set this number of the radio and are not over."""
        return [
            number
            for number, event in self._events.items()
            if number >= len(self._scenario.events)
            and isinstance(event, Ramp)
            and (event.what, event.over_s) == (key, 0.0)
            and not self._is_over(number)
        ]

    def _is_over(self, number: int) -> bool:
        ends_next = any(waiting == number and table is None for waiting, table in self._waiting)
        return number in self.progress.ended or number in self._dropped or ends_next

    def _undo(self, number: int) -> None:
        """End an event at the next tick; drop it if it waits for its begin."""
        waiting = [item for item in self._waiting if item[0] != number]
        if len(waiting) < len(self._waiting):
            self._waiting = waiting
            self._dropped.add(number)
        else:
            self._waiting.append((number, None))

    def _add_replayed(self, live_event: LiveEvent) -> None:
        assert self._replayed is not None
        number = live_event.number
        if live_event.table is not None:
            where = f"live event {number}"
            if number in self._events or number < 0:
                raise BadInput(where, "", "expected a number that no other event has")
            try:
                self._events[number] = event_of(live_event.table, self._scenario, self._bodies)
            except BadInput as error:
                raise BadInput(where, error.key, error.expected) from None
        self._replayed.setdefault(live_event.tick, []).append(live_event)

    def _check_open(self) -> None:
        if self._replayed is not None:
            raise BadInput("", "", "expected a run, not the repetition of one: nothing new can happen in it")


def _plain(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of a table with the types of its JSON record."""
    try:
        return json.loads(json.dumps(dict(table), allow_nan=False))
    except (TypeError, ValueError):
        raise BadInput("", "", "expected texts, finite numbers, lists and tables alone") from None
