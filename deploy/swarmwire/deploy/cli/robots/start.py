"""`swarmwire robots start`."""

from swarmwire.deploy.cli.robots.acting import act, tell
from swarmwire.deploy.cli.robots.options import FleetFile, OfGroups, OfRobots, chosen


def start_command(file: FleetFile, robots: OfRobots = None, groups: OfGroups = None) -> None:
    """Start robots' agents; those that run go on.

    Exit code 1: one of them did not start. For example:

      swarmwire robots start fleet.toml --group red
    """
    fleet, mine = chosen(file, robots, groups)
    from swarmwire.deploy.fleet.units import start

    tell(act(lambda watcher: start(fleet, mine, watcher)))
