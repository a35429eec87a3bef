"""What came of a campaign, as people read it in a terminal: a row for each point, and what to do next."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from swarmwire.deploy.campaign.sweep import Sweep
from swarmwire.metrics.campaign.folder import CampaignFolder
from swarmwire.metrics.campaign.spec import FAILED, FINAL, LINK_PDR, Response, value_text
from swarmwire.metrics.statistics.sample import Sample
from swarmwire.metrics.statistics.summary import quantile_text
from swarmwire.metrics.statistics.survival import kaplan_meier
from swarmwire.metrics.text import number_text

MAX_POINTS = 20  # that are shown
MAX_RESPONSES = 4


def print_sweep(sweep: Sweep, console: Console, program: Path) -> None:
    """How far the campaign is; once it is over, its medians by point."""
    folder = sweep.folder
    if not sweep.is_over:
        console.print(f"interrupted: {sweep.done} of {sweep.runs} runs are done", soft_wrap=True)
        console.print(f"go on: {program} sweep --resume {folder}", soft_wrap=True)
        return
    campaign = CampaignFolder(folder)
    console.print(_table(campaign))
    if len(campaign.points) > MAX_POINTS:
        console.print(f"… and {len(campaign.points) - MAX_POINTS} more points")
    if sweep.failed:
        failed = next(row for row in campaign.runs.iter_rows(named=True) if row["ended"] == FAILED)
        why = failed["error"].strip().splitlines()[-1]
        console.print(f"failed: {sweep.failed} of {sweep.runs} runs, such as run {failed['run']}: {why}", markup=False)
        console.print(f"if the machine was at fault: {program} sweep --resume {folder} --retry-failed", soft_wrap=True)
        console.print("if the scenario's files were: a new campaign, once they are mended; this one keeps its copies")
    console.print(f"written: {folder}", soft_wrap=True)
    console.print(f"look at it: {program} report {folder}", soft_wrap=True)
    console.print(f"again: {program} repeat {folder} --run {min(17, sweep.runs - 1)}", soft_wrap=True)


def _table(folder: CampaignFolder) -> Table:
    about, responses = folder.about, _responses(folder)
    title = f"{about.name}: medians over {len(about.seeds)} seeds"
    table = Table(title=Text(title), title_justify="left", title_style="bold")
    for path in folder.parameters:
        table.add_column(Text(path), style="cyan")
    table.add_column("failed", justify="right")
    for response in responses:
        table.add_column(Text(response.column.removesuffix(FINAL)), justify="right", overflow="fold")
    failed = folder.runs.filter(folder.runs["ended"] == FAILED)["point"].to_list()
    for number, point in enumerate(about.points[:MAX_POINTS]):
        medians = [_median(folder.sample(response.column, number)) for response in responses]
        table.add_row(*(Text(value_text(value)) for value in point.values()), str(failed.count(number)), *medians)
    return table


def _responses(folder: CampaignFolder) -> Sequence[Response]:
    """The first usual ones that have any value, and last the link PDR."""
    runs = folder.runs
    usual = [of for of in folder.responses if of.is_usual and of.column in runs.columns and runs[of.column].count()]
    first, last = [of for of in usual if of.column != LINK_PDR], [of for of in usual if of.column == LINK_PDR]
    return first[: MAX_RESPONSES - len(last)] + last


def _median(sample: Sample) -> str:
    """As in reports: of times Kaplan and Meier's, since runs may have ended before theirs, each at another time."""
    if not len(sample):
        return "-"
    if sample.kind == "time":
        return quantile_text(kaplan_meier(sample).quantile(0.5), float(sample.value.max()))
    return number_text(float(np.median(sample.value)))
