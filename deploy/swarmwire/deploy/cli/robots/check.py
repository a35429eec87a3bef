"""`swarmwire robots check`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.cli.robots.acting import act, tell
from swarmwire.deploy.cli.robots.options import FleetFile, OfGroups, OfRobots, chosen

if TYPE_CHECKING:
    from swarmwire.deploy.fleet.check import Contents
    from swarmwire.deploy.fleet.connecting import NewHost
    from swarmwire.deploy.fleet.fleet import Robot
    from swarmwire.deploy.fleet.result import Result


def check_command(
    file: FleetFile,
    robots: OfRobots = None,
    groups: OfGroups = None,
    trust: Annotated[
        bool, typer.Option("--trust", help="Show the keys of hosts that are new, and add them to known_hosts.")
    ] = False,
    offline: Annotated[
        bool, typer.Option("--offline", help="Check only what can be known here: settings, agents, what they need.")
    ] = False,
) -> None:
    """Check whether a deployment would work: settings, agents and their needs; each host, its Python, disk and clock.

    Nothing is changed on robots. Hosts are known by their keys: with --trust keys of new ones are kept; compare
    what is shown with `ssh-keygen -lf /etc/ssh/ssh_host_ed25519_key.pub` on the robot. A key that has changed is
    refused either way.

    Exit code 0: all is well; 1: not with every robot; 2: the fleet's file is wrong. For example, before the
    first deployment:

      swarmwire robots check fleet.toml --trust
    """
    fleet, mine = chosen(file, robots, groups)
    from swarmwire.deploy.fleet.check import check, contents_of
    from swarmwire.deploy.fleet.connecting import trust_new

    if trust and offline:
        raise BadInput("--trust", "", "expected either --trust or --offline")
    silent = set[tuple[str, int]]()
    if trust:
        hosts = [robot.host for robot in mine]
        found = act(lambda _: trust_new(hosts, fleet.known_hosts))
        _show(found, fleet.known_hosts)
        silent = {(new.host.address, new.host.port) for new in found if not new.line}
    contents = contents_of(fleet, mine)
    if offline:
        tell([told_here(robot.name, contents) for robot in mine])
        return
    there = [robot for robot in mine if (robot.host.address, robot.host.port) not in silent]
    results = {of.robot: of for of in act(lambda watcher: check(fleet, there, contents.faults, watcher))}
    tell([results.get(robot.name) or unanswered(robot) for robot in mine])


def unanswered(robot: "Robot") -> "Result":
    """The line of a robot whose host has shown no key."""
    from swarmwire.deploy.fleet.result import Result

    return Result(robot.name, False, f"{robot.host} does not answer", "is it switched on, and its address right?")


def told_here(robot: str, contents: "Contents") -> "Result":
    """A robot's line without its host."""
    from swarmwire.deploy.fleet.result import Result

    fault = contents.faults.get(robot)
    return Result(robot, fault is None, str(fault) if fault else contents.told[robot])


def _show(found: "list[NewHost]", known_hosts: Path) -> None:
    for new in found:
        told = f"{new.fingerprint}, added to {known_hosts}" if new.line else "did not answer"
        typer.echo(f"new: {new.host.address}:{new.host.port}: {told}")
