"""Poses by UDP: one JSON object a datagram, from any simulator.

    {"robot": "flock-0", "x_m": 1.0, "y_m": 2.0, "z_m": 0.0, "heading_rad": 0.5}

x and y are in the arena's frame, whose origin is its centre; z is the height of the robot's lower side; the heading is
0 along x and rises to the left. A robot keeps its height and its heading where `z_m` and `heading_rad` are left out.
With `stamps` each message also has its time in s as `t_s`. Other keys are ignored.
"""

import ipaddress
import math
import socket
import threading
from abc import abstractmethod

import msgspec

from swarmwire.comms.base.clock import to_ns
from swarmwire.comms.base.errors import BadInput
from swarmwire.world.motion.live import LiveSource
from swarmwire.world.scenario.motion import UdpMotion

MAX_DATAGRAM_BYTES = 65_535
MAX_TIME_S = 1e9  # of a stamp: some 30 years
MAX_PORT = 65_535
BUFFER_BYTES = 1 << 20  # the kernel's queue of datagrams, which it may cut
POLL_S = 0.2  # time after which the thread sees that the source was closed


class PoseMessage(msgspec.Struct):
    """The JSON object of a datagram."""

    robot: str
    x_m: float
    y_m: float
    z_m: float = math.nan
    heading_rad: float = math.nan
    t_s: float = math.nan


class DatagramSource(LiveSource):
    """Receives datagrams in a thread of its own."""

    @abstractmethod
    def take(self, datagram: bytes) -> None:
        """Take the poses in a datagram; its thread calls this."""

    def listen(self, address: str) -> None:
        """Bind an address and begin to receive; BadInput if it is in use or no address."""
        host, _, port = address.rpartition(":")
        key = "listen"
        if not host or not port.isdecimal() or int(port) > MAX_PORT:
            raise BadInput(address, key, 'expected an address and a port, such as "127.0.0.1:9870"')
        try:
            self._socket = _bound(host.strip("[]"), int(port))
        except OSError as error:
            raise BadInput(address, key, f"expected an address that is free: {error}") from error
        self._socket.settimeout(POLL_S)
        bound = self._socket.getsockname()
        self.address = f"udp {host}:{bound[1]}"
        self.is_exposed = not ipaddress.ip_address(bound[0]).is_loopback
        self._is_open = True
        self._thread = threading.Thread(target=self._receive, name="poses", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread and free the address; safe to call more than once."""
        self._is_open = False
        self._thread.join()
        self._socket.close()

    def _receive(self) -> None:
        while self._is_open:
            try:
                datagram = self._socket.recv(MAX_DATAGRAM_BYTES)
            except TimeoutError:
                continue
            try:
                self.take(datagram)
            except Exception:  # noqa: BLE001 - whatever a datagram does to its decoder, the next one is received
                self.count("poses_malformed")


class UdpSource(DatagramSource):
    """Takes JSON objects."""

    motion: UdpMotion

    def open(self) -> None:
        """Begin to receive; BadInput if the address is in use or no address."""
        self._decode = msgspec.json.Decoder(PoseMessage).decode
        self.listen(self.motion.listen)

    def take(self, datagram: bytes) -> None:
        """Take the pose in a datagram."""
        try:
            message = self._decode(datagram)
        except (msgspec.MsgspecError, UnicodeDecodeError):
            self.count("poses_malformed")
        else:
            stamp_ns = to_ns(message.t_s) if abs(message.t_s) <= MAX_TIME_S else None  # NaN: without a stamp
            self.put(message.robot, message.x_m, message.y_m, message.z_m, message.heading_rad, stamp_ns)


def _bound(host: str, port: int) -> socket.socket:
    """Return a socket that is bound to an address; OSError if it cannot be."""
    family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    bound = socket.socket(family, socket.SOCK_DGRAM)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
        bound.bind(address)
    except OSError:
        bound.close()
        raise
    return bound
