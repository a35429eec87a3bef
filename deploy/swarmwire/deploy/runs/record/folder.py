"""The run folder: made at the start, filled during the run, closed with the summary."""

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from itertools import chain, count
from pathlib import Path
from shutil import rmtree
from types import TracebackType
from typing import Any

from swarmwire.comms.base.atomic import write_text
from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.errors import BadInput, RecordFailed
from swarmwire.comms.base.printable import LINES, printable
from swarmwire.comms.observe.interfaces import AgentBackend, TimedBackend
from swarmwire.deploy.machine import refusal
from swarmwire.deploy.runs.record.inputs import InputsRecord, RecordedBackend
from swarmwire.deploy.runs.record.provenance import RunFacts, copy_scenario
from swarmwire.deploy.runs.record.replay_logs import LiveEventsLog, LiveEventsRecord
from swarmwire.metrics.records.run_folder.layout import LOG, SUMMARY, RunLog
from swarmwire.world.live_events import LiveEvent
from swarmwire.world.scenario.scenario import Scenario


def default_folder(scenario: str, seeds: tuple[int, ...]) -> Path:
    """runs/<scenario>-s<seed>-<UTC>, as `stamped_folder` has it."""
    seed = f"{seeds[0]}" if len(seeds) == 1 else f"{seeds[0]}to{seeds[-1]}"
    return stamped_folder(Path("runs") / f"{scenario}-s{seed}")


def stamped_folder(name: Path) -> Path:
    """<name>-<UTC>, with a number behind it if that was taken in the same second."""
    wanted = name.with_name(f"{name.name}-{WallClock().utc_stamp()}")
    numbered = (wanted.with_name(f"{wanted.name}-{number}") for number in count(2))
    return next(folder for folder in chain([wanted], numbered) if not folder.exists())


class RunWriter:
    """The folder of one run; with `out` None there is none, and messages only go to the terminal.

    Attributes:
        path: of the folder, if any.
    """

    def __init__(self, out: Path | None, clock: WallClock) -> None:
        """Make the folder; BadInput unless it is new or empty, or can be made."""
        self.path = None if out is None else _make_folder(out)
        self._log = RunLog(self.path, clock) if self.path else None
        self._live_events = LiveEventsLog(self.path) if self.path else None
        self._recorded: RecordedBackend | None = None

    def begin(self, scenario: Scenario, facts: RunFacts) -> RunFacts:
        """Copy all that the run is made from into the folder; the facts with these files. RecordFailed if it fails."""
        if self.path:
            try:
                facts = replace(facts, files=copy_scenario(scenario, facts.seeds, self.path))
                facts.write(self.path)
            except OSError as error:
                raise self._refused(self.path, error) from error
        what = f"{scenario.name}, seeds {list(facts.seeds)}, {facts.ticks} ticks, {facts.runners} runners"
        self.note(f"swarmwire {version('swarmwire-deploy')}: {what}")
        return facts

    def failed_to_start(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        """Write into the log why there was no first tick. A refused run leaves no folder."""
        if error is None:
            return
        self.note(f"failed to start: {error}")
        if self._log:
            self._log.close()
        if isinstance(error, BadInput) and self.path:
            rmtree(self.path, ignore_errors=True)  # it was new or empty, so all that is in it is of this run
            self.path = self._log = None

    def recorded(
        self, backend: AgentBackend | TimedBackend, outside: Callable[[int], bool]
    ) -> AgentBackend | TimedBackend:
        """The backend, with its actions kept in the folder from the first tick on at which `outside(tick)` holds."""
        if self.path is None:
            return backend
        self._recorded = RecordedBackend(backend, self.path, outside)
        return self._recorded

    def inputs(self) -> InputsRecord | None:
        """The recorded inputs; None if there are none."""
        return self._recorded.record() if self._recorded else None

    def keep(self, live_event: LiveEvent) -> None:
        """Record a live event before it takes effect; OSError if it cannot be recorded."""
        if self._live_events is None:
            return
        try:
            self._live_events.keep(live_event)
        except OSError as error:
            what = "end" if live_event.table is None else "happen"
            self.say(f"event {live_event.number} does not {what}, as it cannot be recorded: {error}")
            raise

    def live_events(self) -> LiveEventsRecord | None:
        """The recorded live events; None if there are none."""
        return self._live_events.record() if self._live_events else None

    def say(self, text: str) -> None:
        """Print a message to standard error and keep it in the log; a terminal that is gone must not end a run."""
        self.note(text)
        try:
            print(printable(text, keep=LINES), file=sys.stderr, flush=True)
        except (OSError, ValueError) as error:
            self.note(f"(the message could not be printed: {error})")

    def note(self, text: str) -> None:
        """Keep a message in the log."""
        if self._log:
            self._log.say(text)

    def close(self, summary: Mapping[str, Any], failed_records: Sequence[str] = ()) -> None:
        """Write the summary, the last of all: where it is, the run is over.

        RecordFailed if the disk refuses it, or if there are `failed_records`: observers that could not fill the folder.
        """
        self.note(f"ended: {summary['ended']}, {summary['ticks']} ticks" + _after(summary["error"]))
        if self._log:
            self._log.close()
            self._log = None  # what is said from here on is only printed
        if self.path:
            try:
                write_text(self.path / SUMMARY, json.dumps(summary, indent=2) + "\n")
            except OSError as error:
                raise self._refused(self.path / SUMMARY, error) from error
            if failed_records:
                names = ", ".join(failed_records)
                raise RecordFailed(f"{self.path}: incomplete: {names} failed; swarmwire verify names the gaps")

    def _refused(self, what: Path, error: OSError) -> RecordFailed:
        return RecordFailed(f"{what} cannot be written: {refusal(error) or error}")


def _after(error: str | None) -> str:
    return f": {error}" if error else ""


def _make_folder(out: Path) -> Path:
    """The run folder, made if need be and taken by its log; BadInput unless it is new or empty."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        taken = any(out.iterdir()) or not _claim(out)
    except OSError as error:
        raise BadInput("--out", str(out), f"expected a folder that can be made: {error.strerror}") from error
    if taken:
        raise BadInput("--out", str(out), "expected a new or empty folder")
    return out


def _claim(folder: Path) -> bool:
    """Whether this run is the first there: of several that found it empty, the system lets one alone make the log."""
    try:
        (folder / LOG).touch(exist_ok=False)
    except FileExistsError:
        return False
    return True
