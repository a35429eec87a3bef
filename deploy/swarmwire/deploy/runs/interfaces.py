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
from swarmwire.comms.radio.config.radio import Interface, Radio
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.deploy.machine import need_open_files
from swarmwire.world.backends.pacing import Pace
from swarmwire.world.interfaces.addresses import Addresses, addresses_of, check_unused
from swarmwire.world.interfaces.entering import INTERFACES, RobotNamespace, process_start
from swarmwire.world.interfaces.frame_ports import INTERFACE_LOST, FramePorts
from swarmwire.world.interfaces.joining import Join, find_namespaces, joins_of
from swarmwire.world.interfaces.namespaces import (
    DEVICE,
    NAME,
    USER_NAMESPACE,
    ExistingNamespace,
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
LOST = "a program deleted it, or the process whose namespace it joined has ended"
PROGRAMS = "programs"  # folder in the run folder: output, scratch folders and host names of programs
FILES_PER_ROBOT = 4  # open files: its device, its namespace with the changes of links in it, and the process of that


@dataclass(frozen=True)
class OpenInterfaces:
    """The network interfaces of an open run; the tuples have one entry per robot."""

    interfaces: tuple[RobotInterface, ...]
    ports: FramePorts
    programs: Programs
    namespaces: tuple[RobotNamespace, ...]
    addresses: tuple[Addresses, ...]
    folder: Path | None  # the run folder

    def follow(self, start_ns: int, alive: BoolArray) -> tuple[EventRecord, ...]:
        """Start and end programs with `Programs.update`; return the events of programs and devices."""
        return (*self.ports.pop_events(start_ns), *self.programs.update(start_ns, alive))

    @contextmanager
    def with_gateways(self, gateways: Mapping[int, tuple[str, str]]) -> Generator[None]:
        """Let programs reach their robot's gateway over TCP within the context, and no other robot's.

        `gateways` has by robot the gateway's address in its namespace, and outside. BadInput if a robot cannot have the
        address.
        """
        relays: list[Relay] = []
        for robot, (address, outside) in gateways.items():
            inner, outer = _host_and_port(address), _host_and_port(outside)
            if inner and outer:
                self.programs.gateways[robot] = address
                relays.append(Relay(self.interfaces[robot], inner, outer))
        try:
            opened = Relays(relays)
        except OSError as error:
            expected = "expected an address that robots have, and lo up in namespaces that they join"
            raise BadInput("gateways", "", f"{expected}: {error.strerror}") from error
        with closing(opened):
            yield


class RunInterfaces:
    """The network interfaces of one run."""

    def __init__(self, scenario: Scenario, radio: Radio, interface: Interface) -> None:
        """`interface` is the table of the scenario's `radio`."""
        self._scenario, self._radio, self._interface = scenario, radio, interface
        self._existing: dict[int, ExistingNamespace] = {}  # by robot

    def check(self, static: Static) -> None:
        """Raise BadInput if the scenario or the seeds exclude interfaces; nothing is made."""
        if static.arenas > 1:
            raise BadInput("seeds", "", f"expected one seed: robots' interfaces are in one arena, got {static.arenas}")
        self._addresses(static.robots)
        for group in self._scenario.robots:
            self._program(group)
        self._joins(static)
        check_unused(self._interface, self._scenario.source)

    def check_machine(self, static: Static, factor: float | None) -> None:
        """Find the namespaces that robots join.

        BadInput for a run in lockstep, whose real-time `factor` is None, or a machine without the rights or namespaces.
        """
        if factor is None:
            expected = "expected realtime 1 with it: programs do not wait for a simulation"
            raise BadInput(self._scenario.source, KEY, expected)
        need_open_files(FILES_PER_ROBOT * static.robots)
        check_rights()
        self._existing = find_namespaces(self._joins(static), self._interface)

    @contextmanager
    def open(self, static: Static, pace: Pace, folder: Path | None) -> Generator[OpenInterfaces]:
        """Open the interfaces for the context."""
        with ExitStack() as stack:
            addresses = self._addresses(static.robots)
            interfaces: list[RobotInterface] = []
            for robot in range(static.robots):
                interface = self._new_interface(static, robot, addresses[robot])
                stack.callback(interface.close)
                interfaces.append(interface)
            ports = stack.enter_context(closing(FramePorts(interfaces, pace)))
            files = folder.resolve() / PROGRAMS if folder else Path(stack.enter_context(TemporaryDirectory()))
            make_subfolder(files)
            host_names = files / "hosts"
            write_text(host_names, hosts(static.robot_names, addresses))
            namespaces = _namespaces(static, interfaces, host_names)
            programs = stack.enter_context(closing(self._new_programs(static, namespaces, addresses, files)))
            yield OpenInterfaces(tuple(interfaces), ports, programs, namespaces, addresses, folder)

    def _new_interface(self, static: Static, robot: int, addresses: Addresses) -> RobotInterface:
        try:
            return RobotInterface(addresses, self._radio.mtu_bytes, self._existing.get(robot))
        except OSError as error:
            join = self._joins(static).get(robot)
            raise join.failed(error) if join else BadInput(KEY, "", missing_right(error)) from error

    def _new_programs(
        self, static: Static, namespaces: Sequence[RobotNamespace], addresses: Sequence[Addresses], files: Path
    ) -> Programs:
        folder = _scenario_folder(self._scenario)
        programs = {
            robot: RobotProgram(command, namespaces[robot], addresses[robot], folder)
            for group in static.groups
            if (command := self._program(group.name))
            for robot in range(group.start, group.stop)
        }
        return Programs(programs, files, static.robots)

    def _program(self, group: str) -> tuple[str, ...]:
        """Return the command of a group's program with an absolute path; BadInput unless it can be run."""
        command = self._scenario.robots[group].program
        if not command:
            return ()
        name = command[0]
        path = _scenario_folder(self._scenario) / name if os.sep in name else shutil.which(name)
        if path is None or not os.access(path, os.X_OK) or Path(path).is_dir():
            expected = f"expected a program that can be run, got {name!r}"
            raise BadInput(self._scenario.source, f"robots.{group}.program", expected)
        return (str(path), *command[1:])

    def _joins(self, static: Static) -> dict[int, Join]:
        return joins_of(self._interface, static, self._scenario.source)

    def _addresses(self, robots: int) -> tuple[Addresses, ...]:
        return addresses_of(self._interface, robots, self._radio.mtu_bytes, self._scenario.source)


def run_interfaces(scenario: Scenario) -> RunInterfaces | None:
    """Return the network interfaces of a scenario; None without. BadInput for programs without interfaces."""
    radio = scenario.radio
    if radio and radio.interface:
        return RunInterfaces(scenario, radio, radio.interface)
    for group, table in scenario.robots.items():
        if table.program:
            raise BadInput(scenario.source, f"robots.{group}.program", f"expected [{KEY}] in the scenario")
    return None


def _host_and_port(address: str) -> tuple[str, int] | None:
    """Parse "HOST:PORT", or an endpoint such as "tcp/HOST:PORT"; None for another protocol."""
    host, _, port = address.removeprefix("tcp/").rpartition(":")
    return None if "/" in host else (host, int(port))


def _scenario_folder(scenario: Scenario) -> Path:
    return folder_of(scenario.source).resolve()


def _namespaces(static: Static, interfaces: Sequence[RobotInterface], host_names: Path) -> tuple[RobotNamespace, ...]:
    pid = os.getpid()
    start = process_start(pid) or 0
    return tuple(
        RobotNamespace(pid, start, interface.namespace, name, str(host_names))
        for name, interface in zip(static.robot_names, interfaces, strict=True)
    )


class InterfacesLog(Observer):
    """Observer that starts the programs, and keeps a file of the interfaces in the run folder during the run.

    Of the programs that fail in the same way it reports the first, since often the programs of all robots do.

    Summary part: `interfaces`, the frames and bytes sent and delivered, and their lateness.
    """

    def __init__(self, opened: OpenInterfaces, report: Callable[[str], None]) -> None:
        self._opened, self._report = opened, report
        self._reported = {DONE}

    def begin(self, static: Static) -> None:
        """Start the programs, since frames are carried from now on, and write the file."""
        self._opened.programs.start()
        if self._opened.folder:
            robots = {
                namespace.robot: {
                    "place": namespace._asdict(),
                    "mac": addresses.mac_text,
                    "ipv4": str(addresses.ipv4),
                    "ipv6": str(addresses.ipv6) if addresses.ipv6 else None,
                }
                for namespace, addresses in zip(self._opened.namespaces, self._opened.addresses, strict=True)
            }
            write_text(self._opened.folder / INTERFACES, json.dumps(robots, indent=2) + "\n")

    def see(self, truth: Truth) -> None:
        """Report programs that have ended, and devices that programs have deleted."""
        for event in truth.events:
            robot = int(event.changed.argmax())
            name = self._opened.namespaces[robot].robot
            if event.do == INTERFACE_LOST:
                self._report(f"{name} has no {NAME} any more: {LOST}, so its programs are off the air")
            elif event.do == ENDED and event.part not in self._reported:
                self._reported.add(event.part)
                line = self._opened.programs.last_line(robot)
                self._report(f"the program of {name} ended ({event.part}){f': {line}' if line else ''}")

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Remove the file, and return the report of the run."""
        if self._opened.folder:
            (self._opened.folder / INTERFACES).unlink(missing_ok=True)
        self._opened.ports.count_dropped()
        return {"interfaces": self._opened.ports.report()}


def enter_user_namespace() -> None:
    """Restart this process in a new user namespace, unless it may make namespaces; BadInput without the rights.

    The user stays the same, for files and for the user's other programs, such as `swarmwire ctl`.
    """
    if may_make_namespaces():
        return
    if not os.access(DEVICE, os.R_OK | os.W_OK):
        number = errno.EACCES if DEVICE.exists() else errno.ENOENT
        raise BadInput(KEY, "", missing_right(OSError(number, "", str(DEVICE))))
    unshare = [shutil.which("unshare") or "unshare", *USER_NAMESPACE, "--"]
    try:
        allowed = subprocess.run([*unshare, "true"], capture_output=True, check=False).returncode == 0
    except OSError:
        raise BadInput(KEY, "", "expected root, or unshare of util-linux: sudo apt-get install util-linux") from None
    if not allowed:
        fix = "sudo sysctl kernel.unprivileged_userns_clone=1 kernel.apparmor_restrict_unprivileged_userns=0"
        root = "expected root, in a container with --cap-add NET_ADMIN --cap-add SYS_ADMIN"
        raise BadInput(KEY, "", f"{root}, or rights to make a user namespace: {fix}")
    sys.stdout.flush()
    os.execv(unshare[0], [*unshare, sys.executable, *sys.orig_argv[1:]])
