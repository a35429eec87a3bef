"""A command in the network namespace of a simulated robot."""

import json
import os
from pathlib import Path

from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadInput
from swarmwire.world.interfaces.entering import INTERFACES, RobotNamespace, command_line


def run_on_robot(run: Path, robot: str, command: list[str] | None) -> None:
    """Replace this process by a command on a robot, the user's shell by default."""
    try:
        robots = json.loads((run / INTERFACES).read_text())
    except (OSError, ValueError):
        raise BadInput(str(run), "", "expected the folder of a running simulation with network interfaces") from None
    if robot not in robots:
        raise BadInput(str(run), robot, f"expected {did_you_mean(robots, robot)}")
    line = command_line(RobotNamespace(**robots[robot]["place"]), command or [os.environ.get("SHELL", "/bin/sh")])
    os.execv(line[0], line)
