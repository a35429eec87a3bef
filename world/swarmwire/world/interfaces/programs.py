"""Programs on robots: started when their robot is, ended with it; their ends are events."""

import os
import signal
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from swarmwire.comms.base.arrays import BoolArray
from swarmwire.comms.base.clock import to_s
from swarmwire.comms.observe.truth import NO_SERIAL, EventRecord
from swarmwire.world.interfaces.addresses import Addresses
from swarmwire.world.interfaces.entering import Place, command_line
from swarmwire.world.interfaces.namespaces import NAME

ENDED = "program_ended"  # what the events of a run call it
DONE = "exit code 0"  # how a program ended that has done its work
MAX_LINE_BYTES = 200  # of its output that a message quotes


@dataclass(frozen=True)
class RobotProgram:
    """What a robot runs."""

    command: tuple[str, ...]
    place: Place
    addresses: Addresses
    working_folder: Path


class Programs:
    """The programs of the robots of a run's only arena.

    A program starts with the run, and again when its robot is revived. The death of a robot ends it, since a robot's
    battery powers its computer, too. All other ends are events; such a program stays ended.

    Attributes:
        gateways: by robot index, the address of its gateway, for its environment.
    """

    def __init__(self, programs: Mapping[int, RobotProgram], folder: Path, robots: int) -> None:
        """`programs` by robot index; output and scratch folders are below `folder`."""
        self._programs, self._folder, self._robots = programs, folder, robots
        self.gateways: dict[int, str] = {}
        self._running: dict[int, subprocess.Popen[bytes]] = {}
        self._alive: BoolArray = np.ones(robots, np.bool_)

    def start(self) -> None:
        """Start all of them."""
        for robot in self._programs:
            self._start(robot)

    def follow(self, start_ns: int, alive: BoolArray) -> tuple[EventRecord, ...]:
        """End the programs of robots that have died, start those of revived ones; `alive` is (robots,).

        Returns an event for each program that has ended by itself since the last call.
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
        """The last line that a robot's program has printed; empty if it has printed nothing."""
        log = self._folder / f"{self._programs[robot].place.robot}.log"
        with log.open("rb") as file:
            file.seek(max(log.stat().st_size - MAX_LINE_BYTES, 0))
            return file.read().decode(errors="replace").rstrip().rpartition("\n")[2]

    def close(self) -> None:
        """End all programs, with all that they have started; safe to call more than once."""
        for process in self._running.values():
            process.kill()
        for process in self._running.values():
            process.wait()
        self._running.clear()

    def _start(self, robot: int) -> None:
        program = self._programs[robot]
        name = program.place.robot
        scratch = self._folder / name
        scratch.mkdir(parents=True, exist_ok=True)
        # `kill` of the process below reaches all of them: see `entering`.
        with (self._folder / f"{name}.log").open("ab") as log:
            self._running[robot] = subprocess.Popen(
                command_line(program.place, [*program.command]),
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                cwd=program.working_folder,
                env={**os.environ, **_environment(robot, name, program.addresses, scratch), **self._gateway(robot)},
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
    """An event that befalls one of `robots` robots and comes from its programs, not from the scenario."""
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
    """How a program ended, by its exit code: `exit code 1`, or the name of a signal."""
    number = -code if code < 0 else code - 128
    try:
        return signal.Signals(number).name if number > 0 else f"exit code {code}"
    except ValueError:
        return f"exit code {code}"


def hosts(names: Sequence[str], addresses: Sequence[Addresses]) -> str:
    """The robots' /etc/hosts."""
    lines = ["127.0.0.1 localhost", "::1 localhost"]
    for name, of in zip(names, addresses, strict=True):
        lines.append(f"{of.ipv4.ip} {name}")
        if of.ipv6:
            lines.append(f"{of.ipv6.ip} {name}")
    return "\n".join(lines) + "\n"
