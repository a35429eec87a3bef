"""Which responses a report is about: those asked for, or the first few that say most and differ between runs."""

from collections.abc import Sequence
from dataclasses import dataclass

from swarmwire.metrics.campaign.response import Response
from swarmwire.metrics.campaign.statistic import find_response
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
class ChosenResponses:
    """The responses of a campaign, sorted out."""

    shown: tuple[Response, ...]
    others: tuple[Response, ...]  # that vary, too
    constant: tuple[Response, ...]  # one value in all runs
    never: tuple[Response, ...]  # no value in any


def choose_responses(samples: Samples, names: Sequence[str]) -> ChosenResponses:
    """Those of these names; of none: at most MOST of times, then of last values and the delivery ratio.

    BadInput for a name that there is not.
    """
    known = samples.folder.responses
    asked = tuple(dict.fromkeys(find_response(name, known) for name in names))
    never = tuple(response for response in known if response not in asked and not samples.all(response).observed.any())
    there = [response for response in known if response not in never]
    constant = tuple(response for response in there if response not in asked and not _varies(samples, response))
    vary = [response for response in there if response not in constant]
    usual = sorted((response for response in vary if response.is_usual), key=_rank)
    shown = asked or tuple((usual or vary)[:MOST])
    return ChosenResponses(shown, tuple(response for response in vary if response not in shown), constant, never)


def _varies(samples: Samples, response: Response) -> bool:
    sample = samples.all(response)
    return bool(sample.value.min() < sample.value.max() or not sample.observed.all())


def _rank(response: Response) -> tuple[bool, bool, int]:
    """Times first, then what the scenario lists, then what is preferred; the others stay in the campaign's order."""
    place = PREFERRED.index(response.column) if response.column in PREFERRED else len(PREFERRED)
    return response.kind != "time", not response.listed, place
