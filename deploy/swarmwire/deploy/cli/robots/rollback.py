"""`swarmwire robots rollback`."""

from swarmwire.deploy.cli.robots.acting import act, tell
from swarmwire.deploy.cli.robots.options import FleetFile, OfGroups, OfRobots, chosen


def rollback_command(file: FleetFile, robots: OfRobots = None, groups: OfGroups = None) -> None:
    """Go back to the release before; robots that run are started anew.

    Exit code 1: not for every robot. For example:

      swarmwire robots rollback fleet.toml --robots flock-3
    """
    fleet, mine = chosen(file, robots, groups)
    from swarmwire.deploy.fleet.units import rollback

    tell(act(lambda watcher: rollback(fleet, mine, watcher)))
