"""The observers of a run in one ordered list, and those that every run has."""

import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.comms.base.clock import Clock, to_ns
from swarmwire.comms.base.errors import SwarmwireError
from swarmwire.comms.base.ethernet import FRAME_TAG
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import BATTERY_EMPTY, Static, Truth
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.comms.robot.messages import DICT_TAG, message_classes
from swarmwire.comms.robot.packets import Fate
from swarmwire.deploy.machine import refusal, return_memory
from swarmwire.deploy.runs.gateways.serving import Served, Undriven
from swarmwire.deploy.runs.interfaces import InterfacesLog
from swarmwire.deploy.runs.record.replay_logs import TrajectoryLog
from swarmwire.deploy.runs.wiring import RunParts
from swarmwire.metrics.measures.network.latency import RadioTally
from swarmwire.metrics.pictures.viewer.recording import RerunRecording
from swarmwire.metrics.records.run_folder.events import EventLog
from swarmwire.metrics.records.run_folder.layout import RECORDING
from swarmwire.metrics.records.run_folder.table import RecordOptions
from swarmwire.metrics.records.run_folder.tables import recorders
from swarmwire.metrics.text import some

RETURN_AGAIN_S = 60.0
MAX_REPORTS, NAMED = 10, 6  # of empty batteries, and robots in each


def observers_of(parts: RunParts, watching: Sequence[Observer], served: Served | None) -> list[Observer]:
    """All observers of the run, in the order in which they see each tick; `watching` are those of the caller."""
    say, path = parts.folder.say, parts.folder.path
    others: list[Observer] = [TooLarge(say), EmptyBatteries(say), KeptMemory(parts.clock)]
    records = _recorders(parts, path) if path else []  # after the metrics, whose values of this tick they write
    others += records
    if parts.published:
        others.append(parts.published)  # before the caller's observers: these read the endpoint in live.json
    others += [*parts.config.observers, *watching]
    observers: list[Observer] = [parts.metrics]  # first: all others may read the values of this tick
    if parts.stop:
        observers.append(parts.stop)
    observers += [parts.status, RadioTally(), EventLog()]  # the status before the views, which ask for it
    observers += [Guarded(observer, say, is_record=observer in records) for observer in others]
    if served:
        observers.append(Undriven(served, parts.factor, say))  # after the others: its warning ends the output
    if parts.open_interfaces:
        observers.append(InterfacesLog(parts.open_interfaces, say))  # once all others have begun
    return observers


def _recorders(parts: RunParts, folder: Path) -> list[Observer]:
    """Those that fill the run folder, which may drop rows only where the run keeps to the wall clock."""
    record, metrics, clock = parts.record, parts.metrics, parts.clock
    found: list[Observer] = [TrajectoryLog(folder, parts.hashes)]  # first: a killed run keeps its last digest
    if record.tables:
        topics = {DICT_TAG: "dict", FRAME_TAG: "frame"} | {kind.tag: kind.__name__ for kind in message_classes()}
        may_drop = parts.pace is not None
        options = RecordOptions(folder, metrics, clock, record.packets, topics, links=record.links, may_drop=may_drop)
        found += recorders(options)
    if record.rrd:
        found.append(RerunRecording(folder / RECORDING, metrics, clock, selected=record.select))
    return found


def failures(observers: Sequence[Observer]) -> dict[str, int]:
    """The observers that failed and were left out from then on, as counts of the summary."""
    guarded = [observer for observer in observers if isinstance(observer, Guarded)]
    return {f"observer_failed_{observer.name}": 1 for observer in guarded if observer.failed}


def failed_records(observers: Sequence[Observer]) -> list[str]:
    """The observers that failed to fill the run folder."""
    guarded = [observer for observer in observers if isinstance(observer, Guarded)]
    return [observer.name for observer in guarded if observer.failed and observer.is_record]


class Guarded(Observer):
    """An observer that, once it raises, is reported, counted and left out; the run continues."""

    def __init__(self, observer: Observer, say: Callable[[str], None], *, is_record: bool = False) -> None:
        self._observer, self._say, self.is_record = observer, say, is_record
        self.failed, self.before_agents = False, observer.before_agents

    @property
    def name(self) -> str:
        """The observer's class."""
        return type(self._observer).__name__

    def begin(self, static: Static) -> None:
        """The run is about to start."""
        self._try(lambda: self._observer.begin(static))

    def see(self, truth: Truth) -> None:
        """One tick is over."""
        if not self.failed:
            self._try(lambda: self._observer.see(truth))

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """The run is over; also an observer that failed may close its files."""
        return self._try(lambda: self._observer.end(last)) or {}

    def _try(self, call: Callable[[], Any]) -> Any:
        try:
            return call()
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # noqa: BLE001 - the run continues; rich exits without a reader, polars panics
            if not self.failed:
                self._say(f"observer {self.name} failed:{_why(error)}")
            self.failed = True
            return None


def _why(error: BaseException) -> str:
    """In a line, if the machine or the input is at fault; else with the traceback."""
    text = str(error) if isinstance(error, SwarmwireError) else refusal(error)
    return f" {text}; the run continues without it" if text else f"\n{traceback.format_exc()}"


class TooLarge(Observer):
    """Warns once of a packet above the medium's largest payload, which is never sent: an agent's mistake."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._told = False

    def begin(self, static: Static) -> None:
        """The run is about to start."""
        self._names = static.robot_names

    def see(self, truth: Truth) -> None:
        """Warn of the first one."""
        if self._told or truth.finished is None or truth.tally is None:
            return
        if truth.tally.fates[:, Fate.TOO_LARGE].any():
            finished, self._told = truth.finished, True
            first = np.flatnonzero(finished.fate == Fate.TOO_LARGE)[0]
            who, size_bytes = self._names[finished.sender[first]], finished.size_bytes[first]
            self._say(f"{who} sent {size_bytes} bytes, more than radio.max_payload_bytes: never on air (too_large)")


class EmptyBatteries(Observer):
    """Reports robots whose batteries end, which are dead from then on; the summary's `events` has all."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._reports = 0

    def begin(self, static: Static) -> None:
        """The run is about to start."""
        self._names = [
            name if static.arenas == 1 else f"{name} (seed {seed})"
            for seed in static.seeds
            for name in static.robot_names
        ]

    def see(self, truth: Truth) -> None:
        """Report those of this tick; after some reports only that there are more."""
        for event in truth.events:
            if event.do != BATTERY_EMPTY or self._reports > MAX_REPORTS:
                continue
            self._reports += 1
            if self._reports > MAX_REPORTS:
                self._say("more batteries end: see `events` in the summary")
            else:
                robots = some([self._names[row] for row in np.flatnonzero(event.changed)], NAMED)
                self._say(f"at {event.at_s:g} s the battery ends, and the robot is dead: {robots}")


class KeptMemory(Observer):
    """Returns freed memory to the system once a minute, without which a recorded run grows for hours."""

    def __init__(self, clock: Clock) -> None:
        self._clock, self._due_ns = clock, clock.now_ns() + to_ns(RETURN_AGAIN_S)

    def see(self, truth: Truth) -> None:
        """Return it if it is time."""
        if (now_ns := self._clock.now_ns()) >= self._due_ns:
            return_memory()
            self._due_ns = now_ns + to_ns(RETURN_AGAIN_S)
