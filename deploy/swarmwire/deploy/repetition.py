"""A run again, from its folder alone: from the scenario, files and inputs in it; and whether it came out the same."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from swarmwire.comms.errors import BadInput
from swarmwire.comms.protocols import Observer
from swarmwire.deploy.folder import make_folder
from swarmwire.deploy.inputs import INPUTS, RecordedInputs, recorded_inputs
from swarmwire.deploy.origin import Origin, read_origin
from swarmwire.deploy.result import Result
from swarmwire.deploy.run import Execution, Runners
from swarmwire.deploy.scenario_copy import SCENARIO
from swarmwire.world.scenario_file import load_scenario

SUMMARY = "summary.json"


@dataclass(frozen=True)
class Repetition:
    """A run that was run again."""

    result: Result  # of the repetition
    before: tuple[str, ...] | None  # trajectory hash of each arena of the run; None: there is nothing to compare with
    why_not: str  # why there is nothing to compare with, or ""
    changes: tuple[str, ...]  # what is not as it was when the run began: files, modules, versions, CPU; a line each

    @property
    def differing(self) -> list[int]:
        """Seeds of the arenas that came out differently."""
        pairs = zip(self.result.arenas, self.before or (), strict=False)
        return [arena.seed for arena, before in pairs if arena.trajectory_sha256 != before]

    @property
    def same(self) -> bool | None:
        """Whether every arena came out the same, bit for bit; None if there is nothing to compare with."""
        return None if self.before is None else self.before == tuple(self.result.trajectory_sha256)


def repeat(
    folder: Path | str, *, runners: Runners = None, out: Path | str | None = None, observers: Sequence[Observer] = ()
) -> Repetition:
    """Run the run of this folder again, and compare the trajectory hashes.

    It has as many ticks as the run had, also if that was interrupted. `runners` are as for `run`; a run into which
    something came from outside takes none, since its record plays their part. `out`, a new or empty folder, becomes the
    repetition's own run folder.

    Raises BadInput if this is no run folder or it cannot be run any more, and what `run` raises.
    """
    repeated = RepeatedRun(Path(folder), runners)
    if out is not None:
        repeated.execution.folder = make_folder(Path(out))
    return repeated.run(observers)


class RepeatedRun:
    """A run on its way to its repetition; `execution` may still be told where and what to record."""

    def __init__(self, folder: Path, runners: Runners = None) -> None:
        self.folder, self.origin = folder, read_origin(folder)
        self._summary = _read_summary(folder)
        self._inputs = _inputs(folder, self.origin, self._summary)
        if self._inputs is not None and runners not in (None, "none"):
            raise BadInput("--runners", "", f'expected "none": {INPUTS} says what the runners did; got {runners!r}')
        execution = self.execution = Execution(load_scenario(folder / SCENARIO), self.origin.seeds, runners)
        execution.inputs, execution.ticks = self._inputs, self._ticks()

    def run(self, observers: Sequence[Observer] = ()) -> Repetition:
        """Run it, and compare."""
        changes = self.origin.changes(self.folder, self.execution.specs)
        summary, inputs = self._summary, self._inputs
        if summary and summary.inputs_sha256 and inputs and inputs.sha256 != summary.inputs_sha256:
            changes.append(f"{INPUTS} is not as the run left it: its sha256 differs")
        result = self.execution.run(observers)
        why_not = self._why_not(result)
        return Repetition(result, None if why_not or not summary else summary.hashes, why_not, tuple(changes))

    def _ticks(self) -> int:
        wanted = self._summary.ticks if self._summary else self.origin.ticks
        return min(wanted, self._inputs.end_tick) if self._inputs else wanted

    def _why_not(self, result: Result) -> str:
        if self._summary is None:
            return f"the run left no {SUMMARY}: it was killed or it failed"
        if result.ticks < self._summary.ticks:
            return f"this is {result.ticks} of the run's {self._summary.ticks} ticks"
        return ""


@dataclass(frozen=True)
class _Summary:
    ticks: int
    hashes: tuple[str, ...]
    inputs_sha256: str | None


def _read_summary(folder: Path) -> _Summary | None:
    """What there is to compare with; None if the run left no summary."""
    path = folder / SUMMARY
    if not path.exists():
        return None
    try:
        found: Any = json.loads(path.read_text(encoding="utf-8"))
    except ValueError:
        found = None
    match found:
        case {"ticks": int(ticks), "trajectory_sha256": [str(), *_] as hashes, "inputs": None}:
            return _Summary(ticks, tuple(hashes), None)
        case {"ticks": int(ticks), "trajectory_sha256": [str(), *_] as hashes, "inputs": {"sha256": str(sha256)}}:
            return _Summary(ticks, tuple(hashes), sha256)
        case _:
            raise BadInput(str(path), "", "expected the summary of a run")


def _inputs(folder: Path, origin: Origin, summary: _Summary | None) -> RecordedInputs | None:
    inputs = recorded_inputs(folder)
    from_outside = (origin.realtime is not None and origin.runners > 0) or bool(summary and summary.inputs_sha256)
    if inputs is None and from_outside:
        expected = "expected the record of what came from outside, on which this run depends"
        raise BadInput(str(folder / INPUTS), "", expected)
    return inputs
