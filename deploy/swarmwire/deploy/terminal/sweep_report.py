"""What came of a campaign, as people read it in a terminal: a row for each point, and what to do next."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from swarmwire.deploy.campaign.campaign import Campaign, read_campaign
from swarmwire.deploy.campaign.campaign_folder import CampaignFolder
from swarmwire.deploy.campaign.row import FAILED
from swarmwire.deploy.campaign.sweeping import Sweep
from swarmwire.metrics.campaign.statistic import FINAL

if TYPE_CHECKING:
    import polars as pl

MOST_POINTS = 20  # that are shown
MOST_OUTCOMES = 4


def print_sweep(sweep: Sweep, console: Console, program: Path) -> None:
    """How far the campaign is; once it is over, its medians by point."""
    folder = sweep.folder
    if not sweep.is_over:
        console.print(f"interrupted: {sweep.done} of {sweep.runs} runs are done", soft_wrap=True)
        console.print(f"go on: {program} sweep --resume {folder}", soft_wrap=True)
        return
    campaign = read_campaign(folder)
    rows = CampaignFolder(folder, campaign).rows()
    console.print(_table(campaign, rows))
    if len(campaign.points) > MOST_POINTS:
        console.print(f"… and {len(campaign.points) - MOST_POINTS} more points")
    if sweep.failed:
        failed = next(row for row in rows.iter_rows(named=True) if row["ended"] == FAILED)
        why = failed["error"].strip().splitlines()[-1]
        console.print(f"failed: {sweep.failed} of {sweep.runs} runs, such as run {failed['run']}: {why}", markup=False)
        console.print(f"once they can do better: {program} sweep --resume {folder} --retry-failed", soft_wrap=True)
    console.print(f"written: {folder}", soft_wrap=True)
    console.print(f"look at it: {program} report {folder}", soft_wrap=True)
    console.print(f"again: {program} repeat {folder} --run {min(17, sweep.runs - 1)}", soft_wrap=True)


def _table(campaign: Campaign, rows: "pl.DataFrame") -> Table:
    import polars as pl

    title = f"{campaign.name}: medians over {len(campaign.seeds)} seeds"
    table = Table(title=Text(title), title_justify="left", title_style="bold")
    outcomes = _outcomes(campaign, rows)
    for path in campaign.vary:
        table.add_column(Text(path), style="cyan")
    table.add_column("failed", justify="right")
    for column in outcomes:
        table.add_column(Text(column.removesuffix(FINAL)), justify="right", overflow="fold")
    for number, point in enumerate(campaign.points[:MOST_POINTS]):
        of_point = rows.filter(pl.col("point") == number)
        failed = int((of_point["ended"] == FAILED).sum())
        medians = [_median(of_point.filter(pl.col("ended") != FAILED), campaign, column) for column in outcomes]
        table.add_row(*(Text(str(value)) for value in point.values()), str(failed), *medians)
    return table


def _outcomes(campaign: Campaign, rows: "pl.DataFrame") -> Sequence[str]:
    """The first outcomes that have any value: times, and of other metrics what they were at the end."""
    columns = [of.column for of in campaign.outcomes if of.kind == "time" or of.column.endswith(FINAL)]
    first = [column for column in columns if column in rows.columns and rows[column].count()]
    pdr = ["radio.pdr"] if "radio.pdr" in rows.columns and rows["radio.pdr"].count() else []
    return first[: MOST_OUTCOMES - len(pdr)] + pdr


def _median(rows: "pl.DataFrame", campaign: Campaign, column: str) -> str:
    """Of runs of one length, a time that was not reached is longer than each that was."""
    import polars as pl

    is_time = any(of.column == column and of.kind == "time" for of in campaign.outcomes)
    values = rows[column].fill_null(float("inf")) if is_time else rows[column].drop_nulls()
    median: Any = values.filter(values.is_not_nan()).median() if values.dtype == pl.Float64 else values.median()
    if median is None:
        return "-"
    return f"> {rows['sim_time_s'].max():g}" if median == float("inf") else f"{median:.3g}"
