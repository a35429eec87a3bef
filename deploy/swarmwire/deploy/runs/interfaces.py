"""The network interfaces of a run's robots: checked, made for the run, and removed with it."""

import errno
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from swarmwire.comms.base.arrays import BoolArray
from swarmwire.comms.base.atomic import make_subfolder, write_text
from swarmwire.comms.base.config import folder_of
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import EventRecord, Static, Truth
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.deploy.machine import need_open_files
from swarmwire.world.backends.pacing import Pace
from swarmwire.world.interfaces.addresses import Addresses, addresses_of, check_unused
from swarmwire.world.interfaces.backend import INTERFACE_LOST, FramePorts
from swarmwire.world.interfaces.entering import INTERFACES, RobotNamespace, process_start
from swarmwire.world.interfaces.namespaces import (
    DEVICE,
    NAME,
    USER_NAMESPACE,
    Relay,
    Relays,
    RobotInterface,
    check_rights,
    may_make_namespaces,
    missing_right,
)
from swarmwire.world.interfaces.programs import DONE, ENDED, Programs, RobotProgram, hosts
from swarmwire.world.scenario.scenario import Scenario

KEY = "radio.interface"
PROGRAMS = "programs"  # in the run folder: output, scratch folders and host names of programs
DESCRIPTORS = 3  # of each robot: its device, its namespace, and the changes of links there


@dataclass(frozen=True)
class OpenInterfaces:
    """The interfaces of a run that has begun."""

    interfaces: tuple[RobotInterface, ...]  # of the robots
    ports: FramePorts
    programs: Programs
    places: tuple[RobotNamespace, ...]  # of the robots
    addresses: tuple[Addresses, ...]  # of the robots
    folder: Path | None  # the run folder

    def follow(self, start_ns: int, alive: BoolArray) -> tuple[EventRecord, ...]:
        """Start and end programs as `Programs.update`; returns the events of programs and devices."""
        return (*self.ports.pop_events(start_ns), *self.programs.update(start_ns, alive))

    @contextmanager
    def with_gateways(self, gateways: Mapping[int, tuple[str, str]]) -> Generator[None]:
        """Within the context programs reach their robot's gateway: by robot its address there, and outside.

        Those over TCP: no program reaches another. BadInput if a robot cannot have the address.
        """
        relays: list[Relay] = []
        for robot, (address, outside) in gateways.items():
            place, to = _host_and_port(address), _host_and_port(outside)
            if place and to:
                self.programs.gateways[robot] = address
                relays.append(Relay(self.interfaces[robot], place, to))
        try:
            opened = Relays(relays)
        except OSError as error:
            raise BadInput("--gateway", "", f"expected an address that robots have: {error.strerror}") from error
        with closing(opened):
            yield


class RunInterfaces:
    """The interfaces of one run, of which there may be none; a run that is repeated needs none."""

    def __init__(self, scenario: Scenario, *, repeated: bool) -> None:
        radio = scenario.radio
        self._scenario, self._repeated = scenario, repeated
        self._radio = radio if radio and radio.interface and not repeated else None

    def __bool__(self) -> bool:
        return self._radio is not None

    def check(self, static: Static) -> None:
        """BadInput where interfaces do not go together with the scenario or the seeds; nothing is made."""
        where = self._scenario.source
        if self._radio is None or self._radio.interface is None:
            self._check_no_programs(where)
            return
        if static.arenas > 1:
            raise BadInput(
                "--seeds", "", f"expected one seed: robots' interfaces are in one arena, got {static.arenas}"
            )
        self._addresses(static.robots)
        for group in self._scenario.robots:
            self._program(group)
        check_unused(self._radio.interface, where)

    def check_machine(self, static: Static, factor: float | None) -> None:
        """BadInput where the run cannot have them: in lockstep (`factor` of real time is None), or on this machine."""
        if self._radio is None:
            return
        if factor is None:
            expected = "expected --realtime 1 with it: programs do not wait for a simulation"
            raise BadInput(self._scenario.source, KEY, expected)
        need_open_files(DESCRIPTORS * static.robots)
        check_rights()

    @contextmanager
    def opened(self, static: Static, pace: Pace | None, folder: Path | None) -> Generator[OpenInterfaces | None]:
        """The interfaces within the context; None if there are none."""
        if self._radio is None or pace is None:
            yield None
            return
        with ExitStack() as stack:
            addresses = self._addresses(static.robots)
            interfaces: list[RobotInterface] = []
            for of in addresses:
                interface = RobotInterface(of, self._radio.mtu_bytes)
                stack.callback(interface.close)
                interfaces.append(interface)
            ports = stack.enter_context(closing(FramePorts(interfaces, pace)))
            files = folder.resolve() / PROGRAMS if folder else Path(stack.enter_context(TemporaryDirectory()))
            make_subfolder(files)
            names = files / "hosts"
            write_text(names, hosts(static.robot_names, addresses))
            places = _places(static, interfaces, names)
            programs = stack.enter_context(closing(self._new_programs(static, places, addresses, files)))
            yield OpenInterfaces(tuple(interfaces), ports, programs, places, addresses, folder)

    def _new_programs(
        self, static: Static, places: Sequence[RobotNamespace], addresses: Sequence[Addresses], files: Path
    ) -> Programs:
        near = _near(self._scenario)
        programs = {
            robot: RobotProgram(command, places[robot], addresses[robot], near)
            for group in static.groups
            if (command := self._program(group.name))
            for robot in range(group.start, group.stop)
        }
        return Programs(programs, files, static.robots)

    def _program(self, group: str) -> tuple[str, ...]:
        """The program of a group with its path made absolute; BadInput if it is not there."""
        command = self._scenario.robots[group].program
        if not command:
            return ()
        name = command[0]
        path = _near(self._scenario) / name if os.sep in name else shutil.which(name)
        if path is None or not os.access(path, os.X_OK) or Path(path).is_dir():
            expected = f"expected a program that can be run, got {name!r}"
            raise BadInput(self._scenario.source, f"robots.{group}.program", expected)
        return (str(path), *command[1:])

    def _check_no_programs(self, where: str) -> None:
        for group, table in self._scenario.robots.items():
            if table.program and not self._repeated:
                raise BadInput(where, f"robots.{group}.program", f"expected [{KEY}] in the scenario")

    def _addresses(self, robots: int) -> tuple[Addresses, ...]:
        assert self._radio
        assert self._radio.interface
        return addresses_of(self._radio.interface, robots, self._radio.mtu_bytes, self._scenario.source)


def _host_and_port(address: str) -> tuple[str, int] | None:
    """Of "HOST:PORT", and of an endpoint of zenoh such as "tcp/HOST:PORT"; None if it is not of TCP."""
    host, _, port = address.removeprefix("tcp/").rpartition(":")
    return None if "/" in host else (host, int(port))


def _near(scenario: Scenario) -> Path:
    """The folder of the scenario's file."""
    return folder_of(scenario.source).resolve()


def _places(static: Static, interfaces: Sequence[RobotInterface], names: Path) -> tuple[RobotNamespace, ...]:
    pid = os.getpid()
    start = process_start(pid) or 0
    return tuple(
        RobotNamespace(pid, start, interface.namespace, name, str(names))
        for name, interface in zip(static.robot_names, interfaces, strict=True)
    )


class InterfacesLog(Observer):
    """Observer that starts the programs, and says in the run folder where the interfaces are while the run lasts.

    It reports the first program with each way to fail: often the programs of all robots fail alike.

    Summary part: `interfaces`, the frames and bytes sent and delivered, and their lateness.
    """

    def __init__(self, opened: OpenInterfaces, say: Callable[[str], None]) -> None:
        self._opened, self._say = opened, say
        self._reported = {DONE}

    def begin(self, static: Static) -> None:
        """Frames are carried from now on, so programs may come."""
        self._opened.programs.start()
        if self._opened.folder:
            robots = {
                place.robot: {
                    "place": place._asdict(),
                    "mac": addresses.mac_text,
                    "ipv4": str(addresses.ipv4),
                    "ipv6": str(addresses.ipv6) if addresses.ipv6 else None,
                }
                for place, addresses in zip(self._opened.places, self._opened.addresses, strict=True)
            }
            write_text(self._opened.folder / INTERFACES, json.dumps(robots, indent=2) + "\n")

    def see(self, truth: Truth) -> None:
        """Report programs that have ended, and devices that programs have deleted."""
        for event in truth.events:
            robot = int(event.changed.argmax())
            name = self._opened.places[robot].robot
            if event.do == INTERFACE_LOST:
                self._say(f"{name} has no {NAME} any more: a program deleted it, so its programs are off the air")
            elif event.do == ENDED and event.part not in self._reported:
                self._reported.add(event.part)
                line = self._opened.programs.last_line(robot)
                self._say(f"the program of {name} ended ({event.part}){f': {line}' if line else ''}")

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """The report of the whole run."""
        if self._opened.folder:
            (self._opened.folder / INTERFACES).unlink(missing_ok=True)
        self._opened.ports.count_dropped()
        return {"interfaces": self._opened.ports.report()}


def enter_user_namespace() -> None:
    """Start this process again in a user namespace of its own, unless it may make namespaces; BadInput if it must not.

    The user stays the same there, for files and for other programs of that user, such as `swarmwire ctl`.
    """
    if may_make_namespaces():
        return
    if not os.access(DEVICE, os.R_OK | os.W_OK):
        raise BadInput(KEY, "", missing_right(PermissionError(errno.EACCES, "", str(DEVICE))))
    unshare = [shutil.which("unshare") or "unshare", *USER_NAMESPACE, "--"]
    try:
        allowed = subprocess.run([*unshare, "true"], capture_output=True, check=False).returncode == 0
    except OSError:
        raise BadInput(KEY, "", "expected root, or unshare of util-linux: sudo apt-get install util-linux") from None
    if not allowed:
        fix = "sudo sysctl kernel.unprivileged_userns_clone=1 kernel.apparmor_restrict_unprivileged_userns=0"
        raise BadInput(KEY, "", f"expected root, or rights to make a user namespace: {fix}")
    sys.stdout.flush()
    os.execv(unshare[0], [*unshare, sys.executable, *sys.orig_argv[1:]])
