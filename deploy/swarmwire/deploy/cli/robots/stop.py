"""`swarmwire robots stop`."""

from swarmwire.deploy.cli.robots.acting import act, tell
from swarmwire.deploy.cli.robots.options import FleetFile, OfGroups, OfRobots, chosen


def stop_command(file: FleetFile, robots: OfRobots = None, groups: OfGroups = None) -> None:
    """Stop robots' agents, and with them their motors.

    Exit code 1: one of them is not known to have stopped. For example:

      swarmwire robots stop fleet.toml --robots flock-0,flock-3
    """
    fleet, mine = chosen(file, robots, groups)
    from swarmwire.deploy.fleet.units import stop

    tell(act(lambda watcher: stop(fleet, mine, watcher)))
