"""Expectations of runs and campaigns, checked from Python."""

from collections.abc import Sequence
from pathlib import Path

from swarmwire.comms.base.errors import SwarmwireError
from swarmwire.deploy.campaigns.sweep import Sweep
from swarmwire.deploy.runs.result import Result
from swarmwire.metrics.records.campaign.expectations import Verdict, parse_expectation, summary_verdicts, verdicts


class NotMet(SwarmwireError, AssertionError):
    """A run or a campaign does not meet an expectation. Its text has a line for each that is not met.

    Attributes:
        verdicts: all verdicts, also those of expectations that are met.
    """

    def __init__(self, checked: Sequence[Verdict]) -> None:
        self.verdicts = tuple(checked)
        super().__init__(
            "\n".join(f"NOT MET: {each.title}: measured {each.measured}" for each in checked if not each.is_met)
        )


def expect(target: Result | Sweep | Path | str, *expectations: str) -> list[Verdict]:
    """Check a run or a campaign as `swarmwire expect` does, and return a verdict per expectation and design point.

    `target` is the result of `run` or `sweep`, or the folder of a run or a campaign, also `FOLDER@radio.loss=0.4`. For
    example `expect(run("flock.toml", seeds=10), "order >= 0.9", "radio.pdr > 0.5 in 80 % of runs")`.

    Raises NotMet, an AssertionError, if one is not met, and BadInput for a text that is no expectation, a name without
    values or a folder without results.
    """
    checked = verdicts_on(target, expectations)
    if not all(each.is_met for each in checked):
        raise NotMet(checked)
    return checked


def verdicts_on(target: Result | Sweep | Path | str, expectations: Sequence[str]) -> list[Verdict]:
    """Return the verdicts on a run or a campaign; raises as `expect` does, but never NotMet."""
    parsed = [parse_expectation(text) for text in expectations]
    if isinstance(target, Result):
        return summary_verdicts(target.summary(), parsed, target.scenario)
    return verdicts(str(target.folder if isinstance(target, Sweep) else target), parsed)
