"""`swarmwire robots estop`, without typer, whose import takes longer than the stop itself."""

import sys
from collections.abc import Sequence
from getopt import GetoptError, gnu_getopt
from pathlib import Path

from swarmwire.comms.base.errors import BadInput, Interrupted
from swarmwire.comms.base.printable import LINES, printable
from swarmwire.deploy.robots.estop import request_stop, stop_by_ssh
from swarmwire.deploy.robots.fleet import names_in
from swarmwire.deploy.robots.result import result_lines
from swarmwire.deploy.robots.stop_targets import read_targets

STOPPED, NOT_CONFIRMED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130  # exit codes, as in options.py


def call_estop(arguments: Sequence[str]) -> int | None:
    """Return the exit code of a call with these arguments; None if typer must explain them: help, or a mistake."""
    try:
        options, files = gnu_getopt(list(arguments), "", ["robots=", "group="])
    except GetoptError:
        return None
    if len(files) != 1:
        return None
    robots, groups = ([value for option, value in options if option == name] for name in ("--robots", "--group"))
    try:
        return stop_robots(Path(files[0]), robots, groups)
    except (BadInput, Interrupted) as error:
        _report(error)
        return BAD_INPUT if isinstance(error, BadInput) else INTERRUPTED


def stop_robots(file: Path, robots: Sequence[str], groups: Sequence[str]) -> int:
    """Stop robots of a fleet's file, print a line for each, then the faults of the input; return the exit code.

    BadInput if there is no robot to stop.
    """
    fleet = read_targets(file)
    targets, unknown = fleet.select(names_in(robots), names_in(groups))
    if not targets:
        raise (unknown or _file_faults(file))[0]
    network_faults = request_stop(fleet, targets)
    if sys.stderr.isatty():
        sys.stderr.write(f"stopping {', '.join(printable(target.robot) for target in targets)} …\n")
    import asyncio

    try:
        results = asyncio.run(stop_by_ssh(fleet, targets, network_faults))
    except KeyboardInterrupt:
        raise Interrupted("interrupted: robots without confirmation may continue: switch them off by hand") from None
    sys.stdout.write("".join(f"{printable(line)}\n" for line in result_lines(results)))
    faults = [*unknown, *fleet.faults, *_file_faults(file)]
    for fault in faults:
        _report(fault)
    failures = sum(not result.ok for result in results)
    if failures:
        sys.stderr.write(f"{failures} of {len(results)} failed\n")
    return NOT_CONFIRMED if failures or faults else STOPPED


def _file_faults(file: Path) -> list[BadInput]:
    """Return the first fault of a fleet's file, if it has one."""
    from swarmwire.deploy.robots.fleet_file import read_fleet

    try:
        read_fleet(file)
    except BadInput as error:
        return [error]
    return []


def _report(error: Exception) -> None:
    sys.stderr.write(f"error: {printable(str(error), keep=LINES)}\n")
