"""Turns this process into the guard of an agent, which then runs in a process of its own."""

import json
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

from swarmwire.agent.on_robot.settings import RobotSettings

PIPE_OPTION, STANDBY_OPTION = "--heartbeats", "--standby"  # that people do not need
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1"}  # as of runners in emulation: an agent's arrays are small
SILENT = 2.0  # times the watchdog's time may pass without a heartbeat
MIN_SILENT_S = 0.2  # so long other processes may hold up one that is well
COMMAND = (sys.executable, "-P", "-m", "swarmwire.agent.cli")


def become_guard(settings: RobotSettings, run: Sequence[str], stop: Sequence[str]) -> NoReturn:
    """Go on as the guard: the same process, so that signals reach it, but without what this one has imported.

    `run` and `stop` are the arguments of `swarmwire-agent` for the agent, and to stop its motors.
    """
    from swarmwire.agent.on_robot import guard

    orders = {
        "agent": [*COMMAND, *run],
        "stop": [*COMMAND, *stop],
        "silent_s": silent_s(settings.watchdog_s, settings.pace),
        "pipe_option": PIPE_OPTION,
        "standby_option": STANDBY_OPTION,
    }
    sys.stdout.flush()
    sys.stderr.flush()
    environment = {**ONE_THREAD, **os.environ}
    os.execve(sys.executable, [sys.executable, "-I", "-S", guard.__file__, json.dumps(orders)], environment)


def silent_s(watchdog_s: float, pace: float) -> float:
    """How long nothing may be received of the agent, by the wall clock, whose seconds a slow robot's are longer than.

    >>> silent_s(0.5, 1.0), silent_s(0.5, 0.1), silent_s(0.01, 1.0)
    (1.0, 10.0, 0.2)
    """
    return max(SILENT * watchdog_s / min(pace, 1.0), MIN_SILENT_S)
