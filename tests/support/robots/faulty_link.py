"""A TCP proxy between a driver and its robot that spoils what passes through it, as it is told to."""

import socket
from collections.abc import Iterator
from contextlib import suppress
from threading import Event, Thread
from typing import Protocol


class HangUp(Exception):
    """The link ends here."""


class Fault(Protocol):
    """What becomes of bytes on their way."""

    def pieces(self, data: bytes) -> Iterator[bytes]:
        """What arrives of them, piece by piece; HangUp ends the link after what arrived before."""
        ...


class Nothing:
    """They arrive as they were sent."""

    def pieces(self, data: bytes) -> Iterator[bytes]:
        yield data


class ByteByByte:
    """They arrive one by one."""

    def pieces(self, data: bytes) -> Iterator[bytes]:
        for at in range(len(data)):
            yield data[at : at + 1]


class Before:
    """Something comes before what was sent next."""

    def __init__(self, piece: bytes) -> None:
        self._piece = piece

    def pieces(self, data: bytes) -> Iterator[bytes]:
        piece, self._piece = self._piece, b""
        yield piece + data


class CutAfter:
    """After so many bytes there is silence, or the link ends."""

    def __init__(self, size: int, *, hang_up: bool = False) -> None:
        self._left, self._hang_up = size, hang_up

    def pieces(self, data: bytes) -> Iterator[bytes]:
        piece = data[: self._left]
        self._left -= len(piece)
        yield piece
        if self._hang_up and len(piece) < len(data):
            raise HangUp


class Late:
    """They are held back until they are let go."""

    def __init__(self) -> None:
        self.let_go = Event()

    def pieces(self, data: bytes) -> Iterator[bytes]:
        assert self.let_go.wait(timeout=10.0)
        yield data


class FaultyLink:
    """Stands at an address of its own for as long as it is entered; one connection after another, or several.

    Attributes:
        answers: what becomes of what the robot sends, from now on.
        commands: what becomes of what the robot is sent.
    """

    def __init__(self, to: tuple[str, int]) -> None:
        self._to = to
        self._listening = socket.create_server(("127.0.0.1", 0))
        self._sockets: list[socket.socket] = []
        self._threads: list[Thread] = []
        self.answers: Fault = Nothing()
        self.commands: Fault = Nothing()

    @property
    def address(self) -> str:
        """Where a driver finds it."""
        host, port = self._listening.getsockname()
        return f"{host}:{port}"

    def __enter__(self) -> "FaultyLink":
        self._start(self._accept)
        return self

    def __exit__(self, *_: object) -> None:
        for ours in (self._listening, *self._sockets):
            with suppress(OSError):
                ours.shutdown(socket.SHUT_RDWR)  # whoever waits for it wakes up
        for thread in self._threads:
            thread.join()
        for ours in (self._listening, *self._sockets):
            ours.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                driver, _ = self._listening.accept()
                self._sockets.append(driver)
                robot = socket.create_connection(self._to)
                self._sockets.append(robot)
                for ours in (driver, robot):
                    ours.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._start(self._pass_on, robot, driver, "answers")
                self._start(self._pass_on, driver, robot, "commands")

    def _pass_on(self, source: socket.socket, sink: socket.socket, which: str) -> None:
        with suppress(OSError, HangUp):
            while data := source.recv(65536):
                fault: Fault = getattr(self, which)
                for piece in fault.pieces(data):
                    sink.sendall(piece)
        for ours in (source, sink):
            with suppress(OSError):
                ours.shutdown(socket.SHUT_RDWR)

    def _start(self, target: object, *args: object) -> None:
        thread = Thread(target=target, args=args, daemon=True)
        self._threads.append(thread)
        thread.start()
