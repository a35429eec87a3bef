"""`swarmwire robots`: what runs on a fleet of real robots, over SSH, on all at the same time."""

import json
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.extras import FLEET
from swarmwire.deploy.cli.options import FAILED, AsJson, FleetFile, OfGroups, OfRobots
from swarmwire.deploy.terminal.output import echo

if TYPE_CHECKING:
    from swarmwire.deploy.robots.connecting import NewHost
    from swarmwire.deploy.robots.deploy import Contents
    from swarmwire.deploy.robots.fleet import Fleet, FleetRobot
    from swarmwire.deploy.robots.result import RobotResult, Watcher
    from swarmwire.deploy.robots.units import RobotState


robots_app = typer.Typer(
    help="Manage the real robots of a fleet.toml: deploy, start, stop and inspect them in parallel over SSH.",
    no_args_is_help=True,
)


def chosen(
    file: Path, robots: Sequence[str] | None, groups: Sequence[str] | None
) -> "tuple[Fleet, Sequence[FleetRobot]]":
    """The fleet and the robots that are meant; BadInput without the extra [fleet]."""
    FLEET.need("robots")
    from swarmwire.deploy.robots.fleet import names_in
    from swarmwire.deploy.robots.fleet_file import read_fleet

    fleet = read_fleet(file)
    return fleet, fleet.chosen(names_in(robots or ()), names_in(groups or ()))


T = TypeVar("T")


def act(work: "Callable[[Watcher], Awaitable[T]]") -> T:
    """The result of the work, whose progress is shown; Interrupted by Ctrl-C."""
    from swarmwire.deploy.robots.progress import watched  # asyncio, for which --help should not wait

    return watched(work, "are as they were before")


def tell(results: "Sequence[RobotResult]") -> None:
    """Print a line per robot; exit code 1 if one of them failed."""
    from swarmwire.deploy.robots.result import result_lines

    for line in result_lines(results):
        echo(line)
    failed = sum(not result.good for result in results)
    if failed:
        echo(f"{failed} of {len(results)} failed", err=True)
        raise typer.Exit(FAILED)


@robots_app.command("check")
def check_command(
    file: FleetFile,
    robots: OfRobots = None,
    groups: OfGroups = None,
    trust: Annotated[
        bool, typer.Option("--trust", help="Show the keys of hosts that are new, and add them to known_hosts.")
    ] = False,
    offline: Annotated[
        bool, typer.Option("--offline", help="Check settings, agents and their needs on this machine only.")
    ] = False,
) -> None:
    """Check whether a deployment would work: settings, agents and their needs; each host, its Python, disk and clock.

    Robots are not changed. Hosts are identified by their keys: --trust stores the keys of new hosts; compare
    them with `ssh-keygen -lf /etc/ssh/ssh_host_ed25519_key.pub` on the robot. A key that has changed is
    refused either way.

    Exit code 0: all is well; 1: not with every robot; 2: the fleet's file is wrong. For example, before the
    first deployment:

      swarmwire robots check fleet.toml --trust
    """
    fleet, mine = chosen(file, robots, groups)
    from swarmwire.deploy.robots.connecting import trust_new
    from swarmwire.deploy.robots.deploy import check, contents_of

    if trust and offline:
        raise BadInput("--trust", "", "expected either --trust or --offline")
    silent = set[tuple[str, int]]()
    if trust:
        hosts = [robot.host for robot in mine]
        found = act(lambda _: trust_new(hosts, fleet.known_hosts))
        _print_new_hosts(found, fleet.known_hosts)
        silent = {(new.host.address, new.host.port) for new in found if not new.line}
    contents = contents_of(fleet, mine)
    if offline:
        tell([told_here(robot.name, contents) for robot in mine])
        return
    there = [robot for robot in mine if (robot.host.address, robot.host.port) not in silent]
    results = {of.robot: of for of in act(lambda watcher: check(fleet, there, contents.faults, watcher))}
    tell([results.get(robot.name) or unanswered(robot) for robot in mine])


def unanswered(robot: "FleetRobot") -> "RobotResult":
    """The line of a robot whose host has shown no key."""
    from swarmwire.deploy.robots.result import RobotResult

    return RobotResult(robot.name, False, f"{robot.host} does not answer", "is it switched on, and its address right?")


def told_here(robot: str, contents: "Contents") -> "RobotResult":
    """A robot's line without its host."""
    from swarmwire.deploy.robots.result import RobotResult

    fault = contents.faults.get(robot)
    return RobotResult(robot, fault is None, str(fault) if fault else contents.told[robot])


def _print_new_hosts(found: "list[NewHost]", known_hosts: Path) -> None:
    for new in found:
        told = f"{new.fingerprint}, added to {known_hosts}" if new.line else "did not answer"
        echo(f"new: {new.host.address}:{new.host.port}: {told}")


@robots_app.command("deploy")
def deploy_command(
    file: FleetFile,
    robots: OfRobots = None,
    groups: OfGroups = None,
    restart: Annotated[
        bool, typer.Option("--restart", help="Restart robots that run an older release. Default: leave them running.")
    ] = False,
    wheels: Annotated[
        Path | None,
        typer.Option(help="A folder with the wheels that robots need, instead of the package index.", metavar="DIR"),
    ] = None,
) -> None:
    """Copy agents, settings and all packages that they need to robots, as releases with an atomic switch.

    Each is tried out on its robot first. A failure leaves that robot unchanged and does not stop the others; to do
    it again does only what is missing. Robots keep their last three releases.

    Exit code 0: all robots have it; 1: not every robot; 2: refused before anything was sent. For example:

      swarmwire robots deploy fleet.toml --group red --restart
    """
    fleet, mine = chosen(file, robots, groups)
    from swarmwire.deploy.robots.deploy import contents_of, deploy
    from swarmwire.deploy.robots.packages import LockedEnvironments

    contents = contents_of(fleet, mine)
    for error in contents.faults.values():
        raise error
    index = ("--no-index", "--find-links", str(wheels.resolve())) if wheels else ()
    environments = LockedEnvironments(index=index)
    tell(act(lambda watcher: deploy(fleet, mine, contents.entries, environments, watcher, restart=restart)))


@robots_app.command("start")
def start_command(file: FleetFile, robots: OfRobots = None, groups: OfGroups = None) -> None:
    """Start robots' agents; running agents keep running.

    Exit code 1: one of them did not start. For example:

      swarmwire robots start fleet.toml --group red
    """
    fleet, mine = chosen(file, robots, groups)
    from swarmwire.deploy.robots.units import start

    tell(act(lambda watcher: start(fleet, mine, watcher)))


@robots_app.command("stop")
def stop_command(file: FleetFile, robots: OfRobots = None, groups: OfGroups = None) -> None:
    """Stop robots' agents, and with them their motors.

    Exit code 1: one of them is not known to have stopped. For example:

      swarmwire robots stop fleet.toml --robots flock-0,flock-3
    """
    fleet, mine = chosen(file, robots, groups)
    from swarmwire.deploy.robots.units import stop

    tell(act(lambda watcher: stop(fleet, mine, watcher)))


@robots_app.command("rollback")
def rollback_command(file: FleetFile, robots: OfRobots = None, groups: OfGroups = None) -> None:
    """Go back to the release before; running robots are restarted.

    Exit code 1: not for every robot. For example:

      swarmwire robots rollback fleet.toml --robots flock-3
    """
    fleet, mine = chosen(file, robots, groups)
    from swarmwire.deploy.robots.units import rollback

    tell(act(lambda watcher: rollback(fleet, mine, watcher)))


@robots_app.command("estop")
def estop_command(file: FleetFile, robots: OfRobots = None, groups: OfGroups = None) -> None:
    """Stop robots at once, over the swarm's network and by SSH at the same time.

    A line per robot shows which way confirmed the stop. Exit code 1: one of them is not confirmed, so switch it off
    by hand; or the fleet's file has a fault, or a name is unknown: all other robots are stopped first. Exit code 2: no
    robot was asked. For example, all robots:

      swarmwire robots estop fleet.toml
    """
    from swarmwire.deploy.cli.estop import stop_robots

    code = stop_robots(file, robots or (), groups or ())
    if code:
        raise typer.Exit(code)


COLUMNS = ("robot", "unit", "release", "since", "tick", "late", "charge", "agent")


@robots_app.command("status")
def status_command(file: FleetFile, robots: OfRobots = None, groups: OfGroups = None, as_json: AsJson = False) -> None:
    """Print each robot's release, uptime and its agent's last report.

    Exit code 1: something is wrong. For example:

      swarmwire robots status fleet.toml
    """
    fleet, mine = chosen(file, robots, groups)
    from swarmwire.deploy.robots.units import status

    states = act(lambda watcher: status(fleet, mine, watcher))
    if as_json:
        echo(json.dumps([asdict(state) for state in states]))
    else:
        _print_states(states)
    if not all(state.good for state in states):
        raise typer.Exit(FAILED)


def _print_states(states: "list[RobotState]") -> None:
    """A table of robots that were asked, and below it, as wide as the terminal, why others were not."""
    from swarmwire.deploy.robots.result import RobotResult, result_lines
    from swarmwire.deploy.terminal.console import TerminalConsole
    from swarmwire.deploy.terminal.tables import print_rows

    rows = [_row(state) for state in states if not state.fault]
    if rows:
        print_rows(COLUMNS, rows, TerminalConsole())
    faults = [RobotResult(state.robot, False, state.fault) for state in states if state.fault]
    if faults:
        echo("\n".join(result_lines(faults)))


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


@robots_app.command("logs")
def logs_command(
    file: FleetFile,
    robots: OfRobots = None,
    groups: OfGroups = None,
    lines: Annotated[int, typer.Option(min=0, help="Number of last lines of each robot.")] = 10,
    follow: Annotated[bool, typer.Option("--follow", "-f", help="Keep printing new lines until Ctrl-C.")] = False,
    fetch: Annotated[
        Path | None,
        typer.Option(
            help="Copy the log of each robot's last start to this folder, for sim-to-real comparison.", metavar="DIR"
        ),
    ] = None,
) -> None:
    """Show the output of robots' agents, or fetch their logs.

    Exit code 1: not of every robot. For example:

      swarmwire robots logs fleet.toml --robots flock-0 --follow

      swarmwire robots logs fleet.toml --fetch logs/monday
    """
    if follow and fetch is not None:
        raise BadInput("--fetch", "", "expected either --follow or --fetch")
    fleet, mine = chosen(file, robots, groups)
    from swarmwire.deploy.robots.logs import fetch_logs, show_logs

    if fetch is not None:
        tell(act(lambda _: fetch_logs(fleet, mine, fetch)))
        return
    width = max(len(robot.name) for robot in mine)
    results = act(
        lambda _: show_logs(fleet, mine, lines, lambda robot, line: echo(f"{robot:{width}}  {line}"), follow=follow)
    )
    failed = [result for result in results if not result.good]
    if failed:
        tell(failed)
