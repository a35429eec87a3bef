"""`swarmwire radio probe`."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.cli.options import USUAL_SIZE_PX, AsJson

if TYPE_CHECKING:
    from swarmwire.deploy.radio.coverage_probe import CoverageProbe

POINTS, JSON_POINTS = 200, 50  # of the map, along the longer side of the arena


def probe_command(
    subject: Annotated[
        str,
        typer.Argument(help="A scenario, a TOML file, or a radio that `swarmwire list presets` tells.", metavar="WHAT"),
    ],
    contention: Annotated[
        str | None,
        typer.Option(
            metavar="N,BYTES,INTERVAL_S", help="Of a preset: nodes in one spot, what each sends, and how often."
        ),
    ] = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help="Set a value by its path: radio.loss=0.1.")
    ] = None,
    runs: Annotated[int, typer.Option(min=1, max=10_000, help="With --contention: how many runs, seeds 1, 2, …")] = 10,
    measured_s: Annotated[
        float, typer.Option(min=0.001, max=3600, help="With --contention: measured time of each.")
    ] = 2.0,
    at: Annotated[
        str | None, typer.Option(help="Of a scenario: the place in m that the map is drawn from.", metavar="X,Y")
    ] = None,
    robot: Annotated[
        str | None, typer.Option("--from", help="Instead: the robot. Default: the first.", metavar="ROBOT")
    ] = None,
    payload_bytes: Annotated[
        int | None, typer.Option("--bytes", help="Of a scenario: payload. Default: the most the radio takes.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed instead of the scenario's.")] = None,
    to: Annotated[Path | None, typer.Option(help="Draw the coverage: .png, .svg or .pdf.")] = None,
    size: Annotated[int, typer.Option(help="Longer side of the picture in pixels.")] = USUAL_SIZE_PX,
    as_json: AsJson = False,
) -> None:
    """Tell what a radio does by itself.

    A scenario: the strength over its arena from one place, and the delivery of lone packets over distance, as walls and
    shadowing make it; without robots in between. A preset: delivery ratio and mean delay among nodes in one spot that
    all broadcast, as JSON. For example:

      swarmwire radio probe scenarios/flocking-802154.toml --to coverage.png

      swarmwire radio probe ieee802154 --contention 20,20,0.1
    """
    of_scenario = {"--at": at, "--from": robot, "--bytes": payload_bytes, "--seed": seed, "--to": to}
    if Path(subject).suffix == ".toml":
        if contention is not None:
            raise BadInput("--contention", "", "expected a preset, not a scenario")
        if at is not None and robot is not None:
            raise BadInput("--from", "", "expected either --at or --from")
        _probe_scenario(subject, at, robot, payload_bytes, seed, settings or [], to, size, as_json=as_json)
        return
    for option, given in of_scenario.items():
        if given is not None:
            raise BadInput(option, "", f"expected a scenario's .toml with it, got {subject}")
    _probe_contention(subject, contention, settings or [], runs, measured_s)


def _probe_scenario(
    scenario: str,
    at: str | None,
    robot: str | None,
    payload_bytes: int | None,
    seed: int | None,
    settings: list[str],
    to: Path | None,
    size_px: int,
    *,
    as_json: bool,
) -> None:
    # Imported here: pydantic and numba take a second, which --help should not.
    from rich.console import Console

    from swarmwire.deploy.compiling import compiling_told
    from swarmwire.deploy.radio.coverage_probe import probe_coverage
    from swarmwire.deploy.radio.coverage_report import coverage_json, print_coverage
    from swarmwire.metrics.drawing.canvas import check_picture

    if to is not None:
        check_picture(to)
    with compiling_told(Console(stderr=True)):
        probe = probe_coverage(
            Path(scenario),
            seed=seed,
            overrides=settings,
            at_m=None if at is None else _place(at),
            robot=robot,
            payload_bytes=payload_bytes,
            points=JSON_POINTS if as_json and to is None else POINTS,
        )
    if as_json:
        typer.echo(json.dumps(coverage_json(probe)))
    else:
        print_coverage(probe, Console(highlight=False))
    if to is not None:
        _draw(probe, to, size_px)
        typer.echo(f"written: {to}", err=as_json)


def _draw(probe: "CoverageProbe", to: Path, size_px: int) -> None:
    from swarmwire.metrics.drawing.radio import draw_coverage

    title = f"{probe.static.name}: packets of {probe.payload_bytes} bytes"
    draw_coverage(probe.static, probe.map, probe.distances, probe.sensitivity_dbm, title, to, size_px)


def _probe_contention(preset: str, contention: str | None, settings: list[str], runs: int, measured_s: float) -> None:
    from rich.console import Console

    from swarmwire.comms.radio.analysis.contention import contention as contend
    from swarmwire.deploy.compiling import compiling_told
    from swarmwire.deploy.radio.probe import radio_of

    radio = radio_of(preset, settings)
    nodes, payload_bytes, interval_s = _parts(contention or "")
    most = radio.max_payload_bytes
    if payload_bytes > most:
        raise BadInput("--contention", "", f"expected 0 to {most} bytes, which the radio takes; got {payload_bytes}")
    with compiling_told(Console(stderr=True)):
        found = contend(radio, nodes, payload_bytes, interval_s, range(1, runs + 1), measured_s=measured_s)
    typer.echo(json.dumps(asdict(found)))


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
