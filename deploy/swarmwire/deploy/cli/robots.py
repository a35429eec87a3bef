"""`swarmwire robots`: commands for a fleet of real robots, over SSH, on all hosts at the same time."""

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
    from swarmwire.deploy.robots.deploy import ReleaseContents
    from swarmwire.deploy.robots.fleet import Fleet, FleetRobot
    from swarmwire.deploy.robots.result import RobotResult, Watcher
    from swarmwire.deploy.robots.units import RobotStatus

Result = TypeVar("Result")

robots_app = typer.Typer(
    help="Manage the real robots of a fleet.toml: deploy, start, stop and inspect them in parallel over SSH.",
    no_args_is_help=True,
)


def select_robots(
    file: Path, robots: Sequence[str] | None, groups: Sequence[str] | None
) -> "tuple[Fleet, Sequence[FleetRobot]]":
    """Read a fleet; return it and the selected robots; BadInput without the extra [fleet]."""
    FLEET.need("robots")
    from swarmwire.deploy.robots.fleet import names_in
    from swarmwire.deploy.robots.fleet_file import read_fleet

    fleet = read_fleet(file)
    return fleet, fleet.select(names_in(robots or ()), names_in(groups or ()))


def run_work(work: "Callable[[Watcher], Awaitable[Result]]") -> Result:
    """Run the work, show its progress and return its result; Interrupted by Ctrl-C."""
    from swarmwire.deploy.cli.display.robots import (
        run_with_progress,  # loads asyncio and rich, which --help does not need
    )

    return run_with_progress(work)


def print_results(results: "Sequence[RobotResult]") -> None:
    """Print a line per robot; exit code 1 if one of them failed."""
    from swarmwire.deploy.robots.result import result_lines

    for line in result_lines(results):
        echo(line)
    failures = sum(not result.ok for result in results)
    if failures:
        echo(f"{failures} of {len(results)} failed", err=True)
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

    Exit code 0: all checks pass; 1: a robot fails; 2: a fault of the fleet's file. For example, before the
    first deployment:

      swarmwire robots check fleet.toml --trust
    """
    fleet, targets = select_robots(file, robots, groups)
    from swarmwire.deploy.robots.connecting import trust_new
    from swarmwire.deploy.robots.deploy import check, release_contents

    if trust and offline:
        raise BadInput("--trust", "", "expected either --trust or --offline")
    silent = set[tuple[str, int]]()
    if trust:
        hosts = [robot.host for robot in targets]
        new_hosts = run_work(lambda _: trust_new(hosts, fleet.known_hosts))
        _print_new_hosts(new_hosts, fleet.known_hosts)
        silent = {(new.host.address, new.host.port) for new in new_hosts if not new.line}
    contents = release_contents(fleet, targets)
    if offline:
        print_results([_offline_result(robot.name, contents) for robot in targets])
        return
    reachable = [robot for robot in targets if (robot.host.address, robot.host.port) not in silent]
    checked = run_work(lambda watcher: check(fleet, reachable, contents.faults, watcher))
    results = {result.robot: result for result in checked}
    print_results([results.get(robot.name) or _unreachable(robot) for robot in targets])


def _unreachable(robot: "FleetRobot") -> "RobotResult":
    """Return the result of a robot whose host has shown no key."""
    from swarmwire.deploy.robots.result import RobotResult

    return RobotResult(robot.name, False, f"{robot.host} does not answer", "is it switched on, and its address right?")


def _offline_result(robot: str, contents: "ReleaseContents") -> "RobotResult":
    """Return a robot's result without a check of its host."""
    from swarmwire.deploy.robots.result import RobotResult

    fault = contents.faults.get(robot)
    return RobotResult(robot, fault is None, str(fault) if fault else contents.summaries[robot])


def _print_new_hosts(new_hosts: "Sequence[NewHost]", known_hosts: Path) -> None:
    for new in new_hosts:
        result = f"{new.fingerprint}, added to {known_hosts}" if new.line else "did not answer"
        echo(f"new: {new.host.address}:{new.host.port}: {result}")


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

    Each release is tried on its robot first. A failure leaves that robot unchanged and does not stop the others; a
    repetition sends only what is missing. Robots keep their last three releases.

    Exit code 0: all robots have it; 1: a robot failed; 2: refused before anything was sent. For example:

      swarmwire robots deploy fleet.toml --group red --restart
    """
    fleet, targets = select_robots(file, robots, groups)
    from swarmwire.deploy.robots.deploy import deploy, release_contents
    from swarmwire.deploy.robots.packages import LockedEnvironments

    contents = release_contents(fleet, targets)
    for error in contents.faults.values():
        raise error
    index = ("--no-index", "--find-links", str(wheels.resolve())) if wheels else ()
    environments = LockedEnvironments(index=index)
    print_results(
        run_work(lambda watcher: deploy(fleet, targets, contents.entries, environments, watcher, restart=restart))
    )


@robots_app.command("start")
def start_command(file: FleetFile, robots: OfRobots = None, groups: OfGroups = None) -> None:
    """Start robots' agents; running agents keep running.

    Exit code 1: a robot did not start. For example:

      swarmwire robots start fleet.toml --group red
    """
    fleet, targets = select_robots(file, robots, groups)
    from swarmwire.deploy.robots.units import start

    print_results(run_work(lambda watcher: start(fleet, targets, watcher)))


@robots_app.command("stop")
def stop_command(file: FleetFile, robots: OfRobots = None, groups: OfGroups = None) -> None:
    """Stop robots' agents, and with them their motors.

    Exit code 1: the stop of a robot is not confirmed. For example:

      swarmwire robots stop fleet.toml --robots flock-0,flock-3
    """
    fleet, targets = select_robots(file, robots, groups)
    from swarmwire.deploy.robots.units import stop

    print_results(run_work(lambda watcher: stop(fleet, targets, watcher)))


@robots_app.command("rollback")
def rollback_command(file: FleetFile, robots: OfRobots = None, groups: OfGroups = None) -> None:
    """Go back to the release before; running robots are restarted.

    Exit code 1: a robot failed. For example:

      swarmwire robots rollback fleet.toml --robots flock-3
    """
    fleet, targets = select_robots(file, robots, groups)
    from swarmwire.deploy.robots.units import rollback

    print_results(run_work(lambda watcher: rollback(fleet, targets, watcher)))


@robots_app.command("estop")
def estop_command(file: FleetFile, robots: OfRobots = None, groups: OfGroups = None) -> None:
    """Stop robots at once, over the swarm's network and by SSH at the same time.

    A line per robot shows which route confirmed the stop. Exit code 1: a stop is not confirmed, so switch that robot
    off by hand; or the fleet's file has a fault, or a name is unknown: all other robots are stopped first. Exit code 2:
    no robot was stopped. For example, all robots:

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

    Exit code 1: a robot failed or does not answer. For example:

      swarmwire robots status fleet.toml
    """
    fleet, targets = select_robots(file, robots, groups)
    from swarmwire.deploy.robots.units import status

    rows = run_work(lambda watcher: status(fleet, targets, watcher))
    if as_json:
        echo(json.dumps([asdict(row) for row in rows]))
    else:
        _print_status(rows)
    if not all(row.ok for row in rows):
        raise typer.Exit(FAILED)


def _print_status(robots: "Sequence[RobotStatus]") -> None:
    """Print a table of the robots that answered, and below it, as wide as the terminal, the faults of others."""
    from swarmwire.deploy.robots.result import RobotResult, result_lines
    from swarmwire.deploy.terminal.console import TerminalConsole, print_rows

    rows = [_row(status) for status in robots if not status.fault]
    if rows:
        print_rows(COLUMNS, rows, TerminalConsole())
    faults = [RobotResult(status.robot, False, status.fault) for status in robots if status.fault]
    if faults:
        echo("\n".join(result_lines(faults)))


def _row(status: "RobotStatus") -> tuple[str, ...]:
    agent = status.agent
    charge = agent.get("charge")
    return (
        status.robot,
        status.unit + (f", {status.restarts} restarts" if status.restarts else ""),
        status.release,
        status.since,
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

    Exit code 1: a robot failed. For example:

      swarmwire robots logs fleet.toml --robots flock-0 --follow

      swarmwire robots logs fleet.toml --fetch logs/monday
    """
    if follow and fetch is not None:
        raise BadInput("--fetch", "", "expected either --follow or --fetch")
    fleet, targets = select_robots(file, robots, groups)
    from swarmwire.deploy.robots.logs import fetch_logs, show_logs

    if fetch is not None:
        print_results(run_work(lambda _: fetch_logs(fleet, targets, fetch)))
        return
    width = max(len(robot.name) for robot in targets)
    results = run_work(
        lambda _: show_logs(fleet, targets, lines, lambda robot, line: echo(f"{robot:{width}}  {line}"), follow=follow)
    )
    failed = [result for result in results if not result.ok]
    if failed:
        print_results(failed)
