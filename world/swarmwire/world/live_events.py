"""Live events: events that users submit to a running simulation.

They are parsed and checked like the events of a scenario. The loop takes them at the next tick. The events of a
scenario are numbered by their index; live events continue these numbers. Every event is recorded before it takes
effect: with that record a run can be repeated bit for bit.
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
    """The event of a table as in [[events]] of a scenario, but without at_s: it says 0, until it takes effect.

    `bodies` are the groups', by group. BadInput names the key within the table and what was expected.
    """
    if AT_S in table:
        raise BadInput("", AT_S, "expected no time: an event that is given takes effect at the start of the next tick")
    given = {KEY: {**deepcopy(dict(table)), AT_S: 0.0}}
    try:
        event = SubmittedEvent.model_validate(given).event
        check_event(scenario, bodies, event, KEY, "")
    except ValidationError as error:
        raise _as_given(fault(error, _schema(), "")) from None
    except BadInput as error:
        raise _as_given(error) from None
    return event


def _as_given(error: BadInput) -> BadInput:
    return BadInput("", error.key.removeprefix(KEY).removeprefix("."), error.expected)


@cache
def _schema() -> Node:
    return SubmittedEvent.model_json_schema()


MAX_TOLD = 200
MAX_WAITING = 1000  # for the next tick: a run that is paused takes none


@dataclass(frozen=True, slots=True)
class LiveEvent:
    """A live event that begins at a tick's start, or one that ends."""

    tick: int
    number: int  # of the event
    table: Mapping[str, Any] | None  # as it was given; None: the event ends


class LiveEvents:
    """Any thread may give events and end them; the loop takes what has come, in the order in which it came."""

    def __init__(
        self,
        scenario: Scenario,
        bodies: Mapping[str, Body],
        keep: Callable[[LiveEvent], None] = lambda _: None,
        replayed: Sequence[LiveEvent] | None = None,
    ) -> None:
        """`keep` records what is taken, or raises OSError: then it is not taken, and what was to end goes on.

        With `replayed` the run is repeated: it takes these alone, and nothing that people want. BadInput if one of them
        does not fit the scenario.
        """
        self._scenario, self._bodies, self._keep = scenario, bodies, keep
        self._lock = threading.Lock()
        self._next_number = len(scenario.events)
        self._events: dict[int, Event] = dict(enumerate(scenario.events))
        self._texts: dict[int, str] = {}  # of events that were told
        self._waiting: list[tuple[int, Mapping[str, Any] | None]] = []
        self._dropped: set[int] = (
            set()
        )  # events that ended before a tick began, or whose beginning could not be recorded
        self._replayed: dict[int, list[LiveEvent]] | None = None if replayed is None else {}
        for given in replayed or ():
            self._replay(given)
        self.progress = EventProgress(radio=scenario.radio)

    def give(self, table: Mapping[str, Any]) -> int:
        """Have an event happen at the start of the next tick: a table as in a scenario, without at_s. Its number.

        A number of the radio that steps to a value takes the place of one that was given before for the same key.
        BadInput says what is wrong with it.
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
                for before in self._set_before(event.what):
                    self._undo(before)
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
            if number < len(self._scenario.events) and number not in self.progress.begun:
                raise BadInput("", "event", f"expected an event that has begun; {number}, a {event.do}, has not")
            self._undo(number)

    def take(self, tick: int, rate_hz: int) -> list[tuple[int, Event | None]]:
        """What begins and ends at the start of a tick: numbers, with the event or, of one that ends, None."""
        if self._replayed is None and not self._waiting:  # as most often
            return []
        with self._lock:
            if self._replayed is not None:
                due = [(given.number, given.table) for given in self._replayed.get(tick, ())]
            else:
                due, self._waiting = self._waiting, []
            taken: list[tuple[int, Event | None]] = []
            for number, table in due:
                try:
                    self._keep(LiveEvent(tick, number, table))
                except OSError:  # what is not on record would make the run one that cannot be repeated
                    if table is not None:  # else the event goes on
                        self._dropped.add(number)
                    continue
                if table is not None:
                    at_s = to_s(tick_start_ns(tick, rate_hz))
                    self._events[number] = replace(self._events[number], at_s=at_s)
                taken.append((number, None if table is None else self._events[number]))
            return taken

    def told(self) -> list[dict[str, Any]]:
        """The newest events by number: the tick in which each began, if it has, what it does, whether it is over.

        `given` says that people gave it; the others are the scenario's.
        """
        with self._lock:
            newest = sorted(self._events)[-MAX_TOLD:]
            return [
                {
                    "number": number,
                    "tick": self.progress.begun.get(number),
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
        """The radio as events have made it by now, and as those that go on or wait will have made it."""
        now = to_come = self.progress.radio
        if now is None or to_come is None:
            return []
        for number, event in self._events.items():
            known = number in self.progress.begun or number >= len(self._scenario.events)
            if isinstance(event, Ramp) and known and not self._is_over(number):
                to_come = with_number(to_come, event.what, event.to)
        return [now, to_come]

    def _set_before(self, what: str) -> list[int]:
        """Numbers of events that were given and hold this number of the radio at a value."""
        return [
            number
            for number, event in self._events.items()
            if number >= len(self._scenario.events)
            and isinstance(event, Ramp)
            and (event.what, event.over_s) == (what, 0.0)
            and not self._is_over(number)
        ]

    def _is_over(self, number: int) -> bool:
        waits_for_its_end = any(waiting == number and table is None for waiting, table in self._waiting)
        return number in self.progress.over or number in self._dropped or waits_for_its_end

    def _undo(self, number: int) -> None:
        """Have it end; one that still waits for a tick never begins."""
        waiting = [item for item in self._waiting if item[0] != number]
        if len(waiting) < len(self._waiting):
            self._waiting = waiting
            self._dropped.add(number)
        else:
            self._waiting.append((number, None))

    def _replay(self, given: LiveEvent) -> None:
        assert self._replayed is not None
        if given.table is not None:
            where = f"event {given.number} that was given"
            if given.number in self._events or given.number < 0:
                raise BadInput(where, "", "expected a number that no other event has")
            try:
                self._events[given.number] = event_of(given.table, self._scenario, self._bodies)
            except BadInput as error:
                raise BadInput(where, error.key, error.expected) from None
        self._replayed.setdefault(given.tick, []).append(given)

    def _check_open(self) -> None:
        if self._replayed is not None:
            raise BadInput("", "", "expected a run, not the repetition of one: nothing new can happen in it")


def _plain(table: Mapping[str, Any]) -> dict[str, Any]:
    """A copy of a table, as its record will have it."""
    try:
        return json.loads(json.dumps(dict(table), allow_nan=False))
    except (TypeError, ValueError):
        raise BadInput("", "", "expected texts, finite numbers, lists and tables alone") from None
