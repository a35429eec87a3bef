"""`swarmwire robots estop`, without typer, whose import takes longer than all that a stop needs."""

import sys
from collections.abc import Sequence
from getopt import GetoptError, gnu_getopt
from pathlib import Path

from swarmwire.comms.base.errors import BadInput, Interrupted
from swarmwire.comms.base.printable import LINES, printable
from swarmwire.deploy.robots.estop import ask_network, estop
from swarmwire.deploy.robots.fleet import names_in
from swarmwire.deploy.robots.stop_targets import read_targets

STOPPED, NOT_CONFIRMED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130  # exit codes, as in options.py
ASKED = "may continue: switch them off by hand"


def call_estop(arguments: Sequence[str]) -> int | None:
    """Exit code of a call with these arguments; None if typer must explain them: a request for help, or a mistake."""
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
    """Stop the robots of a fleet's file, print a line for each, then the faults of the input; returns the exit code.

    BadInput if there is no robot to stop.
    """
    fleet = read_targets(file)
    mine, unknown = fleet.chosen(names_in(robots), names_in(groups))
    if not mine:
        raise (unknown or _faults(file))[0]
    asked = ask_network(fleet, mine)
    from swarmwire.deploy.robots.progress import watched
    from swarmwire.deploy.robots.result import result_lines

    results = watched(lambda watcher: estop(fleet, mine, asked, watcher), ASKED)
    sys.stdout.write("".join(f"{printable(line)}\n" for line in result_lines(results)))
    faults = [*unknown, *fleet.faults, *_faults(file)]
    for fault in faults:
        _report(fault)
    failed = sum(not result.good for result in results)
    if failed:
        sys.stderr.write(f"{failed} of {len(results)} failed\n")
    return NOT_CONFIRMED if failed or faults else STOPPED


def _faults(file: Path) -> list[BadInput]:
    """The first fault of a fleet's file, if it has one."""
    from swarmwire.deploy.robots.fleet_file import read_fleet

    try:
        read_fleet(file)
    except BadInput as error:
        return [error]
    return []


def _report(error: Exception) -> None:
    sys.stderr.write(f"error: {printable(str(error), keep=LINES)}\n")
