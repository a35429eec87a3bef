"""A run again, from its folder alone, or one of a campaign; and whether it came out the same."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.deploy.campaigns.store import CampaignWriter
from swarmwire.deploy.campaigns.sweep import code_changes
from swarmwire.deploy.runs.config import Recording, Replay, Runners
from swarmwire.deploy.runs.record.inputs import RecordedInputs, recorded_inputs
from swarmwire.deploy.runs.record.provenance import RunFacts, changed_files, read_facts
from swarmwire.deploy.runs.record.replay_logs import TrajectoryCheck, read_live_events, ticks_logged
from swarmwire.deploy.runs.result import Result
from swarmwire.deploy.runs.simulation import Simulation, run_to_end
from swarmwire.metrics.records.campaign.campaign_json import SCENARIO_FOLDER, read_campaign
from swarmwire.metrics.records.run_folder.layout import INPUTS, LIVE_EVENTS, SCENARIO, SUMMARY
from swarmwire.metrics.records.run_folder.reader import RunFolder


@dataclass(frozen=True)
class Repetition:
    """A run that was run again."""

    result: Result  # of the repetition
    ended: str | None  # how the run did, as its summary says; None: it left none, as runs of campaigns do
    before: tuple[str, ...] | None  # trajectory hash of each arena of the run; None: it left none, or not of this end
    compared: int  # ticks, from the first, that could be compared
    first_difference: int | None  # the first tick that came out differently
    why_not_all: str  # why it is not the whole run that was compared, or ""
    changes: tuple[str, ...]  # what is not as it was when the run began: files, modules, versions, CPU; a line each

    @property
    def same(self) -> bool | None:
        """Whether both runs are identical bit for bit, as far as is recorded; None: there is nothing to compare."""
        if self.before is not None:
            return self.before == tuple(self.result.trajectory_sha256)
        return self.first_difference is None if self.compared else None


def repeat(
    folder: Path | str,
    *,
    runners: Runners = None,
    out: Path | str | None = None,
    observers: Sequence[Observer] = (),
    record: Recording | None = None,
) -> Repetition:
    """Run the run of this folder again, and compare the trajectory hashes.

    It has as many ticks as the run had, also if that was interrupted, failed or killed; with `out`, one that was killed
    has all that it was to have. `runners` are as for `run`; a run into which
    something came from outside takes none, since its record plays their part. `out`, a new or empty folder, becomes the
    repetition's own run folder, with what `record` says in it.

    Raises BadInput if this is no run folder or it cannot be run any more, and what `run` raises.
    """
    return RepeatedRun(folder, runners=runners, out=out, observers=observers, record=record).run()


class RepeatedRun:
    """A run on its way to its repetition, with the arguments of `repeat`.

    Attributes:
        simulation: what will run.
        facts: from what the run was made.
    """

    def __init__(
        self,
        folder: Path | str,
        *,
        runners: Runners = None,
        out: Path | str | None = None,
        observers: Sequence[Observer] = (),
        record: Recording | None = None,
    ) -> None:
        self._folder = folder = Path(folder)
        self.facts = read_facts(folder)
        self._summary = _read_summary(folder)
        self._inputs = _inputs(folder, self.facts, self._summary)
        live_events, self._live_events_sha256 = read_live_events(folder)
        if self._summary and self._summary.live_events_sha256 and not live_events:
            expected = "expected the record of live events, on which this run depends"
            raise BadInput(str(folder / LIVE_EVENTS), "", expected)
        if self._inputs is not None and runners not in (None, "none"):
            raise BadInput(
                "runners", "", f'expected "none": {INPUTS} holds the actions of the runners; got {runners!r}'
            )
        self.simulation = Simulation(
            folder / SCENARIO,
            seeds=self.facts.seeds,
            runners=runners,
            out=out,
            observers=observers,
            record=record,
            replay=Replay(self._ticks(recorded_anew=out is not None), self._inputs, live_events, self.facts.subtick_s),
        )
        self._check = TrajectoryCheck(folder, self.simulation.hashes)
        self.simulation.watch(self._check)

    def run(self) -> Repetition:
        """Run it, and compare."""
        changes = self.facts.changes(self._folder, self.simulation.plan.code)
        summary, inputs = self._summary, self._inputs
        if summary and summary.inputs_sha256 and inputs and inputs.sha256 != summary.inputs_sha256:
            changes.append(f"{INPUTS} is not as the run left it: its sha256 differs")
        if summary and self._live_events_sha256 != summary.live_events_sha256:
            changes.append(f"{LIVE_EVENTS} is not as the run left it: its sha256 differs")
        result = run_to_end(self.simulation)
        why_not_all = self._why_not_all(result)
        return Repetition(
            result=result,
            ended=summary.ended if summary else None,
            before=summary.hashes if summary and not why_not_all else None,
            compared=self._check.compared,
            first_difference=self._check.first_difference,
            why_not_all=why_not_all,
            changes=tuple(changes),
        )

    def _ticks(self, *, recorded_anew: bool) -> int:
        """As many as the run had; of one that was killed, if it is to be recorded anew, all that it was to have."""
        if self._summary:
            wanted = self._summary.ticks
        else:
            known = ticks_logged(self._folder)
            wanted = known if known and not recorded_anew else self.facts.ticks
        return min(wanted, self._inputs.end_tick) if self._inputs else wanted

    def _why_not_all(self, result: Result) -> str:
        if self._summary is None:
            return f"the run left no {SUMMARY}: it was killed or is still running"
        if result.ticks < self._summary.ticks:
            return f"this is {result.ticks} of the run's {self._summary.ticks} ticks"
        return ""


@dataclass(frozen=True)
class _Summary:
    ended: str
    ticks: int
    hashes: tuple[str, ...]
    inputs_sha256: str | None
    live_events_sha256: str | None


def _read_summary(folder: Path) -> _Summary | None:
    """What there is to compare with; None if the run left no summary."""
    found = RunFolder(folder).summary
    if found is None:
        return None
    inputs: dict[str, Any] = found["inputs"] or {}
    given: dict[str, Any] = found["live_events"] or {}
    hashes = tuple(found["trajectory_sha256"])
    return _Summary(found["ended"], found["ticks"], hashes, inputs.get("sha256"), given.get("sha256"))


def _inputs(folder: Path, facts: RunFacts, summary: _Summary | None) -> RecordedInputs | None:
    inputs = recorded_inputs(folder)
    driven = bool(facts.gateways) or (facts.realtime is not None and (facts.runners > 0 or facts.subtick_s))
    from_outside = driven or bool(summary and summary.inputs_sha256)
    if inputs is None and from_outside:
        expected = "expected the record of external inputs, on which this run depends"
        raise BadInput(str(folder / INPUTS), "", expected)
    return inputs


class CampaignRun:
    """A run of a campaign on its way to its repetition.

    Attributes:
        simulation: what will run.
    """

    def __init__(
        self,
        path: Path,
        run: int,
        *,
        runners: Runners = None,
        out: Path | str | None = None,
        record: Recording | None = None,
    ) -> None:
        """BadInput if the folder holds no campaign, or the campaign no such run."""
        self._path, self._run = path, run
        self._campaign = campaign = read_campaign(path)
        if not 0 <= run < campaign.runs:
            raise BadInput("run", "", f"expected a run from 0 to {campaign.runs - 1}, got {run}")
        self.simulation = Simulation(
            CampaignWriter(path, campaign).scenario,
            seeds=[campaign.seed_of(run)],
            overrides=campaign.point_overrides[campaign.point_of(run)],
            runners=runners,
            out=out,
            record=record,
        )

    def run(self) -> Repetition:
        """Run it, and compare."""
        changes = changed_files(self._campaign.files, self._path / SCENARIO_FOLDER)
        before, why_not = self._before()
        return Repetition(
            result=run_to_end(self.simulation),
            ended=None,
            before=before,
            compared=0,
            first_difference=None,
            why_not_all=why_not,
            changes=(*changes, *code_changes(self._campaign)),
        )

    def _before(self) -> tuple[tuple[str] | None, str]:
        """The run's trajectory hash, or why there is none."""
        import polars as pl

        rows = CampaignWriter(self._path, self._campaign).rows().filter(pl.col("run") == self._run)
        if not len(rows):
            return None, "the campaign has not come to this run"
        if rows["trajectory_sha256"][0] is None:
            return None, f"the run failed: {rows['error'][0].strip().splitlines()[-1]}"
        return (rows["trajectory_sha256"][0],), ""
