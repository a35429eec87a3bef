"""Packets out of the bytes of a connection, however they are cut; no I/O."""

from collections.abc import Iterator
from typing import NamedTuple

from swarmwire.comms.errors import BadFrame
from swarmwire.comms.robots.epuck2.command import RobotCommand
from swarmwire.comms.robots.epuck2.packets import COMMAND_BYTES, PAYLOAD_BYTES, Header


class Answer(NamedTuple):
    """One answer of a robot."""

    header: Header
    payload: bytes


class Answers:
    """What a robot answers, out of its bytes."""

    def __init__(self) -> None:
        self._rest = bytearray()

    def fed(self, data: bytes) -> Iterator[Answer]:
        """Answers that are whole with these bytes; BadFrame where none can begin: the rest cannot be told apart."""
        rest = self._rest
        rest += data
        while rest:
            header = _header(rest[0])
            end = 1 + PAYLOAD_BYTES[header]
            if len(rest) < end:
                return
            payload = bytes(rest[1:end])
            del rest[:end]
            yield Answer(header, payload)


class Commands:
    """What a program tells a robot, out of its bytes."""

    def __init__(self) -> None:
        self._rest = bytearray()

    @property
    def begun(self) -> bool:
        """Whether a part of a command has come."""
        return bool(self._rest)

    def fed(self, data: bytes) -> Iterator[RobotCommand]:
        """Commands that are whole with these bytes; BadFrame at one that is none: the rest cannot be told apart."""
        rest = self._rest
        rest += data
        while len(rest) >= COMMAND_BYTES:
            packet = bytes(rest[:COMMAND_BYTES])
            del rest[:COMMAND_BYTES]
            try:
                command = RobotCommand.decoded(packet)
            except BadFrame:
                rest.clear()
                raise
            yield command


def _header(first: int) -> Header:
    try:
        return Header(first)
    except ValueError:
        raise BadFrame("garbage", f"expected an answer of 1, 2 or 3, got {first}") from None
