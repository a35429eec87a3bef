"""The e-puck2's protocol: its fact sheet, written out by hand, and a robot that follows a script."""

import socket
import struct
from collections.abc import Callable
from threading import Thread
from typing import Any

# name: offset, format. epuck2_driver_cpp.cpp reads the sensors at these bytes, and Asercom2.c writes them.
SENSORS: dict[str, tuple[int, str]] = {
    "acc": (0, "<3h"),
    "acceleration": (6, "<f"),
    "orientation": (10, "<f"),
    "inclination": (14, "<f"),
    "gyro": (18, "<3h"),
    "magnetometer": (24, "<3f"),
    "temperature": (36, "<b"),
    "proximity": (37, "<8H"),
    "ambient": (53, "<8H"),
    "tof": (69, "<H"),
    "microphones": (71, "<4H"),
    "steps": (79, "<2h"),
    "battery": (83, "<H"),
    "microsd": (85, "<B"),
    "tv_remote": (86, "<3B"),
    "selector": (89, "<B"),
    "ground": (90, "<3H"),
    "ground_ambient": (96, "<3H"),
    "button": (102, "<B"),
    "empty": (103, "<B"),
}
COMMAND: dict[str, tuple[int, str]] = {
    "id": (0, "<B"),
    "request": (1, "<B"),
    "settings": (2, "<B"),
    "left": (3, "<h"),
    "right": (5, "<h"),
    "leds": (7, "<B"),
    "led2": (8, "<3B"),
    "led4": (11, "<3B"),
    "led6": (14, "<3B"),
    "led8": (17, "<3B"),
    "sound": (20, "<B"),
}
IDLE: dict[str, Any] = {"acc": (0, 0, 800), "ambient": (4000,) * 8, "tof": 8190, "battery": 3440, "selector": 15}
COMMAND_BYTES = 21


def sensors(**values: Any) -> bytes:
    """104 bytes: a robot at rest in the dark that sees nothing, but for these."""
    packet = bytearray(104)
    for name, value in (IDLE | values).items():
        offset, layout = SENSORS[name]
        struct.pack_into(layout, packet, offset, *(value if isinstance(value, tuple) else (value,)))
    return bytes(packet)


def read(layout: dict[str, tuple[int, str]], packet: bytes) -> dict[str, Any]:
    """What stands at each place."""
    fields = {name: struct.unpack_from(form, packet, offset) for name, (offset, form) in layout.items()}
    return {name: values[0] if len(values) == 1 else values for name, values in fields.items()}


def command(**values: Any) -> bytes:
    """21 bytes: at rest and dark, asking for the sensors, but for these."""
    packet = bytearray(21)
    for name, value in ({"id": 0x80, "request": 2} | values).items():
        offset, layout = COMMAND[name]
        struct.pack_into(layout, packet, offset, *(value if isinstance(value, tuple) else (value,)))
    return bytes(packet)


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
