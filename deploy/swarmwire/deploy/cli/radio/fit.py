"""`swarmwire radio fit`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.cli.options import USUAL_SIZE_PX

if TYPE_CHECKING:
    from swarmwire.comms.radio.config.phy import Antenna
    from swarmwire.metrics.radio_fit.fit import NetworkFit, RadioFit


def fit_command(
    file: Annotated[
        Path,
        typer.Argument(
            help="CSV or Parquet with t_s, tx, rx, seq, rssi_dbm, and tx_x_m, tx_y_m, rx_x_m, rx_y_m or distance_m; "
            "or a folder of robots' logs, or a CSV of theirs, without rssi_dbm.",
            metavar="FILE",
        ),
    ],
    to: Annotated[Path | None, typer.Option(help="Draw the fit: .png, .svg or .pdf.")] = None,
    write: Annotated[
        Path | None, typer.Option(help="The .toml to write the radio's table to. Default: print it.")
    ] = None,
    power_dbm: Annotated[float, typer.Option(help="Power that the robots sent with, in dBm.")] = 0.0,
    gain_dbi: Annotated[float, typer.Option(help="Gain of their antennas, in dBi.")] = 0.0,
    within: Annotated[
        float | None, typer.Option(help="Use packets at most so many metres apart only.", metavar="M")
    ] = None,
    size: Annotated[int, typer.Option(help="Longer side of the picture in pixels.")] = USUAL_SIZE_PX,
) -> None:
    """Fit a radio's parameters to a log of real robots: path loss, shadowing, and losses, single or in bursts.

    A packet is lost if its row has no rssi_dbm, or if its number is missing between two rows of a link. Numbers count
    what was sent on a link (or by a robot to all). The table fits into a scenario as it stands; without path loss it
    is for a radio that has a model or a range of its own.

    Robots' networks tell no strengths: of their logs range, losses and latencies are fitted, and the delivery of
    each link is told. Every row is a packet that arrived; what was sent and not received was lost.
    """
    from rich.console import Console

    from swarmwire.deploy.radio.fit_report import print_fit
    from swarmwire.deploy.radio.fit_toml import radio_fit_toml
    from swarmwire.metrics.atomic import check_output_path
    from swarmwire.metrics.drawing.canvas import check_picture

    if write is not None:
        check_output_path(write, (".toml",))
    if to is not None:
        check_picture(to)
    if not file.exists():
        raise BadInput(str(file), "", "expected a log: there is no such file or folder")
    antenna = _antenna(power_dbm, gain_dbi)
    network = _network(file, within)
    if network is not None:
        _tell_network(network, file, to, write, size)
        return
    fit = _fit(file, within)
    text = radio_fit_toml(fit, antenna, file)
    print_fit(fit, str(file), Console(highlight=False, markup=False))
    if to is not None:
        from swarmwire.metrics.drawing.radio_fit import draw_radio_fit

        draw_radio_fit(fit, file.name, to, size)
        typer.echo(f"written: {to}")
    _write(text, write)


def _fit(file: Path, within_m: float | None) -> "RadioFit":
    from swarmwire.metrics.radio_fit.fit import fit_radio
    from swarmwire.metrics.radio_fit.logs import read_log

    log = read_log(file)
    if within_m is not None:
        log = log.within(within_m)
        if not len(log.link):
            raise BadInput("--within", "", f"expected a distance within which there are packets, got {within_m:g} m")
    return fit_radio(log)


def _network(path: Path, within_m: float | None) -> "NetworkFit | None":
    """The fit of robots' logs; None: it is a table with strengths."""
    from swarmwire.metrics.radio_fit.fit import fit_network
    from swarmwire.metrics.radio_fit.logs import (
        is_network_table,
        network_log_of_robots,
        network_log_of_table,
    )
    from swarmwire.metrics.real_log.real_logs import read_real_logs

    if path.is_dir():
        log = network_log_of_robots(read_real_logs(path))
    elif is_network_table(path):
        log = network_log_of_table(path)
    else:
        return None
    if within_m is not None:
        log = log.within(within_m)
        if not len(log.lost):
            raise BadInput("--within", "", f"expected a distance within which there are packets, got {within_m:g} m")
    return fit_network(log)


def _tell_network(fit: "NetworkFit", file: Path, to: Path | None, write: Path | None, size: int) -> None:
    from rich.console import Console

    from swarmwire.deploy.radio.fit_toml import network_fit_toml
    from swarmwire.deploy.radio.network_report import print_network_fit

    text = network_fit_toml(fit, file)
    print_network_fit(fit, str(file), Console(highlight=False, markup=False))
    if to is not None:
        from swarmwire.metrics.drawing.radio_fit import draw_network_fit

        draw_network_fit(fit, file.name, to, size)
        typer.echo(f"written: {to}")
    _write(text, write)


def _antenna(power_dbm: float, gain_dbi: float) -> "Antenna":
    """The antenna that the robots had; BadInput for one that no scenario takes."""
    from dataclasses import fields

    from swarmwire.comms.config import bounds_of, fault_of
    from swarmwire.comms.radio.config.phy import Antenna

    antenna = Antenna(power_dbm, gain_dbi)
    for of in fields(antenna):
        fault = fault_of(getattr(antenna, of.name), bounds_of(of))
        if fault is not None:
            raise BadInput(f"--{of.name.replace('_', '-')}", "", fault)
    return antenna


def _write(text: str, to: Path | None) -> None:
    from swarmwire.metrics.atomic import output_file

    if to is None:
        typer.echo(text, nl=False)
        return
    with output_file(to) as part:
        part.write_text(text, encoding="utf-8")
    typer.echo(f"written: {to}")
