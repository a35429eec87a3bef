"""Turns this process into the guard (`guard.py`); the agent then runs in a child process."""

import json
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

from swarmwire.agent.on_robot.settings import RobotSettings

PIPE_OPTION, STANDBY_OPTION = "--heartbeats", "--standby"  # hidden from the help
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1"}  # as for runners in emulation: an agent's arrays are small
WATCHDOG_TIMEOUTS = 2.0  # without a heartbeat, until the guard acts
MIN_HEARTBEAT_TIMEOUT_S = 0.2  # a busy computer can hold up a healthy process for this long
COMMAND = (sys.executable, "-P", "-m", "swarmwire.agent.cli")


def become_guard(settings: RobotSettings, run: Sequence[str], stop: Sequence[str]) -> NoReturn:
    """Replace this program by the guard: the same process, so that signals reach it, without the imported modules.

    `run` and `stop` are the arguments of `swarmwire-agent` that run the agent and stop its motors.
    """
    from swarmwire.agent.on_robot import guard

    options = {
        "agent": [*COMMAND, *run],
        "stop": [*COMMAND, *stop],
        "silent_s": silent_s(settings.watchdog_s, settings.pace),
        "pipe_option": PIPE_OPTION,
        "standby_option": STANDBY_OPTION,
    }
    sys.stdout.flush()
    sys.stderr.flush()
    environment = {**ONE_THREAD, **os.environ}
    os.execve(sys.executable, [sys.executable, "-I", "-S", guard.__file__, json.dumps(options)], environment)


def silent_s(watchdog_s: float, pace: float) -> float:
    """The guard's timeout for heartbeats in s of the wall clock; at a `pace` below 1 it is longer.

    >>> silent_s(0.5, 1.0), silent_s(0.5, 0.1), silent_s(0.01, 1.0)
    (1.0, 10.0, 0.2)
    """
    return max(WATCHDOG_TIMEOUTS * watchdog_s / min(pace, 1.0), MIN_HEARTBEAT_TIMEOUT_S)
