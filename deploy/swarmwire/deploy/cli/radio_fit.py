"""A radio's fit, or a real network's: as rows that people read in a terminal, and as TOML that a scenario takes."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tomli_w
from rich.console import Console
from rich.table import Table
from rich.text import Text

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.radio.config.path_loss_models import LogDistance
from swarmwire.comms.radio.config.phy import Antenna, Shadowing
from swarmwire.metrics.real.radio_fit.delay import LatencyFit
from swarmwire.metrics.real.radio_fit.fit import NetworkFit, RadioFit
from swarmwire.metrics.real.radio_fit.losses import NAMES, LossFit
from swarmwire.metrics.real.radio_fit.path_loss import EstimatedValue, PathLossFit
from swarmwire.metrics.real.radio_fit.shadowing import ShadowingFit

MAX_LINKS = 30  # that are told one by one: the worst
DISK = {"range_m": 1.0}  # what a table without path loss is put into
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
WORDS = {
    "bad_s": "bursts: mean duration",
    "good_s": "bursts: mean time between",
    "loss_bad": "bursts: loss within",
    "loss_good": "bursts: loss between",
}
DIGITS = 4
EVERYWHERE_M = 1000.0  # where no distance is known: the losses are those of all links, however long
QUICK_BPS = 1_000_000_000  # latencies that were measured hold the time on air, too


class FitRow(NamedTuple):
    """One line; a parameter that was left out has a reason instead of a value."""

    parameter: str
    estimate: EstimatedValue | None
    unit: str
    left_out: str = ""


def parameter_rows(fit: RadioFit) -> Iterator[FitRow]:
    """Every parameter, fitted or left out."""
    line, field, losses = fit.path_loss, fit.shadowing, fit.losses
    if isinstance(line, PathLossFit):
        yield FitRow("path loss exponent", line.exponent, "")
        yield FitRow("RSSI at 1 m", line.rssi_at_1_m_dbm, "dBm")
    else:
        yield FitRow("path loss", None, "", line)
    if isinstance(field, ShadowingFit):
        yield FitRow("shadowing: sigma", field.deviation_db, "dB")
        yield FitRow("shadowing: correlation distance", field.correlation_m, "m")
        yield FitRow("noise from packet to packet", field.noise_db, "dB")
    else:
        yield FitRow("shadowing", None, "", field)
    yield from loss_rows(losses, fit.sequences.interval_s)


def loss_rows(losses: LossFit | str, interval_s: float) -> Iterator[FitRow]:
    """Losses, single and in bursts, of packets that are usually so long apart."""
    if isinstance(losses, str):
        yield FitRow("losses", None, "", losses)
        return
    yield FitRow("loss", losses.loss, "")
    bursts = losses.chosen.bursts
    if bursts is None:
        yield FitRow("bursts", None, "", "losses are no burstier than single ones")
        return
    for name in NAMES:
        error = losses.chosen.errors.get(name, math.nan)
        yield FitRow(WORDS[name], EstimatedValue(getattr(bursts, name), error), "s" if name.endswith("_s") else "")
    turned = 1.0 - math.exp(-interval_s * (1.0 / bursts.bad_s + 1.0 / bursts.good_s))
    for name, share in (("p, good to bad", bursts.bad_share), ("r, bad to good", 1.0 - bursts.bad_share)):
        yield FitRow(f"{name} in {interval_s:.3g} s", EstimatedValue(share * turned, math.nan), "")


def residual_rows(fit: RadioFit) -> Iterator[tuple[str, str]]:
    """The residuals of the line of path loss, as text."""
    residual_db = fit.residual_db
    if len(residual_db):
        yield "root mean square", f"{float(np.sqrt(np.mean(residual_db**2))):.2f} dB"
        for share, value in zip(QUANTILES, np.quantile(residual_db, QUANTILES).tolist(), strict=True):
            yield f"{share:.0%} below", f"{value:+.2f} dB"


def radio_table(fit: RadioFit, antenna: Antenna) -> dict[str, Any]:
    """`{"radio": {...}}` with the parameters that were fitted.

    RSSI gives power, gains and reference loss only in sum: the antenna is an input.
    """
    radio: dict[str, Any] = {}
    tables: dict[str, Any] = {}
    if isinstance(fit.path_loss, PathLossFit):
        sent_dbm = antenna.power_dbm + 2.0 * antenna.gain_dbi
        line = LogDistance(fit.path_loss.exponent.value, sent_dbm - fit.path_loss.rssi_at_1_m_dbm.value)
        radio["model"] = "log-distance"
        tables["log_distance"] = _table(line, ("exponent", "reference_loss_db"))
        tables["antenna"] = _table(antenna, ("power_dbm", "gain_dbi"))
    if isinstance(fit.shadowing, ShadowingFit):
        field = Shadowing(fit.shadowing.deviation_db.value, fit.shadowing.correlation_m.value)
        tables["shadowing"] = _table(field, ("deviation_db", "correlation_m"))
    return {"radio": {**radio, **tables, **loss_table(fit.losses)}}


def loss_table(losses: LossFit | str) -> dict[str, Any]:
    """`loss`, or the table `bursts`, by the model that fits best; empty without a fit."""
    if isinstance(losses, str):
        return {}
    bursts = losses.chosen.bursts
    return {"loss": rounded(losses.loss.value)} if bursts is None else {"bursts": _table(bursts, NAMES)}


def _table(parameters: object, keys: tuple[str, ...]) -> dict[str, float]:
    return {key: rounded(getattr(parameters, key)) for key in keys}


def rounded(value: float) -> float:
    """As many digits as any fit can mean."""
    return float(f"{value:.{DIGITS}g}")


def network_rows(fit: NetworkFit) -> Iterator[FitRow]:
    """Every parameter, fitted or left out."""
    if isinstance(fit.range, str):
        yield FitRow("range", None, "", fit.range)
    else:
        yield FitRow("range" if fit.range.reached else "range, at least", fit.range.range_m, "m")
    yield from loss_rows(fit.losses, fit.sequences.interval_s)
    if isinstance(fit.latency, str):
        yield FitRow("latency", None, "", fit.latency)
        return
    delays = fit.latency.delays
    if delays is not None:
        yield FitRow("latency", delays.latency_s, "s")
        yield FitRow(f"{delays.distribution} delay, mean", delays.mean_s, "s")
        yield FitRow(f"{delays.distribution} delay, deviation", delays.deviation_s, "s")
        return
    yield FitRow("latency", fit.latency.latency_s, "s")
    yield FitRow("jitter", fit.latency.jitter_s, "s")


def network_table(fit: NetworkFit) -> dict[str, Any]:
    """`{"radio": {...}}` with the parameters that were fitted; an empty table without losses and delays."""
    if isinstance(fit.losses, str) and isinstance(fit.latency, str):
        return {"radio": {}}
    range_m = EVERYWHERE_M if isinstance(fit.range, str) else rounded(fit.range.range_m.value)
    radio: dict[str, Any] = {"model": "unit-disk", "range_m": range_m}
    if isinstance(fit.latency, LatencyFit):
        delays = fit.latency.delays
        radio["latency_s"] = rounded((fit.latency if delays is None else delays).latency_s.value)
        radio["jitter_s"] = rounded(fit.latency.jitter_s.value) if delays is None else 0.0
        radio["bit_rate_bps"] = QUICK_BPS
    radio |= loss_table(fit.losses)
    if isinstance(fit.latency, LatencyFit) and fit.latency.delays is not None:
        delays = fit.latency.delays
        radio["delays"] = {
            "distribution": delays.distribution,
            "mean_s": rounded(delays.mean_s.value),
            "deviation_s": rounded(delays.deviation_s.value),
        }
    if fit.log.has_distances:
        radio["measures"] = {"range": {}, "bearing": {}}
    return {"radio": radio}


def network_comments(fit: NetworkFit) -> list[str]:
    """Comments for readers of the table."""
    comments: list[str] = []
    if isinstance(fit.range, str):
        comments.append("No distance is known: everybody is within reach, and loss does not depend on distance.")
    elif not fit.range.reached:
        comments.append("range_m is the farthest that was tried: the network may reach farther.")
    if fit.log.has_distances:
        comments.append(
            "measures: the robots' tracker gave range and bearing of received packets; in a run they are exact."
        )
    if isinstance(fit.latency, LatencyFit):
        comments.append("Latencies hold the time on air, too: bit_rate_bps is so high that it adds nothing.")
    return comments


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


def _rows(fit: RadioFit | NetworkFit) -> list[FitRow]:
    return list(parameter_rows(fit) if isinstance(fit, RadioFit) else network_rows(fit))


def print_parameters(rows: Sequence[FitRow], console: Console) -> None:
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


def _figures(row: FitRow) -> tuple[str, str]:
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


def fit_toml(fit: RadioFit | NetworkFit, antenna: Antenna, file: Path) -> str:
    """The table `[radio]`, with what was left out as comments.

    BadInput where nothing could be fitted, or where a scenario would refuse what was.
    """
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
    from swarmwire.deploy.runs.scenario_parts import checked_radio  # numba takes a second

    whole = table["radio"] if "model" in table["radio"] else {**DISK, **table["radio"]}
    try:
        checked_radio(whole, str(file))
    except BadInput as error:
        raise BadInput(str(file), f"fitted {error.key}", f"{error.expected}, which no scenario takes") from None
