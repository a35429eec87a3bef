"""`swarmwire robots estop`."""

from swarmwire.deploy.cli.robots.acting import act, tell
from swarmwire.deploy.cli.robots.options import FleetFile, OfGroups, OfRobots, chosen


def estop_command(file: FleetFile, robots: OfRobots = None, groups: OfGroups = None) -> None:
    """Stop robots at once, over the swarm's network and by SSH at the same time.

    A line per robot tells by which way it was confirmed. Exit code 1: one of them is not confirmed, so switch it off
    by hand. For example, all robots:

      swarmwire robots estop fleet.toml
    """
    fleet, mine = chosen(file, robots, groups)
    from swarmwire.deploy.fleet.units import estop

    tell(act(lambda watcher: estop(fleet, mine, watcher)))
