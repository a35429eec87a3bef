"""Network namespaces, each with a TAP device: new ones without names, or existing ones that a robot joins.

Devices and new namespaces exist while their descriptors are open, so they end with this process, also when it is
killed. In an existing namespace only the device is made. A separate thread enters a namespace, makes its sockets and
devices, and ends: these stay in the namespace in which they were made, and other threads never change theirs.

`Relays` lets programs in a namespace reach their robot's gateway: it relays connections to the gateway's server.
"""

import asyncio
import ctypes
import errno
import fcntl
import os
import socket
import struct
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from threading import Event, Thread
from typing import NamedTuple, TypeVar

from swarmwire.comms.base.errors import BadInput
from swarmwire.world.interfaces.addresses import Addresses, has_default_route
from swarmwire.world.interfaces.routes import MulticastRoutes

T = TypeVar("T")

WHERE, KEY = "radio.interface", ""
NAME = "radio0"  # name of each robot's device
DEVICE = Path("/dev/net/tun")
CLONE_NEWNET = 0x40000000  # linux/sched.h
TUNSETIFF, IFF_TAP, IFF_NO_PI = 0x400454CA, 0x0002, 0x1000  # linux/if_tun.h
IFF_TUN_EXCL = 0x8000  # EBUSY for an existing device, also for one that persists without a program
TUNGETIFF, TUNGETDEVNETNS = 0x800454D2, 0x54E3
SIOCSIFFLAGS, SIOCSIFADDR, SIOCSIFNETMASK, SIOCSIFMTU = 0x8914, 0x8916, 0x891C, 0x8922  # linux/sockios.h
SIOCSIFHWADDR = 0x8924
IFF_UP, IFF_MULTICAST = 0x1, 0x1000
ARPHRD_ETHER = 1
CAP_NET_ADMIN, CAP_SYS_ADMIN = 12, 21  # linux/capability.h
USER_NAMESPACE = ("--user", "--map-current-user", "--keep-caps")  # options of unshare, of util-linux
NAME_BYTES = 16  # IFNAMSIZ
CHUNK_BYTES = 65_536  # most bytes that a relay copies at once
# Addresses are unique by construction, so duplicate address detection is off; robots have no router. IPv6 addresses
# survive `ip link set radio0 down`, as IPv4 addresses do. Containers often start with IPv6 off for new devices.
IPV6_SETTINGS = {
    "disable_ipv6": "0",
    "accept_dad": "0",
    "dad_transmits": "0",
    "accept_ra": "0",
    "router_solicitations": "0",
    "keep_addr_on_down": "1",
}


class ExistingNamespace(NamedTuple):
    """A network namespace that a robot joins."""

    path: Path
    pid: int | None  # process with whose end the robot leaves it; None: the robot stays until the end of the run


class RobotInterface:
    """A robot's network namespace with its TAP device, up and with its addresses.

    Attributes:
        tap: descriptor of the device; reads and writes are complete frames and do not block.
        namespace: descriptor of the namespace.
        link_changes: descriptor that is readable when `restore_routes` is due; -1: never.
        process: descriptor that is readable when the process has ended whose namespace it is; -1: none.
    """

    def __init__(self, addresses: Addresses, mtu_bytes: int, existing: ExistingNamespace | None = None) -> None:
        """OSError if rights are missing, or the existing namespace cannot have the device."""
        self.addresses = addresses
        self.namespace = self.tap = self.link_changes = self.process = -1
        self._routes: MulticastRoutes | None = None
        try:
            _in_thread(lambda: self._make(mtu_bytes, existing))
        except OSError:
            self.close()
            raise

    def call_inside(self, function: Callable[[], T]) -> T:
        """Call `function` in a thread inside the namespace, for example to open a socket; return its result."""
        return call_inside(self.namespace, function)

    def restore_routes(self) -> None:
        """Restore the multicast routes that the kernel removed when a program set the device down."""
        if self._routes:
            self._routes.restore()

    def dropped(self) -> int:
        """Return the number of frames that the kernel dropped in both directions; 0 for a deleted device."""
        if self.tap < 0:
            return 0
        try:  # a program may have renamed the device, or moved it to another namespace
            name = fcntl.ioctl(self.tap, TUNGETIFF, bytes(NAME_BYTES + 24))[:NAME_BYTES].rstrip(b"\0").decode()
            namespace = fcntl.ioctl(self.tap, TUNGETDEVNETNS)
            try:
                table = call_inside(namespace, lambda: Path("/proc/thread-self/net/dev").read_text())
            finally:
                os.close(namespace)
        except OSError:
            return 0
        devices = {line.partition(":")[0].strip(): line.partition(":")[2].split() for line in table.splitlines()}
        columns = devices[name]
        return int(columns[3]) + int(columns[11])  # drop of receive and of transmit

    def close(self) -> None:
        """Close device and namespace, which end once no process is in it; safe to call more than once."""
        if self._routes:
            self._routes.close()
            self._routes = None
        for descriptor in (self.tap, self.namespace, self.process):
            if descriptor >= 0:
                os.close(descriptor)
        self.namespace = self.tap = self.link_changes = self.process = -1

    def _make(self, mtu_bytes: int, existing: ExistingNamespace | None) -> None:
        self._enter(existing)
        self.tap = os.open(DEVICE, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
        fcntl.ioctl(self.tap, TUNSETIFF, struct.pack("16sH", NAME.encode(), IFF_TAP | IFF_NO_PI | IFF_TUN_EXCL))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control:
            if existing is None:
                _set(control, "lo", SIOCSIFFLAGS, struct.pack("H", IFF_UP))
            _set(control, NAME, SIOCSIFHWADDR, struct.pack("H6s", ARPHRD_ETHER, self.addresses.mac))
            _set(control, NAME, SIOCSIFMTU, struct.pack("i", mtu_bytes))
            for setting, value in IPV6_SETTINGS.items():
                with suppress(OSError):  # no IPv6, or no right to: then new addresses are usable after a second
                    Path(f"/proc/sys/net/ipv6/conf/{NAME}/{setting}").write_text(value)
            _set(control, NAME, SIOCSIFADDR, _ipv4(self.addresses.ipv4.ip.packed))
            _set(control, NAME, SIOCSIFNETMASK, _ipv4(self.addresses.ipv4.netmask.packed))
            _set(control, NAME, SIOCSIFFLAGS, struct.pack("H", IFF_UP | IFF_MULTICAST))
        if self.addresses.ipv6 is not None:
            self._add_ipv6(self.addresses.ipv6.ip.packed, self.addresses.ipv6.network.prefixlen)
        # Where programs have another network, what they send without an interface stays on it.
        if existing is None or not has_default_route(Path("/proc/thread-self/net/route").read_text()):
            self._routes = MulticastRoutes(NAME)
            self.link_changes = self._routes.fileno()

    def _enter(self, existing: ExistingNamespace | None) -> None:
        """Move this thread to a new namespace, or to an existing one."""
        if existing is None:
            _check(_libc().unshare(CLONE_NEWNET), "unshare")
            self.namespace = os.open("/proc/thread-self/ns/net", os.O_RDONLY | os.O_CLOEXEC)
            return
        if existing.pid is not None:
            self.process = os.pidfd_open(existing.pid)
        self.namespace = os.open(existing.path, os.O_RDONLY | os.O_CLOEXEC)
        _check(_libc().setns(self.namespace, CLONE_NEWNET), "setns")

    def _add_ipv6(self, address: bytes, prefix_bits: int) -> None:
        with suppress(OSError), socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as control:  # machines without IPv6
            request = struct.pack("16sIi", address, prefix_bits, socket.if_nametoindex(NAME))  # struct in6_ifreq
            fcntl.ioctl(control, SIOCSIFADDR, request)


def may_make_namespaces() -> bool:
    """Return True if this process has the capabilities to make namespaces."""
    lines = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    effective = int(lines["CapEff"], 16)
    return all(effective >> capability & 1 for capability in (CAP_NET_ADMIN, CAP_SYS_ADMIN))


def check_rights() -> None:
    """Make a namespace for a test; BadInput names the missing right, and the command that fixes it."""

    def probe() -> None:
        tap = os.open(DEVICE, os.O_RDWR)
        try:
            _check(_libc().unshare(CLONE_NEWNET), "unshare")
        finally:
            os.close(tap)

    try:
        _in_thread(probe)
    except OSError as error:
        raise BadInput(WHERE, KEY, missing_right(error)) from error


def missing_right(error: OSError) -> str:
    """Describe the missing right, with the command that fixes it."""
    if error.filename == str(DEVICE) and error.errno in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return f"expected {DEVICE}: sudo modprobe tun, and in a container --device {DEVICE}"
    if error.filename == str(DEVICE) and error.errno in (errno.EACCES, errno.EPERM):
        return f"expected rights to {DEVICE}: run as root, or sudo chmod 666 {DEVICE}"
    if error.errno == errno.EPERM:
        namespace = " ".join(USER_NAMESPACE)
        return f"expected rights to make network namespaces: run as root, or by unshare {namespace} COMMAND"
    return f"expected network namespaces and TAP devices: {error.strerror}"


def _in_thread(function: Callable[[], T]) -> T:
    """Call `function` in a new thread, which may change its namespace; return the result."""
    with ThreadPoolExecutor(1) as threads:
        return threads.submit(function).result()


def call_inside(namespace: int, function: Callable[[], T]) -> T:
    """Call `function` in a thread inside the network namespace of this descriptor; return the result."""

    def enter_and_call() -> T:
        _check(_libc().setns(namespace, CLONE_NEWNET), "setns")
        return function()

    return _in_thread(enter_and_call)


def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)


def _check(result: int, call: str) -> None:
    if result != 0:
        number = ctypes.get_errno()
        raise OSError(number, f"{call}: {os.strerror(number)}")


def _set(control: socket.socket, name: str, request: int, value: bytes) -> None:
    """Call ioctl on struct ifreq: the interface's name, then the value."""
    fcntl.ioctl(control, request, struct.pack(f"{NAME_BYTES}s24s", name.encode(), value))


def _ipv4(address: bytes) -> bytes:
    """Return the address as struct sockaddr_in."""
    return struct.pack("HH4s", socket.AF_INET, 0, address)


class Relay(NamedTuple):
    """An address within a robot's namespace that leads to a server of the world; host and port each."""

    interface: RobotInterface
    listen: tuple[str, int]
    server: tuple[str, int]


class Relays:
    """Relays of TCP connections, in a separate thread from the creation until `close`."""

    def __init__(self, relays: Sequence[Relay]) -> None:
        """OSError if a robot has no such address."""
        self._relays = relays
        self._sockets = [
            relay.interface.call_inside(lambda relay=relay: socket.create_server(relay.listen)) for relay in relays
        ]
        self._loop = asyncio.new_event_loop()
        self._ended, self._serving = asyncio.Event(), Event()
        self._thread = Thread(target=self._run, name="gateways in namespaces", daemon=True)
        self._thread.start()
        self._serving.wait()

    def close(self) -> None:
        """End all connections; safe to call more than once."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._ended.set)
        self._thread.join()

    def _run(self) -> None:
        try:
            with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
                runner.run(self._serve())
        finally:
            self._serving.set()

    async def _serve(self) -> None:
        servers = [
            await asyncio.start_server(
                lambda reader, writer, relay=relay: _relay(relay, reader, writer), sock=listening
            )
            for relay, listening in zip(self._relays, self._sockets, strict=True)
        ]
        self._serving.set()
        await self._ended.wait()
        for server in servers:
            server.close()


async def _relay(relay: Relay, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Copy the bytes of both directions, until one side closes."""
    with suppress(OSError):
        server_reader, server_writer = await asyncio.open_connection(*relay.server)
        copies = asyncio.create_task(_copy(reader, server_writer)), asyncio.create_task(_copy(server_reader, writer))
        try:
            await asyncio.wait(copies, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for copy in copies:
                copy.cancel()
            server_writer.close()
    writer.close()


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with suppress(OSError):
        while data := await reader.read(CHUNK_BYTES):
            writer.write(data)
            await writer.drain()
