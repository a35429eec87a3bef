"""The report of a campaign: from its folder to sections."""

from collections.abc import Sequence

from swarmwire.metrics.campaign.campaign_folder import CampaignFolder
from swarmwire.metrics.report.campaign.chosen_responses import choose_responses
from swarmwire.metrics.report.campaign.distribution_section import distribution_section
from swarmwire.metrics.report.campaign.methods_section import methods_section
from swarmwire.metrics.report.campaign.resilience_section import resilience_section
from swarmwire.metrics.report.campaign.samples import Samples
from swarmwire.metrics.report.campaign.scaling_section import scaling_section
from swarmwire.metrics.report.campaign.summary_section import summary_section
from swarmwire.metrics.report.campaign.survival_section import survival_section
from swarmwire.metrics.report.campaign.transition_section import transition_section
from swarmwire.metrics.report.campaign.what_was_run import what_was_run
from swarmwire.metrics.report.in_words import counted
from swarmwire.metrics.report.section import Report, Section


def campaign_report(folder: CampaignFolder, responses: Sequence[str] = ()) -> Report:
    """What came of a campaign, also of one that is not finished; about these responses, or those that say most.

    BadInput for a response that there is not, or a file that is damaged.
    """
    samples = Samples(folder)
    chosen = choose_responses(samples, responses)
    times = tuple(response for response in chosen.shown if response.kind == "time")
    found: list[Section | None] = []
    if len(folder.runs):
        found = [
            summary_section(samples, chosen),
            distribution_section(samples, chosen.shown),
            transition_section(samples, chosen.shown),
            survival_section(samples, times),
            resilience_section(samples, chosen.shown),
            scaling_section(samples, times),
        ]
    sections = [section for section in found if section is not None]
    methods = methods_section([section.title for section in sections], times=bool(times))
    about = f"{counted(len(folder.runs), 'run')} of {counted(len(folder.points), 'design point')}"
    return Report(folder.about.name, (what_was_run(folder), *sections, methods), about)
