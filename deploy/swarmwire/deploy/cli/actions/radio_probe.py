"""`swarmwire radio probe`: coverage of a scenario's radio, or contention of a preset."""

import json
from dataclasses import asdict
from pathlib import Path

from swarmwire.comms.base.config import scenario_path
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.radio.analysis.contention import contention
from swarmwire.deploy.cli.actions.radio_coverage import CoverageProbe, coverage_json, print_coverage, probe_coverage
from swarmwire.deploy.cli.radio import ProbeOptions
from swarmwire.deploy.runs.compiling import report_compiling
from swarmwire.deploy.runs.scenario_parts import radio_of
from swarmwire.deploy.terminal.console import TerminalConsole
from swarmwire.deploy.terminal.output import echo
from swarmwire.metrics.pictures.drawing.canvas import check_picture
from swarmwire.metrics.pictures.drawing.radio import draw_coverage

MAP_POINTS, JSON_MAP_POINTS = 200, 50  # along the longer side of the arena
SCENARIO_OPTIONS = {"position": "--at", "robot": "--from", "payload_bytes": "--bytes", "seed": "--seed", "to": "--to"}


def probe_radio(options: ProbeOptions) -> None:
    """Print the coverage of a scenario, or the contention of a preset."""
    scenario = scenario_path(options.subject)
    if scenario.suffix == ".toml":
        _probe_scenario(scenario, options)
    else:
        _probe_preset(options)


def _probe_scenario(scenario: Path, options: ProbeOptions) -> None:
    if options.contention is not None:
        raise BadInput("--contention", "", "expected a preset, not a scenario")
    if options.position is not None and options.robot is not None:
        raise BadInput("--from", "", "expected either --at or --from")
    if options.to is not None:
        check_picture(options.to)
    with report_compiling(TerminalConsole(stderr=True)):
        probe = probe_coverage(
            scenario,
            seed=options.seed,
            overrides=options.overrides or (),
            position_m=None if options.position is None else _parse_position(options.position),
            robot=options.robot,
            payload_bytes=options.payload_bytes,
            points=JSON_MAP_POINTS if options.as_json and options.to is None else MAP_POINTS,
        )
    if options.as_json:
        echo(json.dumps(coverage_json(probe)))
    else:
        print_coverage(probe, TerminalConsole())
    if options.to is not None:
        _draw(probe, options.to)
        echo(f"written: {options.to}", err=options.as_json)


def _draw(probe: CoverageProbe, to: Path) -> None:
    title = f"{probe.static.name}: packets of {probe.payload_bytes} bytes"
    draw_coverage(probe.static, probe.map, probe.distances, probe.sensitivity_dbm, title, to)


def _probe_preset(options: ProbeOptions) -> None:
    for name, option in SCENARIO_OPTIONS.items():
        if getattr(options, name) is not None:
            raise BadInput(option, "", f"expected a scenario's .toml with it, got {options.subject}")
    radio = radio_of(options.subject, options.overrides or [])
    nodes, payload_bytes, interval_s = _parse_contention(options.contention or "")
    most = radio.max_payload_bytes
    if payload_bytes > most:
        raise BadInput("--contention", "", f"expected 0 to {most} bytes, which the radio takes; got {payload_bytes}")
    with report_compiling(TerminalConsole(stderr=True)):
        result = contention(radio, nodes, payload_bytes, interval_s, range(1, options.runs + 1))
    echo(json.dumps(asdict(result)))


def _parse_position(text: str) -> tuple[float, float]:
    try:
        x_m, y_m = (float(part) for part in text.split(","))
    except ValueError:
        raise BadInput("--at", "", "expected x and y in m, such as 1.5,-2") from None
    return x_m, y_m


def _parse_contention(text: str) -> tuple[int, int, float]:
    """Parse the number of nodes, the payload in bytes and the interval in s."""
    expected = "expected nodes (2 or more), bytes and an interval of 0.001 to 1 s, such as 20,20,0.1"
    try:
        first, second, third = text.split(",")
        nodes, payload_bytes, interval_s = int(first), int(second), float(third)
    except ValueError:
        raise BadInput("--contention", "", expected) from None
    if not (2 <= nodes <= 10_000 and 0 <= payload_bytes <= 65_535 and 0.001 <= interval_s <= 1.0):
        raise BadInput("--contention", "", expected)
    return nodes, payload_bytes, interval_s
