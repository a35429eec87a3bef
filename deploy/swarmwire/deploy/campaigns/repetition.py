"""Repetition of a run from its folder, or of a run of a campaign, and its comparison with the original."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.deploy.campaigns.columns import failure_line
from swarmwire.deploy.campaigns.folder import code_changes
from swarmwire.deploy.campaigns.store import CampaignWriter
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
    """Result of a repetition, and its comparison with the original."""

    result: Result  # result of the repetition
    ended: str | None  # the original's end, from its summary; None without a summary, as for runs of campaigns
    before: tuple[str, ...] | None  # trajectory hash of each arena of the original; None: unknown, or of another end
    compared: int  # number of ticks, from the first, that could be compared
    first_difference: int | None  # the first tick that differs
    why_not_all: str  # reason for an incomplete comparison, or ""
    changes: tuple[str, ...]  # changes since the original: files, modules, versions; a line each

    @property
    def same(self) -> bool | None:
        """True if the two runs are identical bit for bit, as far as recorded; None: there is nothing to compare."""
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

    The repetition has as many ticks as the run, also if that was interrupted, failed or killed; with `out`, a killed
    run is repeated to its planned end. `runners` are as for `run`; a run with recorded inputs takes none, since the
    record replaces them. `out`, a new or empty folder, becomes the repetition's run folder, with the records of
    `record`.

    Raises BadInput if this is no run folder, or its run cannot be repeated, and the errors of `run`.
    """
    return RepeatedRun(folder, runners=runners, out=out, observers=observers, record=record).run()


class RepeatedRun:
    """Repetition of a run, with the arguments of `repeat`.

    Attributes:
        simulation: the simulation of the repetition.
        facts: provenance of the original.
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
        """Run the repetition, and compare."""
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
        """Return the ticks of the run; for a killed run that is recorded anew, its planned ticks."""
        if self._summary:
            ticks = self._summary.ticks
        else:
            logged = ticks_logged(self._folder)
            ticks = logged if logged and not recorded_anew else self.facts.ticks
        return min(ticks, self._inputs.end_tick) if self._inputs else ticks

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
    """Read the parts of the summary to compare with; None if the run left no summary."""
    summary = RunFolder(folder).summary
    if summary is None:
        return None
    inputs: dict[str, Any] = summary["inputs"] or {}
    live_events: dict[str, Any] = summary["live_events"] or {}
    hashes = tuple(summary["trajectory_sha256"])
    return _Summary(summary["ended"], summary["ticks"], hashes, inputs.get("sha256"), live_events.get("sha256"))


def _inputs(folder: Path, facts: RunFacts, summary: _Summary | None) -> RecordedInputs | None:
    inputs = recorded_inputs(folder)
    driven = bool(facts.gateways) or (facts.realtime is not None and (facts.runners > 0 or facts.subtick_s))
    from_outside = driven or bool(summary and summary.inputs_sha256)
    if inputs is None and from_outside:
        expected = "expected the record of external inputs, on which this run depends"
        raise BadInput(str(folder / INPUTS), "", expected)
    return inputs


class CampaignRun:
    """Repetition of a run of a campaign.

    Attributes:
        simulation: the simulation of the repetition.
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
        """Prepare the repetition; BadInput if the folder has no campaign, or the campaign has no such run."""
        self._path, self._run = path, run
        self._campaign = campaign = read_campaign(path)
        if not 0 <= run < campaign.runs:
            raise BadInput("run", "", f"expected a run from 0 to {campaign.runs - 1}, got {run}")
        if campaign.realtime:
            expected = "expected a run folder (--record-seeds): runs in real time depend on more than their seed"
            raise BadInput(str(path), "realtime", expected)
        self.simulation = Simulation(
            CampaignWriter(path, campaign).scenario,
            seeds=[campaign.seed_of(run)],
            overrides=campaign.point_overrides[campaign.point_of(run)],
            runners=runners,
            out=out,
            record=record,
        )

    def run(self) -> Repetition:
        """Run the repetition, and compare."""
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
        """Return the run's trajectory hash, or the reason why there is none."""
        import polars as pl

        rows = CampaignWriter(self._path, self._campaign).rows().filter(pl.col("run") == self._run)
        if not len(rows):
            return None, "the campaign has not come to this run"
        if rows["trajectory_sha256"][0] is None:
            return None, f"the run failed: {failure_line(rows['error'][0])}"
        return (rows["trajectory_sha256"][0],), ""
