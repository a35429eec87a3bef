"""`swarmwire robots status`."""

import json
from dataclasses import asdict
from typing import TYPE_CHECKING

import typer

from swarmwire.deploy.cli.exit_codes import FAILED
from swarmwire.deploy.cli.options import AsJson
from swarmwire.deploy.cli.robots.acting import act
from swarmwire.deploy.cli.robots.options import FleetFile, OfGroups, OfRobots, chosen

if TYPE_CHECKING:
    from swarmwire.deploy.fleet.units import RobotState

COLUMNS = ("robot", "unit", "release", "since", "tick", "late", "charge", "agent")


def status_command(file: FleetFile, robots: OfRobots = None, groups: OfGroups = None, as_json: AsJson = False) -> None:
    """Tell what each robot runs, since when, and what its agent says of itself.

    Exit code 1: something is wrong. For example:

      swarmwire robots status fleet.toml
    """
    fleet, mine = chosen(file, robots, groups)
    from swarmwire.deploy.fleet.units import status

    states = act(lambda watcher: status(fleet, mine, watcher))
    if as_json:
        typer.echo(json.dumps([asdict(state) for state in states]))
    else:
        _print(states)
    if not all(state.good for state in states):
        raise typer.Exit(FAILED)


def _print(states: "list[RobotState]") -> None:
    """A table of robots that were asked, and below it, as wide as the terminal, why others were not."""
    from rich.console import Console

    from swarmwire.deploy.fleet.result import Result, result_lines
    from swarmwire.deploy.terminal.rows import print_rows

    rows = [_row(state) for state in states if not state.fault]
    if rows:
        print_rows(COLUMNS, rows, Console(highlight=False))
    faults = [Result(state.robot, False, state.fault) for state in states if state.fault]
    if faults:
        typer.echo("\n".join(result_lines(faults)))


def _row(state: "RobotState") -> tuple[str, ...]:
    agent = state.agent
    charge = agent.get("charge")
    return (
        state.robot,
        state.unit + (f", {state.restarts} restarts" if state.restarts else ""),
        state.release,
        state.since,
        str(agent.get("tick", "")),
        str(agent.get("late_ticks", "")),
        f"{charge:.0%}" if isinstance(charge, float) else "",
        str(agent.get("state", "")),
    )
