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
from swarmwire.comms.base.config import scenario_path
from swarmwire.comms.base.errors import BadInput, RecordFailed
from swarmwire.comms.base.printable import LINES, printable
from swarmwire.comms.observe.interfaces import AgentBackend, TimedBackend
from swarmwire.deploy.machine import refusal
from swarmwire.deploy.runs.record.inputs import InputsRecord, RecordedBackend
from swarmwire.deploy.runs.record.provenance import Copies, RunFacts, copy_scenario
from swarmwire.deploy.runs.record.replay_logs import LiveEventsLog, LiveEventsRecord
from swarmwire.metrics.records.run_folder.layout import LOG, SCENARIO, SUMMARY, RunLog
from swarmwire.world.live_events import LiveEvent
from swarmwire.world.scenario.scenario import Scenario


def default_folder(scenario: Path, seeds: tuple[int, ...]) -> Path:
    """Return the default run folder, runs/<scenario>-s<seed>-<UTC>."""
    seed = f"{seeds[0]}" if len(seeds) == 1 else f"{seeds[0]}to{seeds[-1]}"
    return stamped_folder(Path("runs") / f"{short_name(scenario)}-s{seed}")


def short_name(scenario: Path) -> str:
    """Return the name of a scenario for default folders: of its file, or for a `scenario.toml` of its folder."""
    file = scenario_path(scenario)
    return file.resolve().parent.name if file.name == SCENARIO else file.stem


def stamped_folder(name: Path) -> Path:
    """Return the path <name>-<UTC>, followed by a number if that path exists."""
    first = name.with_name(f"{name.name}-{WallClock().utc_stamp()}")
    numbered = (first.with_name(f"{first.name}-{number}") for number in count(2))
    return next(folder for folder in chain([first], numbered) if not folder.exists())


def check_folder(out: Path) -> None:
    """Raise BadInput unless the folder is new or empty."""
    try:
        is_free = not out.exists() or not any(out.iterdir())
    except OSError as error:
        raise BadInput("out", str(out), f"expected a folder that can be made: {error.strerror}") from error
    if not is_free:
        raise BadInput("out", str(out), "expected a new or empty folder")


class RunWriter:
    """Writes the folder of one run; without a folder its messages are only printed.

    Attributes:
        path: path of the folder; None without a folder.
    """

    def __init__(self, out: Path | None, clock: WallClock) -> None:
        """Make the folder `out`, which must be new or empty; BadInput if that fails."""
        self.path = None if out is None else _make_folder(out)
        self._log = RunLog(self.path, clock) if self.path else None
        self._live_events = LiveEventsLog(self.path) if self.path else None
        self._recorded: RecordedBackend | None = None

    def begin(self, scenario: Scenario, facts: RunFacts) -> RunFacts:
        """Copy the files of the run into the folder; return the facts with these files. RecordFailed if that fails."""
        if self.path:
            try:
                facts = replace(facts, files=copy_scenario(scenario, facts.seeds, Copies(self.path)))
                facts.write(self.path)
            except OSError as error:
                raise self._refused(self.path, error) from error
        summary = f"{scenario.name}, seeds {list(facts.seeds)}, {facts.ticks} ticks, {facts.runners} runners"
        self.note(f"swarmwire {version('swarmwire-deploy')}: {summary}")
        return facts

    def failed_to_start(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        """Log why there was no first tick; the folder of a refused run is removed. An exit of `ExitStack.push`."""
        if error is None:
            return
        self.note(f"failed to start: {error}")
        if self._log:
            self._log.close()
        if isinstance(error, BadInput) and self.path:
            rmtree(self.path, ignore_errors=True)  # the folder was empty, so its content is this run's
            self.path = self._log = None

    def record_actions(
        self, backend: AgentBackend | TimedBackend, is_external: Callable[[int], bool]
    ) -> AgentBackend | TimedBackend:
        """Return the backend with its actions recorded from the first tick on for which `is_external(tick)` is True."""
        if self.path is None:
            return backend
        self._recorded = RecordedBackend(backend, self.path, is_external)
        return self._recorded

    def inputs(self) -> InputsRecord | None:
        """Return the recorded inputs; None without inputs."""
        return self._recorded.record() if self._recorded else None

    def keep(self, live_event: LiveEvent) -> None:
        """Record a live event before it takes effect; OSError if it cannot be recorded."""
        if self._live_events is None:
            return
        try:
            self._live_events.keep(live_event)
        except OSError as error:
            verb = "end" if live_event.table is None else "happen"
            self.report(f"event {live_event.number} does not {verb}, as it cannot be recorded: {error}")
            raise

    def live_events(self) -> LiveEventsRecord | None:
        """Return the recorded live events; None without live events."""
        return self._live_events.record() if self._live_events else None

    def report(self, text: str) -> None:
        """Print a message to standard error, and log it; a closed terminal must not end a run."""
        self.note(text)
        try:
            print(printable(text, keep=LINES), file=sys.stderr, flush=True)
        except (OSError, ValueError) as error:
            self.note(f"(the message could not be printed: {error})")

    def note(self, text: str) -> None:
        """Log a message."""
        if self._log:
            self._log.append(text)

    def close(self, summary: Mapping[str, Any], failed_records: Sequence[str] = ()) -> None:
        """Write the summary as the last file, which shows that the run is over.

        RecordFailed if the disk refuses it, or if there are `failed_records`: names of observers that could not fill
        the folder.
        """
        error_text = f": {summary['error']}" if summary["error"] else ""
        self.note(f"ended: {summary['ended']}, {summary['ticks']} ticks{error_text}")
        if self._log:
            self._log.close()
            self._log = None  # later messages are only printed
        if self.path:
            try:
                write_text(self.path / SUMMARY, json.dumps(summary, indent=2) + "\n")
            except OSError as error:
                raise self._refused(self.path / SUMMARY, error) from error
            if failed_records:
                names = ", ".join(failed_records)
                raise RecordFailed(f"{self.path}: incomplete: {names} failed; swarmwire verify names the gaps")

    def _refused(self, path: Path, error: OSError) -> RecordFailed:
        return RecordFailed(f"{path} cannot be written: {refusal(error) or error}")


def _make_folder(out: Path) -> Path:
    """Make the run folder with its log; BadInput unless it is new or empty.

    Of several runs that find it empty at once, the system lets one make the log.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        check_folder(out)
        (out / LOG).touch(exist_ok=False)
    except FileExistsError:  # the log of another run, or a file in place of the folder
        raise BadInput("out", str(out), "expected a new or empty folder") from None
    except OSError as error:
        raise BadInput("out", str(out), f"expected a folder that can be made: {error.strerror}") from error
    return out
