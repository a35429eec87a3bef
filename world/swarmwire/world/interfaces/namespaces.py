"""Network namespaces without names, each with a TAP device: they live as long as their descriptors are open.

So they end with this process, however it ends. A thread of its own enters a namespace, makes what belongs there, and
ends: sockets and devices stay in the namespace in which they were made, all other threads in theirs.

`Relays` lets programs in a namespace reach their robot's gateway: connections are relayed to its server outside.
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
from swarmwire.world.interfaces.addresses import Addresses
from swarmwire.world.interfaces.routes import MulticastRoutes

T = TypeVar("T")

WHERE, KEY = "radio.interface", ""
NAME = "radio0"  # of each robot's device
DEVICE = Path("/dev/net/tun")
CLONE_NEWNET = 0x40000000  # linux/sched.h
TUNSETIFF, IFF_TAP, IFF_NO_PI = 0x400454CA, 0x0002, 0x1000  # linux/if_tun.h
TUNGETIFF, TUNGETDEVNETNS = 0x800454D2, 0x54E3
SIOCSIFFLAGS, SIOCSIFADDR, SIOCSIFNETMASK, SIOCSIFMTU = 0x8914, 0x8916, 0x891C, 0x8922  # linux/sockios.h
SIOCSIFHWADDR = 0x8924
IFF_UP, IFF_MULTICAST = 0x1, 0x1000
ARPHRD_ETHER = 1
CAP_NET_ADMIN, CAP_SYS_ADMIN = 12, 21  # linux/capability.h
USER_NAMESPACE = ("--user", "--map-current-user", "--keep-caps")  # options of unshare, of util-linux
NAME_BYTES = 16  # IFNAMSIZ
CHUNK_BYTES = 65_536  # that a relay passes on at once
# Addresses are unique by construction, so nothing need wait for their detection; robots have no router. IPv6 addresses
# survive `ip link set radio0 down`, as those of IPv4 do.
IPV6_SETTINGS = {
    "accept_dad": "0",
    "dad_transmits": "0",
    "accept_ra": "0",
    "router_solicitations": "0",
    "keep_addr_on_down": "1",
}


class RobotInterface:
    """A robot's network namespace with its TAP device, up and with its addresses.

    Attributes:
        tap: descriptor of the device, whose reads and writes are whole frames and do not block.
        namespace: descriptor of the namespace.
        link_changes: descriptor that can be read when `restore_routes` is due.
    """

    def __init__(self, addresses: Addresses, mtu_bytes: int) -> None:
        """BadInput where rights are missing."""
        self.addresses = addresses
        self.namespace = self.tap = self.link_changes = -1
        self._routes: MulticastRoutes | None = None
        try:
            _in_thread(lambda: self._make(mtu_bytes))
        except OSError as error:
            self.close()
            raise BadInput(WHERE, KEY, missing_right(error)) from error

    def within(self, make: Callable[[], T]) -> T:
        """What `make` returns in a thread that is in the namespace; so a socket that it opens is there."""
        return _within(self.namespace, make)

    def restore_routes(self) -> None:
        """Add the routes of multicast again that the kernel removed when a program set the device down."""
        if self._routes:
            self._routes.restore()

    def dropped(self) -> int:
        """Frames that the kernel dropped before the world read them, or after it wrote them; 0 of a deleted device."""
        try:  # a program may have given the device another name, or moved it to another namespace
            name = fcntl.ioctl(self.tap, TUNGETIFF, bytes(NAME_BYTES + 24))[:NAME_BYTES].rstrip(b"\0").decode()
            namespace = fcntl.ioctl(self.tap, TUNGETDEVNETNS)
            try:
                table = _within(namespace, lambda: Path("/proc/thread-self/net/dev").read_text())
            finally:
                os.close(namespace)
        except OSError:
            return 0
        devices = {line.partition(":")[0].strip(): line.partition(":")[2].split() for line in table.splitlines()}
        columns = devices[name]
        return int(columns[3]) + int(columns[11])  # drop of receive and of transmit

    def close(self) -> None:
        """Remove device and namespace, once no process is in it; safe to call more than once."""
        if self._routes:
            self._routes.close()
        for descriptor in (self.tap, self.namespace):
            if descriptor >= 0:
                os.close(descriptor)
        self.namespace = self.tap = self.link_changes = -1

    def _make(self, mtu_bytes: int) -> None:
        _check(_libc().unshare(CLONE_NEWNET), "unshare")
        self.namespace = os.open("/proc/thread-self/ns/net", os.O_RDONLY | os.O_CLOEXEC)
        self.tap = os.open(DEVICE, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
        fcntl.ioctl(self.tap, TUNSETIFF, struct.pack("16sH", NAME.encode(), IFF_TAP | IFF_NO_PI))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control:
            _set(control, "lo", SIOCSIFFLAGS, struct.pack("H", IFF_UP))
            _set(control, NAME, SIOCSIFHWADDR, struct.pack("H6s", ARPHRD_ETHER, self.addresses.mac))
            _set(control, NAME, SIOCSIFMTU, struct.pack("i", mtu_bytes))
            for setting, value in IPV6_SETTINGS.items():
                with suppress(OSError):  # no IPv6, or a container that may not: then addresses take a second
                    Path(f"/proc/sys/net/ipv6/conf/{NAME}/{setting}").write_text(value)
            _set(control, NAME, SIOCSIFADDR, _ipv4(self.addresses.ipv4.ip.packed))
            _set(control, NAME, SIOCSIFNETMASK, _ipv4(self.addresses.ipv4.netmask.packed))
            _set(control, NAME, SIOCSIFFLAGS, struct.pack("H", IFF_UP | IFF_MULTICAST))
        if self.addresses.ipv6 is not None:
            self._add_ipv6(self.addresses.ipv6.ip.packed, self.addresses.ipv6.network.prefixlen)
        self._routes = MulticastRoutes(NAME)
        self.link_changes = self._routes.fileno()

    def _add_ipv6(self, address: bytes, prefix_bits: int) -> None:
        with suppress(OSError), socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as control:  # machines without IPv6
            request = struct.pack("16sIi", address, prefix_bits, socket.if_nametoindex(NAME))  # struct in6_ifreq
            fcntl.ioctl(control, SIOCSIFADDR, request)


def may_make_namespaces() -> bool:
    """Whether this process has the capabilities."""
    lines = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    effective = int(lines["CapEff"], 16)
    return all(effective >> capability & 1 for capability in (CAP_NET_ADMIN, CAP_SYS_ADMIN))


def check_rights() -> None:
    """Make a namespace with a device, and remove them; BadInput says what is missing, and the command that fixes it."""

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
    """What is missing, in a line with the command that fixes it."""
    if error.filename == str(DEVICE) and error.errno in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return f"expected {DEVICE}: sudo modprobe tun"
    if error.filename == str(DEVICE) and error.errno in (errno.EACCES, errno.EPERM):
        return f"expected rights to {DEVICE}: run as root, or sudo chmod 666 {DEVICE}"
    if error.errno == errno.EPERM:
        namespace = " ".join(USER_NAMESPACE)
        return f"expected rights to make network namespaces: run as root, or by unshare {namespace} COMMAND"
    return f"expected network namespaces and TAP devices: {error.strerror}"


def _in_thread(work: Callable[[], T]) -> T:
    """The result of `work` in a thread that ends with it, and so may change its namespace."""
    with ThreadPoolExecutor(1) as threads:
        return threads.submit(work).result()


def _within(namespace: int, work: Callable[[], T]) -> T:
    """The result of `work` in a thread that is in the network namespace of this descriptor."""

    def entered() -> T:
        _check(_libc().setns(namespace, CLONE_NEWNET), "setns")
        return work()

    return _in_thread(entered)


def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)


def _check(result: int, call: str) -> None:
    if result != 0:
        number = ctypes.get_errno()
        raise OSError(number, f"{call}: {os.strerror(number)}")


def _set(control: socket.socket, name: str, request: int, value: bytes) -> None:
    """An ioctl on struct ifreq: the interface's name, then the value."""
    fcntl.ioctl(control, request, struct.pack(f"{NAME_BYTES}s24s", name.encode(), value))


def _ipv4(address: bytes) -> bytes:
    """The address as struct sockaddr_in."""
    return struct.pack("HH4s", socket.AF_INET, 0, address)


class Relay(NamedTuple):
    """A server outside, and where it is to be found within a robot's namespace."""

    interface: RobotInterface
    place: tuple[str, int]
    to: tuple[str, int]


class Relays:
    """Relays of TCP connections, in a thread of their own from the creation until `close`."""

    def __init__(self, relays: Sequence[Relay]) -> None:
        """OSError if a robot has no such address."""
        self._relays = relays
        self._sockets = [
            relay.interface.within(lambda relay=relay: socket.create_server(relay.place)) for relay in relays
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
            await asyncio.start_server(lambda reader, writer, to=relay: _relay(to, reader, writer), sock=listening)
            for relay, listening in zip(self._relays, self._sockets, strict=True)
        ]
        self._serving.set()
        await self._ended.wait()
        for server in servers:
            server.close()


async def _relay(to: Relay, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Pass on what comes from either side, until one of them ends."""
    with suppress(OSError):
        server_reader, server_writer = await asyncio.open_connection(*to.to)
        ways = asyncio.create_task(_copy(reader, server_writer)), asyncio.create_task(_copy(server_reader, writer))
        try:
            await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for way in ways:
                way.cancel()
            server_writer.close()
    writer.close()


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with suppress(OSError):
        while data := await reader.read(CHUNK_BYTES):
            writer.write(data)
            await writer.drain()
