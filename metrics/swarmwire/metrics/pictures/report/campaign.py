"""The report of a campaign: its sections in order, with the methods of their statistics."""

from collections.abc import Mapping, Sequence

from swarmwire.metrics.pictures.report.campaign_data import CampaignData, Samples, choose_responses
from swarmwire.metrics.pictures.report.campaign_models import RESILIENCE, SCALING
from swarmwire.metrics.pictures.report.campaign_overview import DISTRIBUTIONS, SETUP
from swarmwire.metrics.pictures.report.campaign_summary import SUMMARY
from swarmwire.metrics.pictures.report.campaign_survival import SURVIVAL
from swarmwire.metrics.pictures.report.campaign_transitions import TRANSITIONS
from swarmwire.metrics.pictures.report.page import Report, ReportSection, Section, build_sections
from swarmwire.metrics.records.campaign.campaign_json import FAILED
from swarmwire.metrics.records.campaign.folder import CampaignFolder
from swarmwire.metrics.statistics.bootstrap import MIN_RESAMPLES, RESAMPLES
from swarmwire.metrics.text import counted

SECTIONS: tuple[ReportSection[CampaignData], ...] = (
    TRANSITIONS,
    SURVIVAL,
    DISTRIBUTIONS,
    SUMMARY,
    RESILIENCE,
    SCALING,
    SETUP,
)
_VALUES = (
    "Values. Quartiles of numbers are interpolated linearly (Hyndman and Fan, The American Statistician 50, 1996, "
    "type 7). Intervals hold with 95 % confidence; those of medians and means of numbers, and of all statistics over "
    "several design points, are expanded bootstrap percentiles over seeds "
    f"({RESAMPLES:,} resamples, down to {MIN_RESAMPLES:,} of very large samples; Efron, Annals of Statistics 7, 1979; "
    "Field and Welsh, Journal of the Royal Statistical Society B 69, 2007; Hesterberg, The American Statistician 69, "
    "2015). A seed that is drawn brings its runs of all design points. Draws are keyed, so that the same data give the "
    "same intervals."
)


def campaign_report(
    folder: CampaignFolder, responses: Sequence[str] = (), labels: Mapping[str, str] | None = None
) -> Report:
    """Return the report of a campaign, finished or not, on these responses, by default the most informative ones.

    `labels` are texts for parameters and responses in figures and captions. BadInput for an unknown response or
    parameter, or a damaged file.
    """
    samples = Samples(folder, labels)
    data = CampaignData(samples, choose_responses(samples, responses))
    sections, methods = build_sections(SECTIONS if len(folder.runs) else (SETUP,), data)
    failed = int((folder.runs["ended"] == FAILED).sum())
    problems = [
        f"{count:,} {state}" for count, state in ((failed, "failed"), (len(folder.missing), "missing")) if count
    ]
    about = ", ".join(
        [f"{counted(len(folder.runs), 'run')} of {counted(len(folder.points), 'design point')}", *problems]
    )
    return Report(folder.about.name, (*sections, Section("Methods", (_VALUES, *methods))), about)
