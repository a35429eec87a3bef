"""`swarmwire radio fit`: a radio's or a network's fit as rows in the terminal, and as TOML for a scenario."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tomli_w
from rich.console import Console
from rich.table import Table
from rich.text import Text

from swarmwire.comms.base.atomic import check_output_path, output_file
from swarmwire.comms.base.config import bounds_of, fault_of
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.protocols.ros2.bags import is_bag
from swarmwire.comms.radio.config.antennas import Antenna
from swarmwire.comms.radio.config.path_loss_models import LogDistance
from swarmwire.comms.radio.config.phy import Shadowing
from swarmwire.deploy.cli.actions.bag_logs import BagTopics, read_bag_logs
from swarmwire.deploy.runs.scenario_parts import checked_radio
from swarmwire.deploy.terminal.console import TerminalConsole
from swarmwire.deploy.terminal.output import echo
from swarmwire.metrics.real.radio_fit.delay import LatencyFit
from swarmwire.metrics.real.radio_fit.fit import NetworkFit, RadioFit, fit_network, fit_radio
from swarmwire.metrics.real.radio_fit.logs import (
    PacketLog,
    is_network_table,
    network_log_of_robots,
    network_log_of_table,
    read_log,
)
from swarmwire.metrics.real.radio_fit.losses import NAMES, LossFit
from swarmwire.metrics.real.radio_fit.path_loss import EstimatedValue, PathLossFit
from swarmwire.metrics.real.radio_fit.shadowing import ShadowingFit
from swarmwire.metrics.real.real_log.real_logs import read_real_logs

MAX_LINKS = 30  # rows of the table of links: the worst links
RANGE = {"range_m": 1.0}  # completes a table without path loss for its check
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
WORDS = {
    "bad_s": "bursts: mean duration",
    "good_s": "bursts: mean time between",
    "loss_bad": "bursts: loss within",
    "loss_good": "bursts: loss between",
}
DIGITS = 4
UNLIMITED_RANGE_M = 1000.0  # range without known distances: the losses are those of all links, however long
HIGH_BIT_RATE_BPS = 1_000_000_000  # measured latencies include the time on air


def fit_radio_file(
    log: Path, files: Sequence[Path], topics: BagTopics, *, power_dbm: float, gain_dbi: float, within_m: float | None
) -> None:
    """Fit a radio to a log, print the fit, and write the table (.toml) or a drawing to files."""
    for path in files:
        check_output_path(path, (".toml", ".png", ".svg", ".pdf"))
    if not log.exists():
        raise BadInput(str(log), "", "expected a log: there is no such file or folder")
    antenna = _antenna(power_dbm, gain_dbi)
    fit = _fit(log, topics, within_m)
    text = fit_toml(fit, antenna, log)
    print_fit(fit, str(log), TerminalConsole())
    tables = [path for path in files if path.suffix.lower() == ".toml"]
    for path in files:
        if path in tables:
            with output_file(path) as part:
                part.write_text(text, encoding="utf-8")
        else:
            _draw(fit, log.name, path)
        echo(f"written: {path}")
    if not tables:
        echo(text, nl=False)


def _antenna(power_dbm: float, gain_dbi: float) -> Antenna:
    """Return the antenna of the robots; BadInput for values that no scenario can have."""
    antenna = Antenna(power_dbm, gain_dbi)
    for parameter in fields(antenna):
        fault = fault_of(getattr(antenna, parameter.name), bounds_of(parameter))
        if fault is not None:
            raise BadInput(f"--{parameter.name.replace('_', '-')}", "", fault)
    return antenna


def _fit(path: Path, topics: BagTopics, within_m: float | None) -> RadioFit | NetworkFit:
    """Return the fit of a table with signal strengths, of robots' logs, or of a bag."""
    if is_bag(path):
        log = network_log_of_robots(read_bag_logs(path, topics))
    elif path.is_dir():
        log = network_log_of_robots(read_real_logs(path))
    elif is_network_table(path):
        log = network_log_of_table(path)
    else:
        log = read_log(path)
    if within_m is not None:
        log = log.within(within_m)
        if not len(log.link if isinstance(log, PacketLog) else log.lost):
            raise BadInput("--within", "", f"expected a distance within which there are packets, got {within_m:g} m")
    return fit_radio(log) if isinstance(log, PacketLog) else fit_network(log)


def _draw(fit: RadioFit | NetworkFit, title: str, to: Path) -> None:
    from swarmwire.metrics.pictures.drawing.radio_fit import draw_network_fit, draw_radio_fit  # needs matplotlib

    if isinstance(fit, RadioFit):
        draw_radio_fit(fit, title, to)
    else:
        draw_network_fit(fit, title, to)


class FitRow(NamedTuple):
    """A row of the table of parameters; one without a value has the reason."""

    parameter: str
    estimate: EstimatedValue | None
    unit: str
    left_out: str = ""


def parameter_rows(fit: RadioFit) -> Iterator[FitRow]:
    """Return a row for each parameter of a radio."""
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
    """Return a row for each parameter of losses; `interval_s` is the usual time between packets of a link."""
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
    """Return name and text of each statistic of the residuals of the path loss."""
    residual_db = fit.residual_db
    if len(residual_db):
        yield "root mean square", f"{float(np.sqrt(np.mean(residual_db**2))):.2f} dB"
        for share, value in zip(QUANTILES, np.quantile(residual_db, QUANTILES).tolist(), strict=True):
            yield f"{share:.0%} below", f"{value:+.2f} dB"


def radio_table(fit: RadioFit, antenna: Antenna) -> dict[str, Any]:
    """Return the table `{"radio": {...}}` of the fitted parameters.

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
    """Return `loss` or the table `bursts`, by the model that fits best; empty without a fit."""
    if isinstance(losses, str):
        return {}
    bursts = losses.chosen.bursts
    return {"loss": rounded(losses.loss.value)} if bursts is None else {"bursts": _table(bursts, NAMES)}


def _table(parameters: object, keys: tuple[str, ...]) -> dict[str, float]:
    return {key: rounded(getattr(parameters, key)) for key in keys}


def rounded(value: float) -> float:
    """Round to the significant digits of a fit."""
    return float(f"{value:.{DIGITS}g}")


def network_rows(fit: NetworkFit) -> Iterator[FitRow]:
    """Return a row for each parameter of a network."""
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
    """Return the table `{"radio": {...}}` of the fitted parameters, empty without losses and delays."""
    if isinstance(fit.losses, str) and isinstance(fit.latency, str):
        return {"radio": {}}
    range_m = UNLIMITED_RANGE_M if isinstance(fit.range, str) else rounded(fit.range.range_m.value)
    radio: dict[str, Any] = {"model": "unit-disk", "range_m": range_m}
    if isinstance(fit.latency, LatencyFit):
        delays = fit.latency.delays
        radio["latency_s"] = rounded((fit.latency if delays is None else delays).latency_s.value)
        radio["jitter_s"] = rounded(fit.latency.jitter_s.value) if delays is None else 0.0
        radio["bit_rate_bps"] = HIGH_BIT_RATE_BPS
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
    """Return comments for readers of the table."""
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
    """Print parameters with standard errors, residuals or links, models of loss, and notes on bias."""
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
    """Print the fitted parameters as a table, then the parameters without a value and the reasons."""
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
    """Print the models of loss with their AIC."""
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
    """Return an empty table with a title."""
    return Table(title=Text(title), show_header=header, title_justify="left", title_style="bold")


def _print_links(fit: NetworkFit, console: Console) -> None:
    shown = sorted(fit.links, key=lambda link: link.pdr)[:MAX_LINKS]
    selection = f", the worst {len(shown)} of {len(fit.links)}" if len(shown) < len(fit.links) else ""
    table = titled_table(f"delivery by link{selection}", header=True)
    for name in ("from", "to", "packets", "received", "delivery"):
        table.add_column(name, justify="left" if name in {"from", "to"} else "right")
    for link in shown:
        table.add_row(link.sender, link.receiver, str(link.packets), str(link.received), f"{link.pdr:.1%}")
    console.print(table)


def fit_toml(fit: RadioFit | NetworkFit, antenna: Antenna, file: Path) -> str:
    """Return the table `[radio]`, with the parameters without a value as comments.

    BadInput if nothing could be fitted, or if no scenario accepts the values.
    """
    table = radio_table(fit, antenna) if isinstance(fit, RadioFit) else network_table(fit)
    left_out = [f"{row.parameter}: {row.left_out}" for row in _rows(fit) if row.estimate is None]
    if not table["radio"]:
        raise BadInput(str(file), "", f"nothing could be fitted: {'; '.join(left_out)}")
    comments = [f"Fitted to {file.name} by swarmwire radio fit.", *(f"Left out: {reason}." for reason in left_out)]
    if isinstance(fit, NetworkFit):
        comments += network_comments(fit)
    elif "model" not in table["radio"]:
        comments.append("Without path loss this is no radio yet: put it into one that has a model or a range_m.")
    _refuse_unfit(table, file)
    return "".join(f"# {comment}\n" for comment in comments) + tomli_w.dumps(table)


def _refuse_unfit(table: dict[str, Any], file: Path) -> None:
    radio = table["radio"] if "model" in table["radio"] else {**RANGE, **table["radio"]}
    try:
        checked_radio(radio, str(file))
    except BadInput as error:
        raise BadInput(str(file), f"fitted {error.key}", f"{error.expected}, which no scenario takes") from None
