"""The network interfaces of a run's robots: checked, made for the run, and removed with it."""

import errno
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Generator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from swarmwire.comms.errors import BadInput
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import PacketCounts, Static
from swarmwire.deploy.host import need_open_files
from swarmwire.metrics.atomic import write_text
from swarmwire.world.backends.pacing import Pace
from swarmwire.world.interfaces.addresses import Addresses, addresses_of, check_unused
from swarmwire.world.interfaces.backend import FramePorts
from swarmwire.world.interfaces.entering import process_start
from swarmwire.world.interfaces.namespaces import (
    DEVICE,
    USER_NAMESPACE,
    RobotInterface,
    check_rights,
    may_make_namespaces,
    missing_right,
)
from swarmwire.world.scenario.scenario import Scenario

KEY = "radio.interface"
INTERFACES = "interfaces.json"  # in the run folder, while the run lasts: how `swarmwire exec` finds the namespaces
DESCRIPTORS = 2  # of each robot: its device and its namespace


@dataclass(frozen=True)
class OpenInterfaces:
    """The interfaces of a run that has begun."""

    ports: FramePorts
    interfaces: tuple[RobotInterface, ...]
    folder: Path | None  # the run folder


class RunInterfaces:
    """The interfaces of one run, of which there may be none; a run that is repeated needs none."""

    def __init__(self, scenario: Scenario, *, repeated: bool) -> None:
        radio = scenario.radio
        self._scenario = scenario
        self._radio = radio if radio and radio.interface and not repeated else None

    def __bool__(self) -> bool:
        return self._radio is not None

    def check(self, static: Static, factor: float | None) -> None:
        """BadInput where interfaces do not go together with the run or the machine; nothing is made.

        `factor` is that of real time, None in lockstep.
        """
        if self._radio is None or self._radio.interface is None:
            return
        where = self._scenario.source
        if factor is None:
            raise BadInput(where, KEY, "expected --realtime 1 with it: programs do not wait for a simulation")
        if static.arenas > 1:
            raise BadInput(
                "--seeds", "", f"expected one seed: robots' interfaces are in one arena, got {static.arenas}"
            )
        self._addresses(static.robots)
        check_unused(self._radio.interface, where)
        need_open_files(DESCRIPTORS * static.robots)
        check_rights()

    @contextmanager
    def opened(self, static: Static, pace: Pace | None, folder: Path | None) -> Generator[OpenInterfaces | None]:
        """The interfaces within the context; None if there are none."""
        if self._radio is None or pace is None:
            yield None
            return
        with ExitStack() as stack:
            interfaces: list[RobotInterface] = []
            for addresses in self._addresses(static.robots):
                interface = RobotInterface(addresses, self._radio.mtu_bytes)
                stack.callback(interface.close)
                interfaces.append(interface)
            ports = stack.enter_context(closing(FramePorts(interfaces, pace)))
            yield OpenInterfaces(ports, tuple(interfaces), folder)

    def _addresses(self, robots: int) -> tuple[Addresses, ...]:
        assert self._radio
        assert self._radio.interface
        return addresses_of(self._radio.interface, robots, self._radio.mtu_bytes, self._scenario.source)


class InterfacesLog(Observer):
    """Observer that says in the run folder where the interfaces are, as long as the run lasts.

    Summary part: `interfaces`, the frames and bytes sent and delivered, and their lateness.
    """

    def __init__(self, opened: OpenInterfaces) -> None:
        self._opened = opened

    def begin(self, static: Static) -> None:
        """Frames are carried from now on, so programs may come."""
        if self._opened.folder:
            text = json.dumps(_description(static, self._opened.interfaces), indent=2)
            write_text(self._opened.folder / INTERFACES, text + "\n")

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """The report of the whole run."""
        if self._opened.folder:
            (self._opened.folder / INTERFACES).unlink(missing_ok=True)
        self._opened.ports.count_dropped()
        return {"interfaces": self._opened.ports.report()}


def _description(static: Static, interfaces: Sequence[RobotInterface]) -> dict[str, Any]:
    """The world's process, and by robot its namespace's descriptor there and its addresses."""
    robots = {
        name: {
            "namespace": interface.namespace,
            "mac": interface.addresses.mac_text,
            "ipv4": str(interface.addresses.ipv4),
            "ipv6": str(interface.addresses.ipv6) if interface.addresses.ipv6 else None,
        }
        for name, interface in zip(static.robot_names, interfaces, strict=True)
    }
    return {"pid": os.getpid(), "process_start": process_start(os.getpid()), "robots": robots}


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
