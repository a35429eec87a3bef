"""`swarmwire exec`."""

import json
import os
from pathlib import Path
from typing import Annotated

import typer

from swarmwire.comms.config import did_you_mean
from swarmwire.comms.errors import BadInput
from swarmwire.world.interfaces.entering import INTERFACES, Place, command_line


def exec_command(
    run: Annotated[Path, typer.Argument(help="The folder of a run with network interfaces.", metavar="RUN")],
    robot: Annotated[str, typer.Argument(help="A robot of the run.", metavar="ROBOT")],
    command: Annotated[
        list[str] | None, typer.Argument(help="The command. Default: the user's shell.", metavar="COMMAND")
    ] = None,
) -> None:
    """Run a command on a robot of a running simulation: in its network namespace, for no longer than the run.

    For example: swarmwire exec RUN flock-0 -- ping flock-1. The robots' names are host names there.
    """
    try:
        robots = json.loads((run / INTERFACES).read_text())
    except (OSError, ValueError):
        raise BadInput(str(run), "", "expected the folder of a running simulation with network interfaces") from None
    if robot not in robots:
        raise BadInput(str(run), robot, f"expected {did_you_mean(robots, robot)}")
    line = command_line(Place(**robots[robot]["place"]), command or [os.environ.get("SHELL", "/bin/sh")])
    os.execv(line[0], line)
