"""`swarmwire robots deploy`."""

from pathlib import Path
from typing import Annotated

import typer

from swarmwire.deploy.cli.robots.acting import act, tell
from swarmwire.deploy.cli.robots.options import FleetFile, OfGroups, OfRobots, chosen


def deploy_command(
    file: FleetFile,
    robots: OfRobots = None,
    groups: OfGroups = None,
    restart: Annotated[
        bool, typer.Option("--restart", help="Start robots anew that run an older release. Default: they go on.")
    ] = False,
    wheels: Annotated[
        Path | None,
        typer.Option(help="A folder with the wheels that robots need, instead of the package index.", metavar="DIR"),
    ] = None,
) -> None:
    """Bring agents, settings and all packages that they need to robots, as releases that are switched to at once.

    Each is tried out on its robot first. What fails on one robot leaves that one as it was, and others go on; to do
    it again does only what is missing. Robots keep their last three releases.

    Exit code 0: all robots have it; 1: not every robot; 2: refused before anything was sent. For example:

      swarmwire robots deploy fleet.toml --group red --restart
    """
    fleet, mine = chosen(file, robots, groups)
    from swarmwire.deploy.fleet.check import contents_of
    from swarmwire.deploy.fleet.deploy import deploy
    from swarmwire.deploy.fleet.packages import LockedEnvironments

    contents = contents_of(fleet, mine)
    for error in contents.faults.values():
        raise error
    index = ("--no-index", "--find-links", str(wheels.resolve())) if wheels else ()
    environments = LockedEnvironments(index=index)
    tell(act(lambda watcher: deploy(fleet, mine, contents.entries, environments, watcher, restart=restart)))
