"""The observers of a run, in the order of their stages, and the observers that every run has."""

import traceback
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import ExitStack, contextmanager
from enum import IntEnum, auto
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.clock import Clock, to_ns
from swarmwire.comms.base.errors import SwarmwireError
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import BATTERY_EMPTY, Static, Truth
from swarmwire.comms.radio.records import PacketCounts, ReceptionRecords, TransmissionRecords
from swarmwire.comms.robot.packets import Fate
from swarmwire.deploy.machine import refusal, return_memory
from swarmwire.metrics.text import abbreviate

RETURN_INTERVAL_S = 60.0
MAX_REPORTS, MAX_NAMES = 10, 6  # reports of empty batteries, and robots that a report names


class ObserverStage(IntEnum):
    """The order in which observers see a tick; within a stage it is the order of the list."""

    MEASUREMENT = auto()  # values of the tick, which later stages read
    STATUS = auto()  # status for remote control, which views query
    SUMMARY = auto()  # entries of the summary
    WARNING = auto()
    RECORD = auto()  # files of the run folder
    PUBLICATION = auto()  # live.json, which the caller's observers read
    CALLER = auto()
    PROGRAMS = auto()  # programs of robots, which start once all others have begun, and warnings that end the output


GUARDED = (
    ObserverStage.WARNING,
    ObserverStage.RECORD,
    ObserverStage.PUBLICATION,
    ObserverStage.CALLER,
)  # stages whose failure does not end the run


class StagedObserver(NamedTuple):
    """An observer and its stage."""

    stage: ObserverStage
    observer: Observer


class RunObservers:
    """All observers of a run.

    Attributes:
        ordered: the observers in the order in which they see each tick.
    """

    def __init__(self, staged: Iterable[StagedObserver], report: Callable[[str], None]) -> None:
        """Order the observers by stage, and guard those of `GUARDED`; `report` receives their failures."""
        in_order = sorted(staged, key=lambda entry: entry.stage)
        self._staged = [
            StagedObserver(stage, Guarded(observer, report) if stage in GUARDED else observer)
            for stage, observer in in_order
        ]
        self.ordered = [observer for _, observer in self._staged]

    @contextmanager
    def begin(self, static: Static, *, agents_join: bool) -> Generator[None]:
        """Begin all observers after the context, in which the agents start.

        If agents join from elsewhere, observers with `before_agents` begin before the context.
        """
        early = [observer for observer in self.ordered if observer.before_agents] if agents_join else []
        with ExitStack() as unless_started:
            for observer in early:
                observer.begin(static)
                unless_started.callback(observer.end, None)
            yield
            unless_started.pop_all()
        for observer in self.ordered:
            if observer not in early:
                observer.begin(static)

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """End all observers; return their entries of the summary."""
        entries: dict[str, Any] = {}
        for observer in self.ordered:
            entries.update(observer.end(last))
        return entries

    def failures(self) -> dict[str, int]:
        """Return the failed observers as counts of the summary."""
        return {f"observer_failed_{observer.name}": 1 for _, observer in self._failed()}

    def failed_records(self) -> list[str]:
        """Return the names of the observers that failed to fill the run folder."""
        return [observer.name for stage, observer in self._failed() if stage == ObserverStage.RECORD]

    def _failed(self) -> list[tuple[ObserverStage, "Guarded"]]:
        return [
            (stage, observer)
            for stage, observer in self._staged
            if isinstance(observer, Guarded) and observer.has_failed
        ]


class Guarded(Observer):
    """An observer that is reported and left out once it raises; the run continues."""

    def __init__(self, observer: Observer, report: Callable[[str], None]) -> None:
        self._observer, self._report = observer, report
        self.has_failed, self.before_agents = False, observer.before_agents

    @property
    def name(self) -> str:
        """Name of the observer's class."""
        return type(self._observer).__name__

    def begin(self, static: Static) -> None:
        """Begin the observer."""
        self._try(lambda: self._observer.begin(static))

    def see(self, truth: Truth) -> None:
        """Show a tick, unless the observer has failed."""
        if not self.has_failed:
            self._try(lambda: self._observer.see(truth))

    def see_last(self, departed: TransmissionRecords, finished: ReceptionRecords) -> None:
        """Show the last packets, unless the observer has failed."""
        if not self.has_failed:
            self._try(lambda: self._observer.see_last(departed, finished))

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """End the observer; one that has failed may still close its files."""
        return self._try(lambda: self._observer.end(last)) or {}

    def _try(self, call: Callable[[], Any]) -> Any:
        try:
            return call()
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # noqa: BLE001 - the run continues; rich exits without a reader, polars panics
            if not self.has_failed:
                self._report(f"observer {self.name} failed:{_reason(error)}")
            self.has_failed = True
            return None


def _reason(error: BaseException) -> str:
    """Return a line for a fault of the machine or the input, else the traceback."""
    text = str(error) if isinstance(error, SwarmwireError) else refusal(error)
    return f" {text}; the run continues without it" if text else f"\n{traceback.format_exc()}"


class TooLarge(Observer):
    """Observer that warns once of a packet above the medium's largest payload, which is never sent."""

    def __init__(self, report: Callable[[str], None]) -> None:
        self._report = report
        self._is_reported = False
        self._names: Sequence[str] = ()

    def begin(self, static: Static) -> None:
        """Read the robots' names."""
        self._names = static.robot_names

    def see(self, truth: Truth) -> None:
        """Warn of the first such packet."""
        if self._is_reported or truth.finished is None or truth.tally is None:
            return
        if truth.tally.fates[:, Fate.TOO_LARGE].any():
            finished, self._is_reported = truth.finished, True
            first = int(np.flatnonzero(finished.fate == Fate.TOO_LARGE)[0])
            name, size_bytes = self._names[int(finished.sender[first])], finished.size_bytes[first]
            self._report(f"{name} sent {size_bytes} bytes, more than radio.max_payload_bytes: never on air (too_large)")


class EmptyBatteries(Observer):
    """Observer that reports robots whose batteries end and that are dead from then on, up to `MAX_REPORTS` times."""

    def __init__(self, report: Callable[[str], None]) -> None:
        self._report = report
        self._reports = 0
        self._names: list[str] = []

    def begin(self, static: Static) -> None:
        """Name the robots of all arenas."""
        self._names = [
            name if static.arenas == 1 else f"{name} (seed {seed})"
            for seed in static.seeds
            for name in static.robot_names
        ]

    def see(self, truth: Truth) -> None:
        """Report the batteries that end in this tick."""
        for event in truth.events:
            if event.do != BATTERY_EMPTY or self._reports > MAX_REPORTS:
                continue
            self._reports += 1
            if self._reports > MAX_REPORTS:
                self._report("more batteries end: see `events` in the summary")
            else:
                robots = abbreviate([self._names[row] for row in np.flatnonzero(event.changed)], MAX_NAMES)
                self._report(f"at {event.at_s:g} s the battery ends, and the robot is dead: {robots}")


class MemoryReturn(Observer):
    """Observer that returns freed memory to the system once a minute; else a recorded run grows for hours."""

    def __init__(self, clock: Clock) -> None:
        self._clock, self._due_ns = clock, clock.now_ns() + to_ns(RETURN_INTERVAL_S)

    def see(self, truth: Truth) -> None:
        """Return the memory if it is due."""
        if (now_ns := self._clock.now_ns()) >= self._due_ns:
            return_memory()
            self._due_ns = now_ns + to_ns(RETURN_INTERVAL_S)
