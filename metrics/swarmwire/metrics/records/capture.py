"""The frames of a run as a capture in pcapng, which Wireshark reads, with the link headers of each kind of radio.

| link type | headers |
| --- | --- |
| 283, IEEE802_15_4_TAP | TAP (strength, rate, channel), then IEEE 802.15.4 with short addresses |
| 127, IEEE802_11_RADIOTAP | radiotap (rate, channel, strength), then IEEE 802.11, LLC, IPv4 and UDP |
| 147, USER0 | `PLAIN`, for radios without a standard |

| 1, ETHERNET | none: frames of robots' network interfaces on radios that carry them whole |

Robots' addresses are their indices. No frame has a checksum at its end. A frame of a robot's network interface on a
radio of IEEE 802.11 has that header, then LLC with its own type in place of IPv4 and UDP. One with a length in place of
a type, such as those of spanning trees, brings its own LLC.
"""

import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

import polars as pl

from swarmwire.comms.base.atomic import output_file
from swarmwire.comms.base.ethernet import ADDRESS_BYTES, FRAME_TAG, HEADER_BYTES, exchanged, station
from swarmwire.comms.radio.config.radio import Radio, acknowledgement_ns
from swarmwire.comms.radio.timing import IEEE_802_11A, IEEE_802_11B, IEEE_802_11G
from swarmwire.comms.robot.packets import FATE_NAMES, TAG_BYTES

ETHERNET, IEEE802_15_4_TAP, IEEE802_11_RADIOTAP, USER0 = 1, 283, 127, 147

# Version 0, length of the header, 2 bytes of 0, sender, receiver (all ones: everybody), sequence, dBm (NaN: unknown).
PLAIN = struct.Struct("<BBHIIIf")
EVERYBODY = 0xFFFFFFFF

FCS_TYPE, RSS, BIT_RATE, CHANNEL = range(4)  # TLVs of TAP
PAN = 0x5357  # "SW"
SHORT_EVERYBODY = 0xFFFF
SHORT_ROBOTS = 0xFFFE  # 0xfffe stands for "no short address"
DATA, ACKNOWLEDGE, SAME_PAN, SHORT_TO, SHORT_FROM = 0x0001, 0x0020, 0x0040, 0x0800, 0x8000  # frame control

RADIOTAP_FIELDS = 1 << 1 | 1 << 2 | 1 << 3  # flags, rate, channel
RADIOTAP_STRENGTH = 1 << 5
CCK, OFDM, AT_2_GHZ, AT_5_GHZ = 0x0020, 0x0040, 0x0080, 0x0100  # of a channel
DATA_FRAME = 0x0008  # frame control: data between stations of an ad hoc network
NETWORK = bytes.fromhex("025357000000")  # the BSSID
SNAP = bytes.fromhex("aaaa03000000")  # LLC, before a type of Ethernet (IEEE 802)
MAX_LENGTH = 1500  # of what follows Ethernet's header; greater numbers there are types, from 1536 on
IPV4 = bytes.fromhex("0800")
UDP, UDP_PORT = 17, 49_152  # the first port that belongs to nobody
APPLICATION = "swarmwire"
SECTION, INTERFACE, PACKET = 0x0A0D0D0A, 1, 6
BYTE_ORDER = 0x1A2B3C4D
UNKNOWN_LENGTH = -1  # of the section: a reader goes from block to block
# Options: SHB_USERAPPL of the section, the others of the block that they stand in.
COMMENT, USER_APPLICATION, NAME, DESCRIPTION, RESOLUTION = 1, 4, 2, 3, 9
NANOSECONDS = b"\x09"  # 10^-9 s
MAX_OPTION = 65_535  # bytes


@dataclass(frozen=True, slots=True)
class CapturedFrame:
    """A packet that was on air, once for all of its receivers; of one that was sent again, the last time."""

    on_air_at_ns: int  # since the start of the run
    sender: int  # index in the arena
    to: int | None  # index of the one that it is addressed to; None: a broadcast
    sequence: int  # packets that the sender had sent before
    size_bytes: int  # payload
    payload: bytes = b""  # as far as it is known
    rssi_dbm: float | None = None  # at the receiver where it was strongest; None: unknown
    comments: tuple[str, ...] = ()  # its content, and its fates

    @property
    def ethernet(self) -> bytes:
        """The whole Ethernet frame, if it is one of a robot's network interface; else nothing."""
        is_frame = int.from_bytes(self.payload[:TAG_BYTES], "little") == FRAME_TAG
        return exchanged(self.payload) if is_frame and len(self.payload) == self.size_bytes else b""


class Link(NamedTuple):
    """How frames of a radio are captured."""

    link_type: int
    most_robots: int  # that have addresses
    header: Callable[[CapturedFrame], bytes]
    carried: Callable[[CapturedFrame], bytes] | None = (
        None  # all of a frame of a network interface; None: robots have none
    )
    carried_type: int = ETHERNET  # link type of these


def link_of(radio: Radio) -> Link:
    """The link type of a radio's frames."""
    if radio.is_phy and radio.frame != "plain":
        carried = partial(_ethernet_80211, radio) if radio.interface else None
        headers = partial(_headers_80211, radio)
        return Link(IEEE802_11_RADIOTAP, 1 << 24, headers, carried, IEEE802_11_RADIOTAP)
    carried = attrgetter("ethernet") if radio.interface else None
    if radio.is_phy and radio.reception_or_default.model == "802.15.4":
        return Link(IEEE802_15_4_TAP, SHORT_ROBOTS, partial(_headers_802154, radio), carried)
    return Link(USER0, EVERYBODY, _plain, carried)


def _plain(frame: CapturedFrame) -> bytes:
    to = EVERYBODY if frame.to is None else frame.to
    rssi_dbm = float("nan") if frame.rssi_dbm is None else frame.rssi_dbm
    return PLAIN.pack(0, PLAIN.size, 0, frame.sender, to, frame.sequence & 0xFFFFFFFF, rssi_dbm)


def _headers_802154(radio: Radio, frame: CapturedFrame) -> bytes:
    return _tap(radio, frame) + _ieee802154(radio, frame)


def _tap(radio: Radio, frame: CapturedFrame) -> bytes:
    """TAP 1.1 (github.com/jkcko/ieee802.15.4-tap): a header and TLVs, each padded to 4 bytes."""
    fields = [struct.pack("<HHBxxx", FCS_TYPE, 1, 0)]
    if frame.rssi_dbm is not None:
        fields.append(struct.pack("<HHf", RSS, 4, frame.rssi_dbm))
    fields.append(struct.pack("<HHI", BIT_RATE, 4, radio.bit_rate_bps))
    channel = round((radio.frequency_hz - 2.405e9) / 5e6)
    if 0 <= channel < 16:
        fields.append(struct.pack("<HHHBx", CHANNEL, 3, 11 + channel, 0))  # page 0
    tlvs = b"".join(fields)
    return struct.pack("<BBH", 0, 0, 4 + len(tlvs)) + tlvs


def _ieee802154(radio: Radio, frame: CapturedFrame) -> bytes:
    """The header of a data frame within one PAN (IEEE 802.15.4-2006, 7.2)."""
    access = radio.access_or_default
    is_answered = frame.to is not None and access.acknowledged and access.method == "csma-802154"
    control = DATA | SAME_PAN | SHORT_TO | SHORT_FROM | (ACKNOWLEDGE if is_answered else 0)
    to = SHORT_EVERYBODY if frame.to is None else frame.to
    return struct.pack("<HBHHH", control, frame.sequence & 0xFF, PAN, to, frame.sender)


def _headers_80211(radio: Radio, frame: CapturedFrame) -> bytes:
    return _radiotap(radio, frame) + _ieee80211(radio, frame)


def _radiotap(radio: Radio, frame: CapturedFrame) -> bytes:
    """Version 0 (radiotap.org): flags, rate in 500 kbit/s, channel in MHz with its kind, and strength in dBm."""
    band = AT_2_GHZ if radio.frequency_hz < 3e9 else AT_5_GHZ
    kind = band | (CCK if radio.frame == "802.11b" else OFDM)
    fields = struct.pack("<BBHH", 0, radio.bit_rate_bps // 500_000, round(radio.frequency_hz / 1e6), kind)
    present = RADIOTAP_FIELDS
    if frame.rssi_dbm is not None:
        present |= RADIOTAP_STRENGTH
        fields += struct.pack("<b", max(-128, min(round(frame.rssi_dbm), 127)))
    return struct.pack("<BBHI", 0, 0, 8 + len(fields), present) + fields


def _ethernet_80211(radio: Radio, frame: CapturedFrame) -> bytes:
    """A frame of a network interface as IEEE 802.11 carries it: with its own addresses, and its content behind LLC."""
    frame_bytes = frame.ethernet
    return _radiotap(radio, frame) + _data_frame(radio, frame, frame_bytes[:ADDRESS_BYTES]) + _llc(frame_bytes)


def _llc(frame_bytes: bytes) -> bytes:
    """LLC and content of an Ethernet frame: the type behind SNAP, or what the length covers (IEEE 802.3, 3.2.6)."""
    type_or_length = int.from_bytes(frame_bytes[2 * ADDRESS_BYTES : HEADER_BYTES], "big")
    if type_or_length > MAX_LENGTH:
        return SNAP + frame_bytes[2 * ADDRESS_BYTES :]
    return frame_bytes[HEADER_BYTES : HEADER_BYTES + type_or_length]


def _data_frame(radio: Radio, frame: CapturedFrame, to: bytes) -> bytes:
    """The header of a data frame of an ad hoc network (IEEE 802.11-2007, 7.2.2)."""
    duration_us = 0 if frame.to is None else _answer_us(radio)
    ends = to, station(frame.sender), NETWORK
    return struct.pack("<HH6s6s6sH", DATA_FRAME, duration_us, *ends, _count(frame))


def _ieee80211(radio: Radio, frame: CapturedFrame) -> bytes:
    """A data frame with LLC, IPv4 (RFC 791) and UDP (RFC 768)."""
    to = b"\xff" * ADDRESS_BYTES if frame.to is None else station(frame.to)
    length = 8 + frame.size_bytes
    datagram = struct.pack(">HHHH", UDP_PORT, UDP_PORT, length, 0)  # 0: no checksum
    return _data_frame(radio, frame, to) + SNAP + IPV4 + _ipv4(frame, length) + datagram


def _count(frame: CapturedFrame) -> int:
    return (frame.sequence & 0xFFF) << 4  # the fragment's number below: 0


def _answer_us(radio: Radio) -> int:
    """How long the medium is taken after a frame that is acknowledged: SIFS and the acknowledgement."""
    if not (radio.access_or_default.acknowledged and radio.access_or_default.method == "dcf"):
        return 0
    dcf = {"802.11a": IEEE_802_11A, "802.11b": IEEE_802_11B, "802.11g": IEEE_802_11G}[radio.frame]
    return -(-(dcf.sifs_ns + acknowledgement_ns(radio)) // 1000)


def _ipv4(frame: CapturedFrame, data_bytes: int) -> bytes:
    to = b"\xff" * 4 if frame.to is None else _address(frame.to)
    start = struct.pack(">BBHHHBB", 0x45, 0, 20 + data_bytes, frame.sequence & 0xFFFF, 0, 64, UDP)
    ends = _address(frame.sender) + to
    return start + struct.pack(">H", _checksum(start + ends)) + ends


def _address(robot: int) -> bytes:
    return b"\x0a" + (robot + 1).to_bytes(3, "big")


def _checksum(header: bytes) -> int:
    """The one's complement of the one's complement sum of 16-bit words (RFC 791)."""
    total = sum(struct.unpack(f">{len(header) // 2}H", header))
    while total >> 16:
        total = (total & 0xFFFF) + (total >> 16)
    return ~total & 0xFFFF


def write_capture(to: Path, link: Link, name: str, description: str, frames: Iterable[CapturedFrame]) -> int:
    """Write the frames and return their number; BadInput if the file cannot be written.

    Times are since the run's start, which readers show as 1970. A payload that is not known is not captured, but
    counts in the frame's length.
    """
    count = 0
    with output_file(to) as part, part.open("wb") as file:
        file.write(section(APPLICATION) + interface(link.link_type, name, description))
        if link.carried and link.carried_type != link.link_type:
            file.write(interface(link.carried_type, name, f"network interfaces: {description}"))
        for frame in frames:
            place, captured, length = _captured(link, frame)
            file.write(packet(frame.on_air_at_ns, captured, length, frame.comments, place))
            count += 1
    return count


def _captured(link: Link, frame: CapturedFrame) -> tuple[int, bytes, int]:
    """The interface of the capture, the bytes as far as known, and the length of a frame."""
    if link.carried and frame.ethernet:
        whole = link.carried(frame)
        return int(link.carried_type != link.link_type), whole, len(whole)
    header = link.header(frame)
    return 0, header + frame.payload, len(header) + frame.size_bytes


def frames_on_air(packets: pl.DataFrame, names: Sequence[str]) -> Iterator[CapturedFrame]:
    """The frames of one arena in the order of time; `packets` as `RunFolder.packets` has them, `names` of robots.

    A frame without a receiver in range has no row and is left out, as are packets that never went on air.
    """
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


def _frame(row: dict[str, Any], names: Sequence[str]) -> CapturedFrame:
    to, sender = row["to"], names[row["sender"]]
    title = f"{sender} to {'all' if to is None else names[to]}: {row['topic']}, packet {row['sequence']}"
    return CapturedFrame(
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


def packet(at_ns: int, captured: bytes, length: int, comments: Sequence[str] = (), place: int = 0) -> bytes:
    """A packet of an interface, by its place, at this time, with `length` bytes of which the first were captured."""
    body = struct.pack("<IIIII", place, at_ns >> 32, at_ns & 0xFFFFFFFF, len(captured), length) + _padded(captured)
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
