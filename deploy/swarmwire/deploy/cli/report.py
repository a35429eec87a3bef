"""`swarmwire report`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarmwire.comms.errors import BadInput

if TYPE_CHECKING:
    from swarmwire.metrics.report.page import Report


def report_command(
    folder: Annotated[Path, typer.Argument(help="The folder of a campaign or of a run.", metavar="DIR")],
    response: Annotated[
        list[str] | None,
        typer.Option(
            help="Of a campaign: a column, or a metric for its last value. Repeatable. Default: eight at most.",
            metavar="NAME",
        ),
    ] = None,
    to: Annotated[
        Path | None,
        typer.Option(help="The page; figures go to a folder beside it. Default: report.html in DIR.", metavar="FILE"),
    ] = None,
) -> None:
    """Make a report of a campaign or of a run: one page that needs nothing else, and its figures as SVG beside it.

    Also of what is not finished. Unless responses are named they are times, last values of metrics and the link PDR, of
    those that differ between runs; tables that are folded hold the others. For example:

      swarmwire report campaigns/loss --response aggregation_time_s --response order
    """
    # Imported here: matplotlib and scipy take a second, which --help should not.
    from swarmwire.metrics.report.page import PAGE, write_report

    written = write_report(_report(folder, response or []), to or folder / PAGE)
    typer.echo(f"written: {written[0]}")
    if len(written) > 1:
        typer.echo(f"written: {written[1].parent} ({len(written) - 1} figures)")


def _report(folder: Path, responses: list[str]) -> "Report":
    """Of whatever the folder holds; BadInput where it is neither a campaign nor a run."""
    from swarmwire.metrics.campaign.folder import CampaignFolder
    from swarmwire.metrics.campaign.spec import ABOUT
    from swarmwire.metrics.report.campaign import campaign_report
    from swarmwire.metrics.report.run import run_report
    from swarmwire.metrics.run_folder.layout import STATIC

    if (folder / ABOUT).exists():
        return campaign_report(CampaignFolder(folder), responses)
    if not (folder / STATIC).exists():
        raise BadInput(str(folder), "", f"expected the folder of a campaign ({ABOUT}) or of a run ({STATIC})")
    if responses:
        raise BadInput("--response", responses[0], "expected a campaign: a run has all its metrics in its report")
    return run_report(folder)
