"""The frames of a run as a capture in pcapng, which Wireshark reads."""

import struct
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swarmwire.comms.packets import FATE_NAMES
from swarmwire.metrics.atomic import output_file
from swarmwire.metrics.capture.link_headers import Frame, Link

if TYPE_CHECKING:
    import polars as pl


APPLICATION = "swarmwire"
SECTION, INTERFACE, PACKET = 0x0A0D0D0A, 1, 6
BYTE_ORDER = 0x1A2B3C4D
UNKNOWN_LENGTH = -1  # of the section: a reader goes from block to block
# Options: SHB_USERAPPL of the section, the others of the block that they stand in.
COMMENT, USER_APPLICATION, NAME, DESCRIPTION, RESOLUTION = 1, 4, 2, 3, 9
NANOSECONDS = b"\x09"  # 10^-9 s
MAX_OPTION = 65_535  # bytes


def write_capture(to: Path, link: Link, name: str, description: str, frames: Iterable[Frame]) -> int:
    """Write the frames and return their number; BadInput if the file cannot be written.

    Times are since the run's start, which readers show as 1970. A payload that is not known is not captured, but
    counts in the frame's length.
    """
    count = 0
    with output_file(to) as part, part.open("wb") as file:
        file.write(section(APPLICATION) + interface(link.link_type, name, description))
        for frame in frames:
            header = link.header(frame)
            length = len(header) + frame.size_bytes
            file.write(packet(frame.on_air_at_ns, header + frame.payload, length, frame.comments))
            count += 1
    return count


def frames_on_air(packets: "pl.DataFrame", names: Sequence[str]) -> Iterator[Frame]:
    """The frames of one arena in the order of time; `packets` as `RunFolder.packets` has them, `names` of robots.

    A frame without a receiver in range has no row and is left out, as are packets that never went on air.
    """
    import polars as pl

    once = ("on_air_at_ns", "to", "size_bytes", "topic", "payload")
    each = packets.filter(pl.col("receiver").is_not_null()).sort("receiver")
    frames = each.group_by("sender", "sequence").agg(
        *(pl.col(name).first() for name in once),
        pl.col("rssi_dbm").max().alias("strongest_dbm"),
        "receiver",
        "fate",
        "rssi_dbm",
    )
    for row in frames.sort("on_air_at_ns", "sender", "sequence").iter_rows(named=True):
        yield _frame(row, names)


def _frame(row: dict[str, Any], names: Sequence[str]) -> Frame:
    to, sender = row["to"], names[row["sender"]]
    title = f"{sender} to {'all' if to is None else names[to]}: {row['topic']}, packet {row['sequence']}"
    return Frame(
        on_air_at_ns=row["on_air_at_ns"],
        sender=row["sender"],
        to=to,
        sequence=row["sequence"],
        size_bytes=row["size_bytes"],
        payload=row["payload"] or b"",
        rssi_dbm=row["strongest_dbm"],
        comments=(title, *_fates(row, names)),
    )


def _fates(row: dict[str, Any], names: Sequence[str]) -> list[str]:
    """A comment per fate: `received: flock-1 -61.5 dBm, flock-2 -70.1 dBm`."""
    of_fate: dict[str, list[str]] = {}
    for receiver, fate, rssi_dbm in zip(row["receiver"], row["fate"], row["rssi_dbm"], strict=True):
        strength = "" if rssi_dbm is None else f" {rssi_dbm:.1f} dBm"
        of_fate.setdefault(fate, []).append(f"{names[receiver]}{strength}")
    return [f"{fate}: {', '.join(of_fate[fate])}" for fate in FATE_NAMES if fate in of_fate]


def section(application: str) -> bytes:
    """The first block of a file, with the writing application."""
    body = struct.pack("<IHHq", BYTE_ORDER, 1, 0, UNKNOWN_LENGTH)
    return _block(SECTION, body, [(USER_APPLICATION, _text(application))])


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
