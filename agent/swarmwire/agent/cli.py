"""The command `swarmwire-agent`: run or check an agent on a robot, list drivers, stop motors, join a run.

`run` turns this process into the guard, which starts the agent in a child process (the hidden option `--heartbeats`
names the pipe to the guard). Modules of a robot are imported in their commands, to keep the guard's start short.
"""

import argparse
import json
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import NoReturn

from swarmwire.agent.join_command import ABOUT as JOIN
from swarmwire.agent.join_command import add_join, join_parsed
from swarmwire.agent.on_robot.safety import StopFlag, by_signals
from swarmwire.agent.on_robot.settings import (
    BAD_INPUT,
    ENDED,
    FAILED,
    INTERRUPTED,
    NO_FILE,
    RobotSettings,
    add_flags,
    by_flag,
    flags_in,
    read_settings,
)
from swarmwire.comms.base.clock import DatedClock, ScaledClock, WallClock
from swarmwire.comms.base.errors import BadInput, SwarmwireError
from swarmwire.comms.base.printable import LINES, printable
from swarmwire.comms.wire.ending import end_now

ABOUT = """Runs a swarmwire agent on a robot: the same code that was tested in emulation.

Keep a hand near the robot's switch, and lift it off the floor the first time. Motors stop when
the agent is late, fails, freezes or is killed, on Ctrl-C and on an emergency stop. A robot that
is out of reach keeps executing its last command, unless it has a watchdog of its own, and is
stopped first of all when it answers again."""
EXAMPLE = """examples:
  swarmwire-agent drivers
  swarmwire-agent check avoid.py:Avoid --driver epuck2 --address 192.168.1.23
  swarmwire-agent run avoid.py:Avoid --driver epuck2 --address 192.168.1.23 --duration-s 60
  swarmwire-agent run --config robot.toml --log log
  swarmwire-agent join tls/10.0.0.5:7447 --robots 5 --ca ca.pem --certificate r1.pem --key r1.key

robot.toml:
  format = 1
  name = "flock-3"
  robots = ["flock-0", "flock-3"]
  agent = "flocking.py:Flock"
  driver = { name = "epuck2", address = "192.168.1.23" }
  radio = { kind = "zenoh" }
  tracker = true
  network = { listen = ["tcp/0.0.0.0:7547"], connect = ["tcp/10.0.0.5:7547"], insecure = true }

exit codes: 0 it ended, 1 it failed, 2 bad input, 130 Ctrl-C"""
PIPE_OPTION, STANDBY_OPTION = "--heartbeats", "--standby"  # hidden from the help
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1"}  # an agent's arrays are small; runners in emulation do the same
WATCHDOG_TIMEOUTS = 2.0  # without a heartbeat, until the guard acts
MIN_HEARTBEAT_TIMEOUT_S = 0.2  # a busy computer can hold up a healthy process for this long
COMMAND = (sys.executable, "-P", "-m", "swarmwire.agent.cli")


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        """Print the fault, and exit."""
        self.exit(BAD_INPUT, f"{self.prog}: {message}; see {self.prog} --help\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return the exit code."""
    command_line = list(sys.argv[1:] if arguments is None else arguments)
    parsed = _parser().parse_args(command_line, argparse.Namespace(command_line=command_line))
    try:
        return _COMMANDS[parsed.command](parsed)
    except SwarmwireError as error:
        _report(error, parsed)
        return BAD_INPUT if isinstance(error, BadInput) else FAILED
    except KeyboardInterrupt:
        return INTERRUPTED


def _report(error: SwarmwireError, parsed: argparse.Namespace) -> None:
    text = str(_with_flag(error, parsed) if isinstance(error, BadInput) else error)
    sys.stderr.write(f"{printable(text, keep=LINES)}\n")


def _with_flag(error: BadInput, parsed: argparse.Namespace) -> BadInput:
    """Return the fault, attributed to the flag that caused it, if a flag did."""
    if parsed.command in ("drivers", "join") or error.where != _where(parsed):
        return error
    return by_flag(error, error.where, flags_in(parsed))


def _parser() -> argparse.ArgumentParser:
    raw = argparse.RawDescriptionHelpFormatter
    parser = _Parser("swarmwire-agent", description=ABOUT, epilog=EXAMPLE, formatter_class=raw)
    parser.add_argument("--version", action="version", version=f"swarmwire-agent {version('swarmwire-agent')}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    helps = {
        "run": "run an agent on a robot until it is stopped",
        "check": "check the settings and print the plan or the errors; connect to nothing",
        "stop-motors": "stop the motors of a robot, and nothing else; accepts all flags of `run`",
    }
    for name, text in helps.items():
        command = commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
        command.add_argument("--config", metavar="FILE", type=Path, help="the robot's settings; flags override them")
        add_flags(command, only_driver=name == "stop-motors")
        hidden = None if name == "run" else argparse.SUPPRESS
        command.add_argument(
            "--duration-s",
            metavar="S",
            type=_duration,
            help=hidden or "end after this time; default: run until stopped",
        )
        command.add_argument(
            "--no-guard",
            action="store_true",
            help=hidden or "run without the guard process, which stops the motors if this one dies: for debuggers",
        )
        command.add_argument(PIPE_OPTION, type=int, help=argparse.SUPPRESS)
        command.add_argument(STANDBY_OPTION, action="store_true", help=argparse.SUPPRESS)
    text = "run robots' agents for a remote run, with the agent that is installed here"
    add_join(commands.add_parser("join", help=text, description=JOIN, formatter_class=raw))
    commands.add_parser("drivers", help="list the installed drivers, with their options")
    return parser


def _duration(text: str) -> float:
    seconds = float(text)
    if not 0.0 < seconds < float("inf"):
        raise argparse.ArgumentTypeError(f"expected more than 0 s, got {text}")
    return seconds


def _run(parsed: argparse.Namespace) -> int:
    settings = _settings(parsed)
    if parsed.heartbeats is None and not parsed.no_guard:
        _become_guard(settings, parsed.command_line, ["stop-motors", *parsed.command_line[1:]])
    from swarmwire.agent.on_robot.assembly import run_robot
    from swarmwire.agent.on_robot.guard import CLOSED
    from swarmwire.agent.on_robot.plan import robot_config

    end, wall, pipe = StopFlag(), WallClock(), parsed.heartbeats
    clock = _clock(settings, wall)
    try:
        with by_signals(end, patient=pipe is not None):
            plan = robot_config(settings, _where(parsed), clock)
            return run_robot(plan, clock, end, wall.utc_stamp(), parsed.duration_s, pipe)
    finally:  # everything is closed, also after an error
        if pipe is not None:
            with suppress(BrokenPipeError):
                os.write(pipe, CLOSED)


def _become_guard(settings: RobotSettings, run: Sequence[str], stop: Sequence[str]) -> NoReturn:
    """Replace this program by the guard, which keeps the process id for signals, but none of the imported modules.

    `run` and `stop` are the arguments of `swarmwire-agent` that run the agent and stop its motors.
    """
    from swarmwire.agent.on_robot import guard

    options = {
        "agent": [*COMMAND, *run],
        "stop": [*COMMAND, *stop],
        "silent_s": heartbeat_timeout_s(settings.watchdog_s, settings.pace),
        "pipe_option": PIPE_OPTION,
        "standby_option": STANDBY_OPTION,
    }
    sys.stdout.flush()
    sys.stderr.flush()
    environment = {**ONE_THREAD, **os.environ}
    os.execve(sys.executable, [sys.executable, "-I", "-S", guard.__file__, json.dumps(options)], environment)


def heartbeat_timeout_s(watchdog_s: float, pace: float) -> float:
    """Return the guard's timeout for heartbeats in s of the wall clock; at a `pace` below 1 it is longer.

    >>> heartbeat_timeout_s(0.5, 1.0), heartbeat_timeout_s(0.5, 0.1), heartbeat_timeout_s(0.01, 1.0)
    (1.0, 10.0, 0.2)
    """
    return max(WATCHDOG_TIMEOUTS * watchdog_s / min(pace, 1.0), MIN_HEARTBEAT_TIMEOUT_S)


def _check(parsed: argparse.Namespace) -> int:
    from swarmwire.agent.on_robot.plan import robot_config

    settings = _settings(parsed)
    sys.stdout.write(f"{settings.name}: {robot_config(settings, _where(parsed), _clock(settings, WallClock()))}\n")
    return ENDED


def _stop_motors(parsed: argparse.Namespace) -> int:
    from swarmwire.agent.on_robot.stop_motors import stop_motors

    return stop_motors(parsed.config, flags_in(parsed), lambda error: _report(error, parsed), standby=parsed.standby)


def _drivers(_: argparse.Namespace) -> int:
    from swarmwire.agent.drivers.driver import list_drivers

    sys.stdout.write("\n".join(list_drivers()) + "\n")
    return ENDED


_COMMANDS = {"join": join_parsed, "run": _run, "check": _check, "stop-motors": _stop_motors, "drivers": _drivers}


def _settings(parsed: argparse.Namespace) -> RobotSettings:
    return read_settings(parsed.config, flags_in(parsed))


def _where(parsed: argparse.Namespace) -> str:
    return str(parsed.config) if parsed.config else NO_FILE


def _clock(settings: RobotSettings, wall: WallClock) -> DatedClock:
    return wall if settings.pace == 1.0 else ScaledClock(wall, settings.pace)


def program() -> NoReturn:
    """Run the process `swarmwire-agent`."""
    code = main()
    end_now(code)
    sys.exit(code)


if __name__ == "__main__":
    program()
