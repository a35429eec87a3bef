"""Messages between a campaign and its workers: a length of 4 bytes, little-endian, and msgpack."""

from typing import Any, BinaryIO, cast

import msgpack

LENGTH_BYTES = 4


def send(stream: BinaryIO, message: dict[str, Any]) -> None:
    """Write a message, all of it; OSError if nobody reads any more."""
    body = msgpack.packb(message)
    stream.write(len(body).to_bytes(LENGTH_BYTES, "little") + body)
    stream.flush()


def receive(stream: BinaryIO) -> dict[str, Any] | None:
    """The next message; None at the end of the stream, also in the middle of one."""
    head = stream.read(LENGTH_BYTES)
    if len(head) < LENGTH_BYTES:
        return None
    length = int.from_bytes(head, "little")
    body = stream.read(length)
    return cast("dict[str, Any]", msgpack.unpackb(body)) if len(body) == length else None
