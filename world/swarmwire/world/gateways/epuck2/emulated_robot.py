"""The TCP side of emulated e-puck2s: the address of each, its connections, and the thread of a group.

A robot's radio module has one task, whose loop does one thing in each pass and then sleeps (`socket_e-puck2.c` of its
firmware): it reads a command without waiting, or sends one part of the answer to the last command. So it repeats that
answer until the next command arrives.

A slow client reads ever older answers from the buffers of a real connection. The emulated robot sends a part of an
answer only after the client has read the earlier parts, so that the buffers of this machine, which are larger than a
robot's, cause no delay.
"""

import selectors
import socket
import struct
import sys
import termios
from array import array
from collections import Counter, deque
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from fcntl import ioctl
from threading import Event, Thread

from swarmwire.comms.base.clock import Clock, to_ns
from swarmwire.comms.base.errors import BadFrame, BadInput
from swarmwire.comms.protocols.epuck2.packets import COMMAND_BYTES, PORT, Header, PacketRequest, RobotCommand

MAX_HOSTS = 254  # values of an address's last byte
MAX_WAITING = 4  # waiting connections; with more, the oldest is dropped
BACKLOG = 16
PASS_NS = to_ns(0.01)  # the task sleeps for ten ticks of 1 ms
FLUSH_COMMANDS = 5  # number of unread commands from which only the last is executed
# The module's TCP buffer; with a larger buffer, a slow client on another machine would read older answers.
SEND_BUFFER_BYTES = 5744
WHERE = "gateway epuck2"
EXPECTED = 'expected "host:port" (ports count up), "127.0.1.*:port" (hosts count up from 1) or "host:0" (any ports)'

SOCK_DIAG, BY_FAMILY, REQUEST = 4, 20, 1  # a netlink protocol, the type of its messages, and the flag of a request
ANY = 0xFFFFFFFF  # any state of a connection, and any cookie
_HEADER = struct.Struct("=IHHII")  # nlmsghdr: length, type, flags, number, sender
_REQUEST = struct.Struct("=BBBxI")  # inet_diag_req_v2: family, protocol, further facts, states
_ID = struct.Struct("!HH4s12x4s12x12s")  # inet_diag_sockid: ports and addresses of either end, interface and cookie
_ANY_INTERFACE = struct.pack("=III", 0, ANY, ANY)
_UNREAD = struct.Struct("=I")
_UNREAD_OFFSET = _HEADER.size + 4 + _ID.size + 4  # idiag_rqueue of inet_diag_msg
ANSWER_BYTES = 4096


def addresses_of(address: str, robots: int) -> list[tuple[str, int]]:
    """Return host and port of each robot; BadInput if the address is malformed or has too few ports or hosts.

    >>> addresses_of("127.0.0.1:11000", 2), addresses_of("127.0.1.*", 2)
    ([('127.0.0.1', 11000), ('127.0.0.1', 11001)], [('127.0.1.1', 1000), ('127.0.1.2', 1000)])
    """
    host, colon, port = (address or "127.0.0.1:0").partition(":")
    if not host or (colon and not (port.isascii() and port.isdigit())) or host.count("*") > host.endswith(".*"):
        raise BadInput(WHERE, "address", f"{EXPECTED}; got {address!r}")
    first = int(port) if colon else PORT
    if host.endswith("*"):
        if robots > MAX_HOSTS:
            raise BadInput(WHERE, "address", f"expected at most {MAX_HOSTS} robots for {address!r}, got {robots}")
        return [(f"{host[:-1]}{1 + i}", first) for i in range(robots)]
    last = first + robots - 1 if first else 0
    if last > 65535:
        raise BadInput(WHERE, "address", f"expected ports up to 65535, got {first} to {last}")
    return [(host, first + i if first else 0) for i in range(robots)]


class UnreadBytes:
    """The number of bytes that a client has not read yet, from the kernel (Linux's sock_diag(7)).

    The kernel knows the clients' ends of IPv4 connections within this machine.
    """

    def __init__(self) -> None:
        self._kernel = None
        if sys.platform == "linux":
            self._kernel = socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, SOCK_DIAG)

    def count(self, connection: socket.socket) -> int:
        """Return the number of bytes that have arrived at the client; 0 if it is on another machine."""
        if self._kernel is None:
            return 0
        (client, client_port), (robot, robot_port) = connection.getpeername(), connection.getsockname()
        ends = _ID.pack(client_port, robot_port, socket.inet_aton(client), socket.inet_aton(robot), _ANY_INTERFACE)
        request = _REQUEST.pack(socket.AF_INET, socket.IPPROTO_TCP, 0, ANY) + ends
        self._kernel.send(_HEADER.pack(_HEADER.size + len(request), BY_FAMILY, REQUEST, 0, 0) + request)
        answer = self._kernel.recv(ANSWER_BYTES)
        _, kind, *_ = _HEADER.unpack_from(answer)
        return _UNREAD.unpack_from(answer, _UNREAD_OFFSET)[0] if kind == BY_FAMILY else 0

    def close(self) -> None:
        """Close the socket to the kernel."""
        if self._kernel is not None:
            self._kernel.close()


# `EmulatedRobot` runs in the thread of the `Epuck2Server`.


class EmulatedRobot:
    """A robot that serves one connection at a time, as the firmware does; other connections wait unread.

    A dead robot serves no connection. A revived robot has booted: all earlier connections are closed.
    """

    def __init__(
        self, on_command: Callable[[RobotCommand], None], part: Callable[[Header], bytes], counts: Counter[str]
    ) -> None:
        """`part` returns the newest content of a part of an answer, without its first byte."""
        self._on_command, self._part, self._counts = on_command, part, counts
        self._waiting: deque[socket.socket] = deque()
        self._alive = True
        self._serve(None)

    def connect(self, client: socket.socket) -> None:
        """Serve a new connection, or queue it."""
        client.setblocking(False)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if self._client is not None:
            self._counts["clients_kept_waiting"] += 1
        self._waiting.append(client)
        if len(self._waiting) > MAX_WAITING:
            self._counts["connections_dropped"] += 1
            self._waiting.popleft().close()

    def set_alive(self, alive: bool) -> None:
        """Switch the robot on (alive) or off (dead)."""
        if alive and not self._alive:
            self.hang_up()
        self._alive = alive

    def hang_up(self) -> None:
        """Drop all connections."""
        for client in (*self._waiting, *([self._client] if self._client else [])):
            client.close()
        self._waiting.clear()
        self._serve(None)

    def do_pass(self, unread: UnreadBytes) -> None:
        """One pass of the task; the robot keeps its last command when a connection is lost."""
        if self._client is None and self._waiting and self._alive:
            self._serve(self._waiting.popleft())
        client = self._client
        if client is None or not self._alive:
            return
        try:
            if not self._unsent:
                has_unread = unread.count(client) > 0
                if has_unread or not self._parts:
                    self._read(client)
                    if self._command is not None and not (self._partial or self._parts or has_unread):
                        self._parts.extend(_parts_of(self._command.request))
                    return
                header = self._parts.popleft()
                self._unsent = memoryview(bytes([header]) + self._part(header))
            while self._unsent:
                self._unsent = self._unsent[client.send(self._unsent) :]
        except BlockingIOError:  # the robot waits until the client reads
            return
        except BadFrame as bad:
            self._counts[bad.fault] += 1
            self._lose(client)
        except OSError:
            self._lose(client)

    def _serve(self, client: socket.socket | None) -> None:
        self._client = client
        self._partial = b""  # bytes of an incomplete command
        self._command: RobotCommand | None = None  # last command of this connection
        self._parts: deque[Header] = deque()  # parts of the answer to send
        self._unsent = memoryview(b"")  # unsent bytes of the present part

    def _lose(self, client: socket.socket) -> None:
        if self._partial:
            self._counts["half_commands"] += 1
        client.close()
        self._serve(None)

    def _read(self, client: socket.socket) -> None:
        """Read a command if one has arrived; ConnectionError if the client has left."""
        if not self._partial:
            self._flush(client)
        with suppress(BlockingIOError):
            data = client.recv(COMMAND_BYTES - len(self._partial))
            if not data:
                raise ConnectionResetError
            self._partial += data
        if len(self._partial) == COMMAND_BYTES:
            packet, self._partial = self._partial, b""
            self._command = RobotCommand.decoded(packet)
            self._on_command(self._command)

    def _flush(self, client: socket.socket) -> None:
        """Drop unread commands if there are many: all except the last, which may be incomplete."""
        unread_bytes = array("i", [0])
        ioctl(client, termios.FIONREAD, unread_bytes)
        commands, partial_bytes = divmod(unread_bytes[0], COMMAND_BYTES)
        if commands >= FLUSH_COMMANDS:
            dropped = commands if partial_bytes else commands - 1
            client.recv(dropped * COMMAND_BYTES)
            self._counts["commands_flushed"] += dropped


def _parts_of(request: PacketRequest) -> list[Header]:
    """Return the parts of an answer, in their order."""
    image = [Header.IMAGE] if request & PacketRequest.IMAGE else []
    sensors = [Header.SENSORS] if request & PacketRequest.SENSORS else []
    return [*image, *sensors] or [Header.EMPTY]


class Epuck2Server:
    """A thread that serves the connections of all emulated e-puck2s of a group, from its creation until `close`."""

    def __init__(self, robots: Sequence[EmulatedRobot], addresses: Sequence[tuple[str, int]], clock: Clock) -> None:
        """The clock paces the robots' tasks. BadInput if an address is in use or not permitted."""
        self._robots, self._clock = robots, clock
        self._sockets = _listening(addresses)
        self.addresses: list[tuple[str, int]] = [listening.getsockname()[:2] for listening in self._sockets]
        self._alive: deque[Sequence[bool]] = deque()  # robots' states to apply, oldest first
        self._ended = Event()
        self._thread = Thread(target=self._run, name="epuck2 gateway", daemon=True)
        self._thread.start()

    def set_alive(self, alive: Sequence[bool]) -> None:
        """Switch each robot on (alive) or off (dead)."""
        self._alive.append(alive)

    def close(self) -> None:
        """Close all connections, and free the addresses."""
        self._ended.set()
        self._thread.join()

    def _run(self) -> None:
        clock, robots = self._clock, self._robots
        due_ns = clock.now_ns()
        with selectors.DefaultSelector() as listening, closing(UnreadBytes()) as unread:
            for robot, robot_socket in zip(robots, self._sockets, strict=True):
                listening.register(robot_socket, selectors.EVENT_READ, (robot_socket, robot))
            while not self._ended.is_set():
                self._apply_alive()
                for ready, _ in listening.select(0):
                    _accept(*ready.data)
                for robot in robots:
                    robot.do_pass(unread)
                due_ns = max(due_ns + PASS_NS, clock.now_ns())  # late passes shift all later passes
                clock.sleep_until(due_ns)
        for robot, robot_socket in zip(robots, self._sockets, strict=True):
            robot_socket.close()
            robot.hang_up()

    def _apply_alive(self) -> None:
        while self._alive:
            for robot, alive in zip(self._robots, self._alive.popleft(), strict=True):
                robot.set_alive(alive)


def _accept(listening: socket.socket, robot: EmulatedRobot) -> None:
    with suppress(OSError):  # the client has left again
        client, _ = listening.accept()
        robot.connect(client)


def _listening(addresses: Sequence[tuple[str, int]]) -> list[socket.socket]:
    """Return a listening socket for each address; if one fails, all are closed."""
    sockets: list[socket.socket] = []
    for host, port in addresses:
        try:
            sockets.append(_listening_at(host, port))
        except OSError as error:
            for listening in sockets:
                listening.close()
            reason = str(error.strerror or error).partition(" (while")[0]  # without the address, which the message has
            expected = f"expected {host}:{port} to be free and permitted: {reason}"
            raise BadInput(WHERE, "address", expected) from error
    return sockets


def _listening_at(host: str, port: int) -> socket.socket:
    """Return a listening socket whose connections have the module's buffer size."""
    listening = socket.create_server((host, port), backlog=BACKLOG)
    listening.setblocking(False)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
    return listening
