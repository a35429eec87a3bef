"""A reader of pcapng, written from the specification and apart from the writer."""

from dataclasses import dataclass
from pathlib import Path


@dataclass
class Captured:
    """A packet as it stands in a file."""

    at_ns: int
    data: bytes
    length: int
    comments: list[str]


@dataclass
class Capture:
    """A file: its options as text or bytes by code, its link type and packets."""

    section: dict[int, list[bytes]]
    interface: dict[int, list[bytes]]
    link_type: int
    packets: list[Captured]


def read(path: Path) -> Capture:
    """The whole of a file with one section and one interface."""
    blocks = list(_blocks(path.read_bytes()))
    assert [kind for kind, _ in blocks[:2]] == [0x0A0D0D0A, 1]
    head, interface = blocks[0][1], blocks[1][1]
    assert head[:16].hex() == "4d3c2b1a" + "01000000" + "ff" * 8
    assert all(kind == 6 for kind, _ in blocks[2:])
    packets = [_packet(body) for _, body in blocks[2:]]
    return Capture(_options(head[16:]), _options(interface[8:]), _number(interface, 0, 2), packets)


def _blocks(data: bytes):
    at = 0
    while at < len(data):
        kind, length = _number(data, at, 4), _number(data, at + 4, 4)
        assert length % 4 == 0
        assert length == _number(data, at + length - 4, 4)
        yield kind, data[at + 8 : at + length - 4]
        at += length
    assert at == len(data)


def _packet(body: bytes) -> Captured:
    interface, high, low, captured, length = (_number(body, 4 * place, 4) for place in range(5))
    assert interface == 0
    padded = captured + -captured % 4
    assert body[20 + captured : 20 + padded] == bytes(padded - captured)
    comments = [text.decode() for text in _options(body[20 + padded :]).get(1, [])]
    return Captured(high * 2**32 + low, body[20 : 20 + captured], length, comments)


def _options(data: bytes) -> dict[int, list[bytes]]:
    found: dict[int, list[bytes]] = {}
    while data:
        code, length = _number(data, 0, 2), _number(data, 2, 2)
        if code == 0:
            assert data == bytes(4)
            break
        found.setdefault(code, []).append(data[4 : 4 + length])
        data = data[4 + length + -length % 4 :]
    return found


def _number(data: bytes, at: int, size: int) -> int:
    return int.from_bytes(data[at : at + size], "little")
