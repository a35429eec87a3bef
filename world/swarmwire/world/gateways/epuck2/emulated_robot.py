"""The TCP side of emulated e-puck2s: the address of each, its connections, and the server thread of a group."""

import asyncio
import socket
from collections import Counter, deque
from collections.abc import Callable, Sequence
from threading import Event, Thread
from typing import cast

from swarmwire.comms.errors import BadFrame, BadInput
from swarmwire.comms.robots.epuck2.commands import Commands, RobotCommand
from swarmwire.comms.robots.epuck2.packets import PAYLOAD_BYTES, PORT, Header, PacketRequest

MAX_HOSTS = 254  # of a network of the last byte
MAX_WAITING = 4  # connections; beyond that the oldest is dropped
MAX_UNREAD_BYTES = 1 << 20  # of answers; a client beyond that reads none
BACKLOG = 16
_BLACK_IMAGE = bytes([Header.IMAGE]) + bytes(PAYLOAD_BYTES[Header.IMAGE])
_EMPTY = bytes([Header.EMPTY])
WHERE = "gateway epuck2"
EXPECTED = 'expected "host:port" (ports count up), "127.0.1.*:port" (hosts count up from 1) or "host:0" (any ports)'


def addresses_of(address: str, robots: int) -> list[tuple[str, int]]:
    """Host and port of each robot; BadInput if the address is malformed or has too few ports or hosts.

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


# `Connection` and `EmulatedRobot` run in the thread of the `Server`.


class Connection(asyncio.Protocol):
    """One connection; its robot decides when it is read."""

    def __init__(self, robot: "EmulatedRobot") -> None:
        self._robot = robot
        self.commands = Commands()
        self.unanswered = False  # whether an answer was lost, since the connection was gone
        self.transport: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """As asyncio has it."""
        self.transport = cast("asyncio.Transport", transport)
        # asyncio leaves that out for sockets that it has not made itself, and an answer could wait for 40 ms.
        transport.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._robot.on_connect(self)

    def data_received(self, data: bytes) -> None:
        """As asyncio has it."""
        self._robot.on_receive(self, data)

    def connection_lost(self, exc: Exception | None) -> None:
        """As asyncio has it."""
        self._robot.on_disconnect(self)


class EmulatedRobot:
    """A robot that serves one connection at a time, as the firmware does; other connections wait unread.

    A dead robot serves none. A revived robot has booted: all earlier connections are gone.
    """

    def __init__(
        self, on_command: Callable[[RobotCommand], None], answer: Callable[[], bytes], counts: Counter[str]
    ) -> None:
        self._on_command, self._answer, self._counts = on_command, answer, counts
        self._served: Connection | None = None
        self._waiting: deque[Connection] = deque()
        self._request: PacketRequest | None = None  # of the last command of the one that is served
        self._alive = True

    def on_connect(self, connection: Connection) -> None:
        """Serve a new connection, or let it wait."""
        self._waiting.append(connection)
        if self._alive and self._served is None:
            self._serve_next()
        else:
            # Not at once: before Python 3.11.5 a transport begins to read after it is made, paused or not.
            asyncio.get_running_loop().call_soon(self._keep_waiting, connection)
            self._counts["clients_kept_waiting"] += self._served is not None
            if len(self._waiting) > MAX_WAITING:
                self._counts["connections_dropped"] += 1
                self._waiting.popleft().transport.abort()

    def _keep_waiting(self, connection: Connection) -> None:
        if connection in self._waiting:
            connection.transport.pause_reading()

    def on_receive(self, connection: Connection, data: bytes) -> None:
        """Execute the commands in this data and answer them, also if the client does not wait for the answers."""
        try:
            for command in connection.commands.fed(data):
                self._request = command.request
                self._on_command(command)
                self._reply(connection, command.request)
        except BadFrame as bad:
            self._counts[bad.fault] += 1
            connection.transport.abort()

    def on_disconnect(self, connection: Connection) -> None:
        """Forget a lost connection; the robot keeps its last command."""
        if connection.commands.begun:
            self._counts["half_commands"] += 1
        if connection in self._waiting:
            self._waiting.remove(connection)
        elif connection is self._served:
            self._served = None
            if self._alive:
                self._serve_next()

    def live(self, alive: bool) -> None:
        """Set whether the robot is alive."""
        if alive and not self._alive:
            self.hang_up()
        elif self._alive and not alive and self._served is not None:
            self._served.transport.pause_reading()
        self._alive = alive

    def tell_unasked(self) -> None:
        """Answer the last command once more, unless the last answer is still unread."""
        connection, request = self._served, self._request
        if connection and request is not None and self._alive and not connection.transport.get_write_buffer_size():
            self._reply(connection, request)

    def hang_up(self) -> None:
        """Drop all connections."""
        for connection in (*self._waiting, *([self._served] if self._served else [])):
            connection.transport.abort()
        self._waiting.clear()
        self._served = None

    def _serve_next(self) -> None:
        if self._waiting:
            self._served, self._request = self._waiting.popleft(), None
            self._served.transport.resume_reading()

    def _reply(self, connection: Connection, request: PacketRequest) -> None:
        if connection.transport.is_closing():  # asyncio would complain of each answer
            self._counts["left_unanswered"] += not connection.unanswered
            connection.unanswered = True
            return
        if connection.transport.get_write_buffer_size() > MAX_UNREAD_BYTES:
            self._counts["unread_answers"] += 1
            connection.unanswered = True
            connection.transport.abort()
            return
        image = b""
        if request & PacketRequest.IMAGE:
            self._counts["images_without_camera"] += 1
            image = _BLACK_IMAGE
        packet = self._answer() if request & PacketRequest.SENSORS else b"" if request else _EMPTY
        connection.transport.write(image + packet)  # at once: it could be gone after the first half


class Server:
    """A thread that serves the connections of all emulated e-puck2s of a group, from its creation until `close`."""

    def __init__(self, robots: Sequence[EmulatedRobot], addresses: Sequence[tuple[str, int]]) -> None:
        """BadInput if an address is in use or not permitted."""
        self._robots = robots
        self._sockets = _listening(addresses)
        self.addresses: list[tuple[str, int]] = [listening.getsockname()[:2] for listening in self._sockets]
        self._loop = asyncio.new_event_loop()
        self._ended = asyncio.Event()
        self._serving = Event()
        self._thread = Thread(target=self._run, name="epuck2 gateway", daemon=True)
        self._thread.start()
        self._serving.wait()

    def live(self, alive: Sequence[bool]) -> None:
        """Set which robots are alive."""
        self._loop.call_soon_threadsafe(self._live, alive)

    def tell_unasked(self) -> None:
        """Send the newest readings to all connected clients."""
        self._loop.call_soon_threadsafe(self._tell_unasked)

    def close(self) -> None:
        """Close all connections, and free the addresses."""
        self._loop.call_soon_threadsafe(self._ended.set)
        self._thread.join()

    def _live(self, alive: Sequence[bool]) -> None:
        for robot, is_alive in zip(self._robots, alive, strict=True):
            robot.live(is_alive)

    def _tell_unasked(self) -> None:
        for robot in self._robots:
            robot.tell_unasked()

    def _run(self) -> None:
        try:
            with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
                runner.run(self._serve())
        finally:
            self._serving.set()  # so that the constructor returns also if the thread fails

    async def _serve(self) -> None:
        servers = [
            await self._loop.create_server(lambda robot=robot: Connection(robot), sock=listening)
            for robot, listening in zip(self._robots, self._sockets, strict=True)
        ]
        self._serving.set()
        await self._ended.wait()
        for server in servers:
            server.close()
        for robot in self._robots:
            robot.hang_up()


def _listening(addresses: Sequence[tuple[str, int]]) -> list[socket.socket]:
    """A listening socket for each address; if one fails, all are closed."""
    sockets: list[socket.socket] = []
    for host, port in addresses:
        try:
            sockets.append(socket.create_server((host, port), backlog=BACKLOG))
        except OSError as error:
            for listening in sockets:
                listening.close()
            reason = str(error.strerror or error).partition(" (while")[0]  # the address is said already
            expected = f"expected {host}:{port} to be free, and ours to take: {reason}"
            raise BadInput(WHERE, "address", expected) from error
    return sockets
