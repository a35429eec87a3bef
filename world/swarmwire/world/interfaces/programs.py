"""Programs on robots: each starts and ends with its robot; other ends are events."""

import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from swarmwire.comms.base.arrays import BoolArray
from swarmwire.comms.base.clock import to_s
from swarmwire.comms.base.sentinels import NO_SERIAL
from swarmwire.comms.observe.truth import EventRecord
from swarmwire.world.interfaces.addresses import Addresses
from swarmwire.world.interfaces.entering import RobotNamespace, command_line
from swarmwire.world.interfaces.namespaces import NAME

ENDED = "program_ended"  # action of the event
DONE = "exit code 0"  # `ending` of a successful program
MAX_LINE_BYTES = 200  # most bytes of its output in a message


@dataclass(frozen=True)
class RobotProgram:
    """The program of a robot."""

    command: tuple[str, ...]
    target: RobotNamespace
    addresses: Addresses
    working_folder: Path


class Programs:
    """The programs of the robots of a run's only arena.

    A program starts with the run, and again when its robot is revived. The death of its robot ends it, since a robot's
    battery powers its computer, too. Any other end is an event, and final.

    Attributes:
        gateways: address of each robot's gateway, by robot index, for the environment of programs.
    """

    def __init__(self, programs: Mapping[int, RobotProgram], folder: Path, robots: int) -> None:
        """`programs` is by robot index; output and scratch folders are below `folder`."""
        self._programs, self._folder, self._robots = programs, folder, robots
        self.gateways: dict[int, str] = {}
        self._running: dict[int, subprocess.Popen[bytes]] = {}
        self._alive: BoolArray = np.ones(robots, np.bool_)

    def start(self) -> None:
        """Start all programs."""
        for robot in self._programs:
            self._start(robot)

    def update(self, start_ns: int, alive: BoolArray) -> tuple[EventRecord, ...]:
        """End the programs of robots that have died, and start the programs of revived robots; `alive` is (robots,).

        Returns:
            An event for each program that has ended by itself since the last call.
        """
        if not self._programs:
            return ()
        ended = [(robot, code) for robot, process in self._running.items() if (code := process.poll()) is not None]
        for robot, _ in ended:
            del self._running[robot]
        if not np.array_equal(alive, self._alive):
            for robot in self._programs:
                if self._alive[robot] and not alive[robot]:
                    self._end(robot)
                elif alive[robot] and not self._alive[robot]:
                    self._start(robot)
            self._alive = alive.copy()
        return tuple(self._event(start_ns, robot, code) for robot, code in ended)

    def last_line(self, robot: int) -> str:
        """Return the last line that a robot's program has printed; "" without output."""
        log = self._folder / f"{self._programs[robot].target.robot}.log"
        with log.open("rb") as file:
            file.seek(max(log.stat().st_size - MAX_LINE_BYTES, 0))
            return file.read().decode(errors="replace").rstrip().rpartition("\n")[2]

    def close(self) -> None:
        """End all programs and their child processes; safe to call more than once."""
        for process in self._running.values():
            process.kill()
        for process in self._running.values():
            process.wait()
        self._running.clear()

    def _start(self, robot: int) -> None:
        program = self._programs[robot]
        name = program.target.robot
        scratch = self._folder / name
        scratch.mkdir(parents=True, exist_ok=True)
        # Killing this process ends all processes of the program: see `entering`.
        with (self._folder / f"{name}.log").open("ab") as log:
            self._running[robot] = subprocess.Popen(
                command_line(program.target, [*program.command]),
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                cwd=program.working_folder,
                env={
                    "PYTHON": sys.executable,  # python3 on the path may be another one, without the packages of this
                    **os.environ,
                    **_environment(robot, name, program.addresses, scratch),
                    **self._gateway(robot),
                },
                start_new_session=True,
            )

    def _gateway(self, robot: int) -> dict[str, str]:
        return {"ROBOT_GATEWAY": self.gateways[robot]} if robot in self.gateways else {}

    def _end(self, robot: int) -> None:
        process = self._running.pop(robot, None)
        if process is not None:
            process.kill()
            process.wait()

    def _event(self, start_ns: int, robot: int, code: int) -> EventRecord:
        return robot_event(start_ns, ENDED, robot, self._robots, ending(code))


def robot_event(start_ns: int, action: str, robot: int, robots: int, part: str = "") -> EventRecord:
    """Return an event of one of `robots` robots that its programs caused, not the scenario."""
    changed = np.zeros(robots, np.bool_)
    changed[robot] = True
    return EventRecord(NO_SERIAL, to_s(start_ns), action, False, changed, part, singly=True)


def _environment(robot: int, name: str, addresses: Addresses, scratch: Path) -> dict[str, str]:
    ipv6 = {"ROBOT_IPV6": str(addresses.ipv6.ip)} if addresses.ipv6 else {}
    return {
        "ROBOT": name,
        "ROBOT_INDEX": str(robot),
        "ROBOT_INTERFACE": NAME,
        "ROBOT_MAC": addresses.mac_text,
        "ROBOT_IPV4": str(addresses.ipv4.ip),
        **ipv6,
        "ROBOT_SCRATCH": str(scratch),
    }


def ending(code: int) -> str:
    """Describe the end of a program by its exit code: `exit code 1`, or the name of a signal."""
    number = -code if code < 0 else code - 128
    try:
        return signal.Signals(number).name if number > 0 else f"exit code {code}"
    except ValueError:
        return f"exit code {code}"


def hosts(names: Sequence[str], addresses: Sequence[Addresses]) -> str:
    """Return the robots' /etc/hosts."""
    lines = ["127.0.0.1 localhost", "::1 localhost"]
    for name, robot_addresses in zip(names, addresses, strict=True):
        lines.append(f"{robot_addresses.ipv4.ip} {name}")
        if robot_addresses.ipv6:
            lines.append(f"{robot_addresses.ipv6.ip} {name}")
    return "\n".join(lines) + "\n"
