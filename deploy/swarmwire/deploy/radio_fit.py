"""A radio's fit, or a real network's: as people read it in a terminal, and as TOML that a scenario takes."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from swarmwire.comms.errors import BadInput
from swarmwire.metrics.radio_fit.fit import NetworkFit, RadioFit
from swarmwire.metrics.radio_fit.losses import LossFit
from swarmwire.metrics.radio_fit.tables import (
    Row,
    network_comments,
    network_rows,
    network_table,
    parameter_rows,
    radio_table,
    residual_rows,
)

if TYPE_CHECKING:
    from swarmwire.comms.radio.config.phy import Antenna

MAX_LINKS = 30  # that are told one by one: the worst
DISK = {"range_m": 1.0}  # what a table without path loss is put into


def print_fit(fit: RadioFit | NetworkFit, title: str, console: Console) -> None:
    """Parameters with their standard errors, residuals or links, models of loss, and what may be biased."""
    if isinstance(fit, RadioFit):
        packets, received, links = len(fit.sequences.lost), int(fit.log.received.sum()), len(fit.log.links)
    else:
        packets, received, links = len(fit.log.lost), int((~fit.log.lost).sum()), len(fit.links)
    counts = f"{packets} packet{'s' if packets != 1 else ''} on {links} link{'s' if links != 1 else ''}"
    console.print(f"{title}: {counts}, {received} received", soft_wrap=True)
    print_parameters(_rows(fit), console)
    if isinstance(fit, RadioFit) and (residuals := list(residual_rows(fit))):
        table = titled_table("residuals of RSSI")
        table.add_column(style="cyan")
        table.add_column(justify="right")
        for name, value in residuals:
            table.add_row(name, value)
        console.print(table)
    if isinstance(fit.losses, LossFit):
        print_models(fit.losses, console)
    if isinstance(fit, NetworkFit):
        _print_links(fit, console)
        for name, others in fit.neighbours.items():
            console.print(f"neighbours of {name}: {', '.join(others) or 'none'}", soft_wrap=True)
    for note in fit.notes:
        console.print(f"note: {note}", soft_wrap=True)


def _rows(fit: RadioFit | NetworkFit) -> list[Row]:
    return list(parameter_rows(fit) if isinstance(fit, RadioFit) else network_rows(fit))


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
    """The models of loss, and how well they predict the losses."""
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


def _print_links(fit: NetworkFit, console: Console) -> None:
    shown = sorted(fit.links, key=lambda link: link.pdr)[:MAX_LINKS]
    some = f", the worst {len(shown)} of {len(fit.links)}" if len(shown) < len(fit.links) else ""
    table = titled_table(f"delivery by link{some}", header=True)
    for name in ("from", "to", "packets", "received", "delivery"):
        table.add_column(name, justify="left" if name in {"from", "to"} else "right")
    for link in shown:
        table.add_row(link.sender, link.receiver, str(link.packets), str(link.received), f"{link.pdr:.1%}")
    console.print(table)


def fit_toml(fit: RadioFit | NetworkFit, antenna: "Antenna", file: Path) -> str:
    """The table `[radio]`, with what was left out as comments.

    BadInput where nothing could be fitted, or where a scenario would refuse what was.
    """
    import tomli_w

    table = radio_table(fit, antenna) if isinstance(fit, RadioFit) else network_table(fit)
    left_out = [f"{row.parameter}: {row.left_out}" for row in _rows(fit) if row.estimate is None]
    if not table["radio"]:
        raise BadInput(str(file), "", f"nothing could be fitted: {'; '.join(left_out)}")
    comments = [f"Fitted to {file.name} by swarmwire radio fit.", *(f"Left out: {one}." for one in left_out)]
    if isinstance(fit, NetworkFit):
        comments += network_comments(fit)
    elif "model" not in table["radio"]:
        comments.append("Without path loss this is no radio yet: put it into one that has a model or a range_m.")
    _refuse_unfit(table, file)
    return "".join(f"# {comment}\n" for comment in comments) + tomli_w.dumps(table)


def _refuse_unfit(table: dict[str, Any], file: Path) -> None:
    from swarmwire.deploy.scenario_parts import checked_radio

    whole = table["radio"] if "model" in table["radio"] else {**DISK, **table["radio"]}
    try:
        checked_radio(whole, str(file))
    except BadInput as error:
        raise BadInput(str(file), f"fitted {error.key}", f"{error.expected}, which no scenario takes") from None
