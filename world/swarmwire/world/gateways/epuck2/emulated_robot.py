"""One emulated e-puck2 as its connections see it; everything here runs in the gateway's thread."""

import asyncio
import socket
from collections import Counter, deque
from collections.abc import Callable
from typing import cast

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.robots.epuck2.commands import Commands, RobotCommand
from swarmwire.comms.robots.epuck2.packets import PAYLOAD_BYTES, Header, Request

MOST_WAITING = 4  # connections; the one that has waited longest has given up
MOST_UNREAD_BYTES = 1 << 20  # of answers; whoever reads none of them will not begin to
_BLACK_IMAGE = bytes([Header.IMAGE]) + bytes(PAYLOAD_BYTES[Header.IMAGE])
_EMPTY = bytes([Header.EMPTY])


class Connection(asyncio.Protocol):
    """One connection, whose robot decides when it is read."""

    def __init__(self, robot: "EmulatedRobot") -> None:
        self._robot = robot
        self.commands = Commands()
        self.unanswered = False  # whether an answer could not be handed over, since it was gone by then
        self.transport: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """As asyncio has it."""
        self.transport = cast("asyncio.Transport", transport)
        # asyncio leaves that out for sockets that it has not made itself, and an answer could wait for 40 ms.
        transport.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._robot.knock(self)

    def data_received(self, data: bytes) -> None:
        """As asyncio has it."""
        self._robot.hear(self, data)

    def connection_lost(self, exc: Exception | None) -> None:
        """As asyncio has it."""
        self._robot.miss(self)


class EmulatedRobot:
    """A robot that serves one connection at a time, as the firmware does; those that come meanwhile wait unread.

    A dead one serves none. One that is revived has booted: all connections from before are gone.
    """

    def __init__(self, told: Callable[[RobotCommand], None], answer: Callable[[], bytes], counts: Counter[str]) -> None:
        self._told, self._answer, self._counts = told, answer, counts
        self._served: Connection | None = None
        self._waiting: deque[Connection] = deque()
        self._request: Request | None = None  # of the last command of the one that is served
        self._alive = True

    def knock(self, connection: Connection) -> None:
        """A connection came."""
        self._waiting.append(connection)
        if self._alive and self._served is None:
            self._serve_next()
        else:
            # Not at once: before Python 3.11.5 a transport begins to read after it is made, paused or not.
            asyncio.get_running_loop().call_soon(self._keep_waiting, connection)
            self._counts["clients_kept_waiting"] += self._served is not None
            if len(self._waiting) > MOST_WAITING:
                self._counts["connections_dropped"] += 1
                self._waiting.popleft().transport.abort()

    def _keep_waiting(self, connection: Connection) -> None:
        if connection in self._waiting:
            connection.transport.pause_reading()

    def hear(self, connection: Connection, data: bytes) -> None:
        """The connection that is served sent this; what it told is done, even if it did not wait for the answers."""
        try:
            for command in connection.commands.fed(data):
                self._request = command.request
                self._told(command)
                self._reply(connection, command.request)
        except BadFrame as bad:
            self._counts[bad.fault] += 1
            connection.transport.abort()

    def miss(self, connection: Connection) -> None:
        """A connection is gone; the robot keeps to what it was told last."""
        if connection.commands.begun:
            self._counts["half_commands"] += 1
        if connection in self._waiting:
            self._waiting.remove(connection)
        elif connection is self._served:
            self._served = None
            if self._alive:
                self._serve_next()

    def live(self, alive: bool) -> None:
        """Whether the robot is alive from now on."""
        if alive and not self._alive:
            self.hang_up()
        elif self._alive and not alive and self._served is not None:
            self._served.transport.pause_reading()
        self._alive = alive

    def tell_unasked(self) -> None:
        """Answer the last command once more, unless the answer before still waits to be taken."""
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

    def _reply(self, connection: Connection, request: Request) -> None:
        if connection.transport.is_closing():  # asyncio would complain of each answer
            self._counts["left_unanswered"] += not connection.unanswered
            connection.unanswered = True
            return
        if connection.transport.get_write_buffer_size() > MOST_UNREAD_BYTES:
            self._counts["unread_answers"] += 1
            connection.unanswered = True
            connection.transport.abort()
            return
        image = b""
        if request & Request.IMAGE:
            self._counts["images_without_camera"] += 1
            image = _BLACK_IMAGE
        told = self._answer() if request & Request.SENSORS else b"" if request else _EMPTY
        connection.transport.write(image + told)  # at once: it could be gone after the first half
