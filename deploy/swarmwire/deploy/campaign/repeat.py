"""One run of a campaign, again: alone, from the campaign's folder, and whether it came out the same."""

from dataclasses import dataclass
from pathlib import Path

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.start import code_changes
from swarmwire.deploy.campaign.store import CampaignFolder
from swarmwire.deploy.config import Recording, Runners
from swarmwire.deploy.record.scenario_copy import changed_files
from swarmwire.deploy.result import Result
from swarmwire.deploy.simulation import Simulation, finished
from swarmwire.metrics.campaign.spec import SCENARIO_FOLDER, read_campaign


@dataclass(frozen=True)
class RunAgain:
    """A run of a campaign that was run again."""

    result: Result  # of the repetition
    before: str | None  # the run's trajectory hash; None: it is missing yet, or failed
    why_not: str  # why there is nothing to compare with, or ""
    changes: tuple[str, ...]  # what is not as it was when the campaign began; a line each

    @property
    def same(self) -> bool | None:
        """Whether it came out the same, bit for bit; None: there is nothing to compare with."""
        return None if self.before is None else self.before == self.result.arenas[0].trajectory_sha256


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
            raise BadInput("--run", "", f"expected a run from 0 to {campaign.runs - 1}, got {run}")
        self.simulation = Simulation(
            CampaignFolder(path, campaign).scenario,
            seeds=[campaign.seed_of(run)],
            overrides=campaign.point_overrides[campaign.point_of(run)],
            runners=runners,
            out=out,
            record=record,
        )

    def again(self) -> RunAgain:
        """Run it, and compare."""
        campaign, files = self._campaign, changed_files(self._campaign.files, self._path / SCENARIO_FOLDER)
        before, why_not = self._before()
        return RunAgain(
            result=finished(self.simulation),
            before=before,
            why_not=why_not,
            changes=(*files, *code_changes(campaign)),
        )

    def _before(self) -> tuple[str | None, str]:
        import polars as pl

        rows = CampaignFolder(self._path, self._campaign).rows().filter(pl.col("run") == self._run)
        if not len(rows):
            return None, "the campaign has not come to this run"
        if rows["trajectory_sha256"][0] is None:
            return None, f"the run failed: {rows['error'][0].strip().splitlines()[-1]}"
        return rows["trajectory_sha256"][0], ""
