"""A robot whose answers a test writes byte by byte."""

import socket
from collections.abc import Callable
from threading import Thread

COMMAND_BYTES = 21


class ScriptedRobot:
    """Takes one connection after another while it is entered, and answers each command as `answer` says.

    Attributes:
        commands: the packets that came.
    """

    def __init__(self, answer: Callable[[bytes], bytes]) -> None:
        self._answer = answer
        self._listening = socket.create_server(("127.0.0.1", 0))
        self._thread = Thread(target=self._serve, daemon=True)
        self._driver: socket.socket | None = None
        self._ended = False
        self.commands: list[bytes] = []

    @property
    def address(self) -> str:
        """Where it answers."""
        host, port = self._listening.getsockname()
        return f"{host}:{port}"

    def __enter__(self) -> "ScriptedRobot":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended = True
        self._listening.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._listening.close()

    def _serve(self) -> None:
        while not self._ended:
            try:
                driver, _ = self._listening.accept()
            except OSError:
                return
            with driver:
                driver.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                while len(packet := driver.recv(COMMAND_BYTES, socket.MSG_WAITALL)) == COMMAND_BYTES:
                    self.commands.append(packet)
                    driver.sendall(self._answer(packet))
