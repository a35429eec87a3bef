"""Blocks of pcapng (IETF draft-ietf-opsawg-pcapng): a section, its interface, its packets; little-endian throughout.

Every block is type, total length, body, options, total length again; bodies and options are padded to 4 bytes.
"""

import struct
from collections.abc import Sequence

SECTION, INTERFACE, PACKET = 0x0A0D0D0A, 1, 6
BYTE_ORDER = 0x1A2B3C4D
UNKNOWN_LENGTH = -1  # of the section: a reader goes from block to block
COMMENT, APPLICATION, NAME, DESCRIPTION, RESOLUTION = 1, 4, 2, 3, 9  # options, of the block that each stands in
NANOSECONDS = b"\x09"  # 10^-9 s
MAX_OPTION = 65_535  # bytes


def section(application: str) -> bytes:
    """The block that a file starts with: who wrote it."""
    body = struct.pack("<IHHq", BYTE_ORDER, 1, 0, UNKNOWN_LENGTH)
    return _block(SECTION, body, [(APPLICATION, _text(application))])


def interface(link_type: int, name: str, description: str) -> bytes:
    """Where packets come from, all with this link type; packets name it by its place in the file, from 0."""
    options = [(NAME, _text(name)), (DESCRIPTION, _text(description)), (RESOLUTION, NANOSECONDS)]
    return _block(INTERFACE, struct.pack("<HHI", link_type, 0, 0), options)


def packet(at_ns: int, captured: bytes, length: int, comments: Sequence[str] = ()) -> bytes:
    """A packet of the first interface at this time, with `length` bytes of which the first were captured."""
    body = struct.pack("<IIIII", 0, at_ns >> 32, at_ns & 0xFFFFFFFF, len(captured), length) + _padded(captured)
    return _block(PACKET, body, [(COMMENT, _text(comment)) for comment in comments])


def _block(kind: int, body: bytes, options: Sequence[tuple[int, bytes]]) -> bytes:
    listed = b"".join(struct.pack("<HH", code, len(value)) + _padded(value) for code, value in options)
    end = struct.pack("<HH", 0, 0) if options else b""
    length = struct.pack("<I", 12 + len(body) + len(listed) + len(end))
    return struct.pack("<I", kind) + length + body + listed + end + length


def _text(text: str) -> bytes:
    """UTF-8, cut after the last character that an option has room for."""
    return text.encode()[:MAX_OPTION].decode(errors="ignore").encode()


def _padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 4)
