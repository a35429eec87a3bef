"""`swarmwire robots logs`."""

from pathlib import Path
from typing import Annotated

import typer

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.cli.robots.acting import act, tell
from swarmwire.deploy.cli.robots.options import FleetFile, OfGroups, OfRobots, chosen


def logs_command(
    file: FleetFile,
    robots: OfRobots = None,
    groups: OfGroups = None,
    lines: Annotated[int, typer.Option(min=0, help="Of each robot, the last ones.")] = 10,
    follow: Annotated[bool, typer.Option("--follow", "-f", help="Go on with what they print, until Ctrl-C.")] = False,
    fetch: Annotated[
        Path | None,
        typer.Option(help="Bring the log of each robot's last start to this folder, for parity.", metavar="DIR"),
    ] = None,
) -> None:
    """Show what robots' agents print, or fetch their logs.

    Exit code 1: not of every robot. For example:

      swarmwire robots logs fleet.toml --robots flock-0 --follow

      swarmwire robots logs fleet.toml --fetch logs/monday
    """
    if follow and fetch is not None:
        raise BadInput("--fetch", "", "expected either --follow or --fetch")
    fleet, mine = chosen(file, robots, groups)
    from swarmwire.deploy.fleet.logs import fetch_logs, show_logs

    if fetch is not None:
        tell(act(lambda _: fetch_logs(fleet, mine, fetch)))
        return
    width = max(len(robot.name) for robot in mine)
    results = act(
        lambda _: show_logs(
            fleet, mine, lines, lambda robot, line: typer.echo(f"{robot:{width}}  {line}"), follow=follow
        )
    )
    failed = [result for result in results if not result.good]
    if failed:
        tell(failed)
