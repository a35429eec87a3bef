"""`swarmwire radio`: what an emulated radio does by itself, and what logs of real ones say."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarmwire.comms.base.config import scenario_path
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.cli.options import AsJson, Overrides, Seed
from swarmwire.deploy.terminal.output import echo

if TYPE_CHECKING:
    from swarmwire.comms.radio.config.phy import Antenna
    from swarmwire.deploy.cli.radio_coverage import CoverageProbe
    from swarmwire.metrics.real.radio_fit.fit import NetworkFit, RadioFit


radio_app = typer.Typer(
    help="Probe an emulated radio without a run, or fit one to logs of real robots.",
    no_args_is_help=True,
)


@radio_app.command("fit")
def fit_command(
    file: Annotated[
        Path,
        typer.Argument(
            help="CSV or Parquet with t_s, tx, rx, seq, rssi_dbm, and tx_x_m, tx_y_m, rx_x_m, rx_y_m or distance_m; "
            "or a folder of robots' logs, or a CSV of theirs, without rssi_dbm.",
            metavar="FILE",
        ),
    ],
    to: Annotated[
        list[Path] | None,
        typer.Option(
            help="Write a file. .toml: the radio's table, printed otherwise; .png, .svg or .pdf: a drawing of the fit. "
            "Repeatable.",
            metavar="FILE",
        ),
    ] = None,
    power_dbm: Annotated[float, typer.Option(help="Transmit power of the robots, in dBm.")] = 0.0,
    gain_dbi: Annotated[float, typer.Option(help="Gain of their antennas, in dBi.")] = 0.0,
    within: Annotated[
        float | None, typer.Option(help="Use only packets over at most this distance, in m.", metavar="M")
    ] = None,
) -> None:
    """Fit a radio's parameters to a log of real robots: path loss, shadowing, and losses, single or in bursts.

    A packet is lost if its row has no rssi_dbm, or if its number is missing between two rows of a link. Numbers count
    what was sent on a link (or by a robot to all). The table fits into a scenario as it stands; without path loss it
    is for a radio that has a model or a range of its own.

    Robots' networks report no signal strength: range, losses and latencies are fitted to their logs, and the delivery
    of each link is printed. Every row is a packet that arrived; a packet sent without such a row was lost.
    """
    from swarmwire.comms.base.atomic import check_output_path, output_file
    from swarmwire.deploy.cli.radio_fit import fit_toml, print_fit
    from swarmwire.deploy.terminal.console import TerminalConsole

    for path in to or []:
        check_output_path(path, (".toml", ".png", ".svg", ".pdf"))
    if not file.exists():
        raise BadInput(str(file), "", "expected a log: there is no such file or folder")
    antenna = _antenna(power_dbm, gain_dbi)
    fit = _fit(file, within)
    text = fit_toml(fit, antenna, file)
    print_fit(fit, str(file), TerminalConsole())
    tables = [path for path in to or [] if path.suffix.lower() == ".toml"]
    for path in to or []:
        if path in tables:
            with output_file(path) as part:
                part.write_text(text, encoding="utf-8")
        else:
            _draw_fit(fit, file.name, path)
        echo(f"written: {path}")
    if not tables:
        echo(text, nl=False)


def _draw_fit(fit: "RadioFit | NetworkFit", title: str, to: Path) -> None:
    from swarmwire.metrics.pictures.drawing.radio_fit import draw_network_fit, draw_radio_fit
    from swarmwire.metrics.real.radio_fit.fit import RadioFit

    if isinstance(fit, RadioFit):
        draw_radio_fit(fit, title, to)
    else:
        draw_network_fit(fit, title, to)


def _fit(path: Path, within_m: float | None) -> "RadioFit | NetworkFit":
    """The fit of a table with strengths, or of robots' logs."""
    from swarmwire.metrics.real.radio_fit.fit import fit_network, fit_radio
    from swarmwire.metrics.real.radio_fit.logs import (
        PacketLog,
        is_network_table,
        network_log_of_robots,
        network_log_of_table,
        read_log,
    )
    from swarmwire.metrics.real.real_log.real_logs import read_real_logs

    if path.is_dir():
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


def _antenna(power_dbm: float, gain_dbi: float) -> "Antenna":
    """The antenna that the robots had; BadInput for one that no scenario takes."""
    from dataclasses import fields

    from swarmwire.comms.base.config import bounds_of, fault_of
    from swarmwire.comms.radio.config.phy import Antenna

    antenna = Antenna(power_dbm, gain_dbi)
    for of in fields(antenna):
        fault = fault_of(getattr(antenna, of.name), bounds_of(of))
        if fault is not None:
            raise BadInput(f"--{of.name.replace('_', '-')}", "", fault)
    return antenna


POINTS, JSON_POINTS = 200, 50  # of the map, along the longer side of the arena


@radio_app.command("probe")
def probe_command(
    subject: Annotated[
        str,
        typer.Argument(help="A scenario, a TOML file, or a radio that `swarmwire list presets` names.", metavar="WHAT"),
    ],
    contention: Annotated[
        str | None,
        typer.Option(
            metavar="N,BYTES,INTERVAL_S", help="Of a preset: nodes at one place, payload and sending rate of each."
        ),
    ] = None,
    settings: Overrides = None,
    runs: Annotated[
        int, typer.Option(min=1, max=10_000, help="With --contention: number of runs of 2 s, seeds 1, 2, …")
    ] = 10,
    at: Annotated[
        str | None, typer.Option(help="Of a scenario: the place in m that the map is drawn from.", metavar="X,Y")
    ] = None,
    robot: Annotated[
        str | None, typer.Option("--from", help="Instead: the robot. Default: the first.", metavar="ROBOT")
    ] = None,
    payload_bytes: Annotated[
        int | None, typer.Option("--bytes", help="Of a scenario: payload. Default: the most the radio takes.")
    ] = None,
    seed: Seed = None,
    to: Annotated[Path | None, typer.Option(help="Draw the coverage: .png, .svg or .pdf.")] = None,
    as_json: AsJson = False,
) -> None:
    """Probe a radio without a run: coverage, delivery over distance, contention.

    A scenario: the strength over its arena from one place, and the delivery of lone packets over distance, as walls and
    shadowing make it; without robots in between. A preset: PDR and mean delay among nodes in one spot that
    all broadcast, as JSON. For example:

      swarmwire radio probe scenarios/flocking-802154.toml --to coverage.png

      swarmwire radio probe ieee802154 --contention 20,20,0.1
    """
    of_scenario = {"--at": at, "--from": robot, "--bytes": payload_bytes, "--seed": seed, "--to": to}
    scenario = scenario_path(subject)
    if scenario.suffix == ".toml":
        if contention is not None:
            raise BadInput("--contention", "", "expected a preset, not a scenario")
        if at is not None and robot is not None:
            raise BadInput("--from", "", "expected either --at or --from")
        _probe_scenario(scenario, at, robot, payload_bytes, seed, settings or [], to, as_json=as_json)
        return
    for option, given in of_scenario.items():
        if given is not None:
            raise BadInput(option, "", f"expected a scenario's .toml with it, got {subject}")
    _probe_contention(subject, contention, settings or [], runs)


def _probe_scenario(
    scenario: Path,
    at: str | None,
    robot: str | None,
    payload_bytes: int | None,
    seed: int | None,
    settings: list[str],
    to: Path | None,
    *,
    as_json: bool,
) -> None:
    # Imported here: pydantic and numba take a second, which --help should not.
    from swarmwire.deploy.cli.radio_coverage import coverage_json, print_coverage, probe_coverage
    from swarmwire.deploy.machine import report_compiling
    from swarmwire.deploy.terminal.console import TerminalConsole
    from swarmwire.metrics.pictures.drawing.canvas import check_picture

    if to is not None:
        check_picture(to)
    with report_compiling(TerminalConsole(stderr=True)):
        probe = probe_coverage(
            scenario,
            seed=seed,
            overrides=settings,
            at_m=None if at is None else _place(at),
            robot=robot,
            payload_bytes=payload_bytes,
            points=JSON_POINTS if as_json and to is None else POINTS,
        )
    if as_json:
        echo(json.dumps(coverage_json(probe)))
    else:
        print_coverage(probe, TerminalConsole())
    if to is not None:
        _draw(probe, to)
        echo(f"written: {to}", err=as_json)


def _draw(probe: "CoverageProbe", to: Path) -> None:
    from swarmwire.metrics.pictures.drawing.radio import draw_coverage

    title = f"{probe.static.name}: packets of {probe.payload_bytes} bytes"
    draw_coverage(probe.static, probe.map, probe.distances, probe.sensitivity_dbm, title, to)


def _probe_contention(preset: str, contention: str | None, settings: list[str], runs: int) -> None:
    from swarmwire.comms.radio.analysis.contention import contention as contend
    from swarmwire.deploy.machine import report_compiling
    from swarmwire.deploy.runs.scenario_parts import radio_of
    from swarmwire.deploy.terminal.console import TerminalConsole

    radio = radio_of(preset, settings)
    nodes, payload_bytes, interval_s = _parts(contention or "")
    most = radio.max_payload_bytes
    if payload_bytes > most:
        raise BadInput("--contention", "", f"expected 0 to {most} bytes, which the radio takes; got {payload_bytes}")
    with report_compiling(TerminalConsole(stderr=True)):
        found = contend(radio, nodes, payload_bytes, interval_s, range(1, runs + 1))
    echo(json.dumps(asdict(found)))


def _place(text: str) -> tuple[float, float]:
    try:
        x_m, y_m = (float(part) for part in text.split(","))
    except ValueError:
        raise BadInput("--at", "", "expected x and y in m, such as 1.5,-2") from None
    return x_m, y_m


def _parts(text: str) -> tuple[int, int, float]:
    expected = "expected nodes (2 or more), bytes and an interval of 0.001 to 1 s, such as 20,20,0.1"
    try:
        nodes, payload_bytes, interval_s = text.split(",")
        found = int(nodes), int(payload_bytes), float(interval_s)
    except ValueError:
        raise BadInput("--contention", "", expected) from None
    if not (2 <= found[0] <= 10_000 and 0 <= found[1] <= 65_535 and 0.001 <= found[2] <= 1.0):
        raise BadInput("--contention", "", expected)
    return found
