"""The UDP side of emulated Crazyflies: a socket for each, all in one thread."""

import socket
from collections.abc import Sequence
from contextlib import suppress
from selectors import EVENT_READ, DefaultSelector
from threading import Lock, Thread
from typing import Protocol

from swarmwire.comms.errors import BadInput

WHERE = "gateway crazyflie"
MAX_DATAGRAM_BYTES = 64  # longer ones are cut, and still too long
NULL = b"\xff"  # of a scan, which is no client


def addresses_of(address: str, robots: int) -> list[tuple[str, int]]:
    """Host and port of each robot; BadInput if the address is malformed or has too few ports.

    >>> addresses_of("127.0.0.1:19850", 2), addresses_of("", 1)
    ([('127.0.0.1', 19850), ('127.0.0.1', 19851)], [('127.0.0.1', 0)])
    """
    host, colon, port = (address or "127.0.0.1:0").partition(":")
    first = int(port) if port.isascii() and port.isdigit() else -1
    if not host or not colon or first < 0 or (first and first + robots - 1 > 65535):
        expected = f'expected "host:port" (ports count up, to 65535) or "host:0" (any ports); got {address!r}'
        raise BadInput(WHERE, "address", expected)
    return [(host, first + i if first else 0) for i in range(robots)]


class Answering(Protocol):
    """A robot that answers datagrams."""

    def receive(self, datagram: bytes) -> bytes | None:
        """The answer; None: there is none."""
        ...


class Server:
    """A thread that answers for all robots of a group until `close`; the newest client of a robot gets what it logs.

    Attributes:
        addresses: of the robots.
        lock: held while a robot answers.
        alive: (n,) whether each robot answers.
    """

    def __init__(self, robots: Sequence[Answering], addresses: Sequence[tuple[str, int]]) -> None:
        """BadInput if an address is in use or not permitted."""
        self.robots = list(robots)
        self.lock, self.alive = Lock(), [True] * len(robots)
        self._sockets = _bound(addresses)
        self.addresses: list[tuple[str, int]] = [of.getsockname()[:2] for of in self._sockets]
        self._clients: list[tuple[str, int] | None] = [None] * len(robots)
        self._end, self._ended = socket.socketpair()
        self._thread = Thread(target=self._serve, name="crazyflie gateway", daemon=True)
        self._thread.start()

    def send(self, robot: int, datagrams: Sequence[bytes]) -> None:
        """Send to the robot's client, if there is one."""
        client = self._clients[robot]
        if client is not None:
            for datagram in datagrams:
                with suppress(OSError):
                    self._sockets[robot].sendto(datagram, client)

    def close(self) -> None:
        """Answer no more, and free the addresses."""
        self._end.close()
        self._thread.join()
        for of in (*self._sockets, self._ended):
            of.close()

    def _serve(self) -> None:
        with DefaultSelector() as selector:
            for robot, of in enumerate(self._sockets):
                selector.register(of, EVENT_READ, robot)
            selector.register(self._ended, EVENT_READ, None)
            while True:
                for key, _ in selector.select():
                    if key.data is None:
                        return
                    self._answer(key.data)

    def _answer(self, robot: int) -> None:
        with suppress(OSError):
            datagram, client = self._sockets[robot].recvfrom(MAX_DATAGRAM_BYTES)
            with self.lock:
                answer = self.robots[robot].receive(datagram) if self.alive[robot] else None
            if datagram != NULL:
                self._clients[robot] = client
            if answer is not None:
                self._sockets[robot].sendto(answer, client)


def _bound(addresses: Sequence[tuple[str, int]]) -> list[socket.socket]:
    """A socket for each address; if one fails, all are closed."""
    sockets: list[socket.socket] = []
    for host, port in addresses:
        made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sockets.append(made)
        try:
            made.bind((host, port))
        except OSError as error:
            for of in sockets:
                of.close()
            expected = f"expected {host}:{port} to be free, and ours to take: {error.strerror or error}"
            raise BadInput(WHERE, "address", expected) from error
    return sockets
