"""A radio's fit as people read it in a terminal."""

import math
from collections.abc import Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text

from swarmwire.metrics.radio_fit.fit import RadioFit
from swarmwire.metrics.radio_fit.losses import LossFit
from swarmwire.metrics.radio_fit.tables import Row, parameter_rows, residual_rows


def print_fit(fit: RadioFit, title: str, console: Console) -> None:
    """Parameters with their standard errors, residuals, models of loss, and what may be biased."""
    received, links = int(fit.log.received.sum()), len(fit.log.links)
    packets = len(fit.sequences.lost)
    counts = f"{packets} packet{'s' if packets != 1 else ''} on {links} link{'s' if links != 1 else ''}"
    console.print(f"{title}: {counts}, {received} received", soft_wrap=True)
    print_parameters(list(parameter_rows(fit)), console)
    residuals = list(residual_rows(fit))
    if residuals:
        table = titled_table("residuals of RSSI")
        table.add_column(style="cyan")
        table.add_column(justify="right")
        for name, value in residuals:
            table.add_row(name, value)
        console.print(table)
    if isinstance(fit.losses, LossFit):
        print_models(fit.losses, console)
    for note in fit.notes:
        console.print(f"note: {note}", soft_wrap=True)


def print_parameters(rows: Sequence[Row], console: Console) -> None:
    """Each with its value, standard error and unit, then those that were left out, and why."""
    table = titled_table("parameters", header=True)
    for name in ("parameter", "value", "standard error", "unit"):
        table.add_column(name, justify="right" if name in {"value", "standard error"} else "left")
    for row in rows:
        if row.estimate is not None:
            table.add_row(row.parameter, *_figures(row), row.unit)
    if table.row_count:
        console.print(table)
    for row in rows:
        if row.estimate is None:
            console.print(f"left out: {row.parameter}: {row.left_out}", soft_wrap=True)


def print_models(losses: LossFit, console: Console) -> None:
    """The models of loss, and how well they tell the losses."""
    table = titled_table("models of loss (the least AIC fits best)", header=True)
    for name in ("model", "parameters", "AIC", ""):
        table.add_column(name, justify="right" if name in {"parameters", "AIC"} else "left")
    for model in losses.models:
        chosen = "chosen" if model is losses.chosen else ""
        table.add_row(model.name, str(model.free), f"{model.aic:.1f}", chosen)
    console.print(table)
    if math.isfinite(losses.runs_z):
        meaning = "0 if single, far below 0 if in bursts"
        console.print(f"runs test within links: z = {losses.runs_z:.1f} ({meaning})", soft_wrap=True)


def _figures(row: Row) -> tuple[str, str]:
    assert row.estimate is not None
    value, error = row.estimate
    if not math.isfinite(error) or error <= 0.0:
        return f"{value:.4g}", "-"
    decimals = min(max(1 - math.floor(math.log10(error)), 0), 6)  # two digits of the standard error
    return f"{value:.{decimals}f}", f"{error:.{decimals}f}"


def titled_table(title: str, header: bool = False) -> Table:
    """An empty table with a title."""
    return Table(title=Text(title), show_header=header, title_justify="left", title_style="bold")
