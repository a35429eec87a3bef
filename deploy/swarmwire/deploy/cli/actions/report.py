"""`swarmwire report`: the page of a campaign or of a run."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.terminal.output import echo
from swarmwire.metrics.pictures.report.campaign import campaign_report
from swarmwire.metrics.pictures.report.page import PAGE, Report, write_report
from swarmwire.metrics.pictures.report.run import run_report
from swarmwire.metrics.records.campaign.campaign_json import CAMPAIGN_FILE
from swarmwire.metrics.records.campaign.folder import CampaignFolder
from swarmwire.metrics.records.run_folder.layout import STATIC


def make_report(folder: Path, responses: Sequence[str], labels: Sequence[str], file: Path | None) -> None:
    """Write the page and its figures; `labels` are texts such as "radio.loss=packet loss"."""
    report = _report(folder, list(responses), _labels(labels))
    written = write_report(report, file or folder / PAGE)
    echo(f"written: {written[0]}")
    if len(written) > 1:
        echo(f"written: {written[1].parent} ({len(report.figures)} figures, as SVG and PDF)")


def _labels(texts: Sequence[str]) -> dict[str, str]:
    labels: dict[str, str] = {}
    for text in texts:
        name, equals, label = text.partition("=")
        if not equals or not name.strip() or not label.strip():
            raise BadInput("--label", text, "expected NAME=TEXT")
        labels[name.strip()] = label.strip()
    return labels


def _report(folder: Path, responses: list[str], labels: Mapping[str, str]) -> Report:
    """Return the report of a folder; BadInput if it is neither that of a campaign nor of a run."""
    if (folder / CAMPAIGN_FILE).exists():
        return campaign_report(CampaignFolder(folder), responses, labels)
    if not (folder / STATIC).exists():
        raise BadInput(str(folder), "", f"expected the folder of a campaign ({CAMPAIGN_FILE}) or of a run ({STATIC})")
    if labels:
        raise BadInput("--label", next(iter(labels)), "expected a campaign")
    if responses:
        raise BadInput("--response", responses[0], "expected a campaign: a run has all its metrics in its report")
    return run_report(folder)
