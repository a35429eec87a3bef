"""Which outcomes a report is about: those asked for, or the first few that say most and differ between runs."""

from collections.abc import Sequence
from dataclasses import dataclass

from swarmwire.metrics.campaign.outcome import Outcome
from swarmwire.metrics.campaign.statistic import find_outcome
from swarmwire.metrics.report.campaign.samples import Samples

MOST = 8
PREFERRED = (
    "stop_time_s",
    "target_best.final",
    "target_mean.final",
    "order.final",
    "largest_component.final",
    "radio.link_pdr",
)


@dataclass(frozen=True)
class ChosenOutcomes:
    """The outcomes of a campaign, sorted out."""

    shown: tuple[Outcome, ...]
    others: tuple[Outcome, ...]  # that vary, too
    constant: tuple[Outcome, ...]  # one value in all runs
    never: tuple[Outcome, ...]  # no value in any


def choose_outcomes(samples: Samples, names: Sequence[str]) -> ChosenOutcomes:
    """Those of these names; of none: at most MOST of times, then of last values and the delivery ratio.

    BadInput for a name that there is not.
    """
    known = samples.folder.outcomes
    asked = tuple(dict.fromkeys(find_outcome(name, known) for name in names))
    never = tuple(outcome for outcome in known if outcome not in asked and not samples.all(outcome).observed.any())
    there = [outcome for outcome in known if outcome not in never]
    constant = tuple(outcome for outcome in there if outcome not in asked and not _varies(samples, outcome))
    vary = [outcome for outcome in there if outcome not in constant]
    usual = sorted((outcome for outcome in vary if outcome.is_usual), key=_rank)
    shown = asked or tuple((usual or vary)[:MOST])
    return ChosenOutcomes(shown, tuple(outcome for outcome in vary if outcome not in shown), constant, never)


def _varies(samples: Samples, outcome: Outcome) -> bool:
    sample = samples.all(outcome)
    return bool(sample.value.min() < sample.value.max() or not sample.observed.all())


def _rank(outcome: Outcome) -> tuple[bool, bool, int]:
    """Times first, then what the scenario lists, then what is preferred; the others stay in the campaign's order."""
    place = PREFERRED.index(outcome.column) if outcome.column in PREFERRED else len(PREFERRED)
    return outcome.kind != "time", not outcome.listed, place
