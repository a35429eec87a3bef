"""Captures of a run's frames in pcapng, the format of Wireshark, with the link headers of each kind of radio.

| link type | headers |
| --- | --- |
| 283, IEEE802_15_4_TAP | TAP (strength, rate, channel), then IEEE 802.15.4 with short addresses |
| 127, IEEE802_11_RADIOTAP | radiotap (rate, channel, strength), then IEEE 802.11, LLC, IPv4 and UDP |
| 147, USER0 | `PLAIN`, for radios without a standard |
| 1, ETHERNET | none: frames of robots' network interfaces on radios that carry them unchanged |

Robots' addresses are their indices. No frame has a checksum at its end. A frame of a robot's network interface on a
radio of IEEE 802.11 has that header, then LLC with the frame's type in place of IPv4 and UDP. A frame with a length in
place of a type, such as those of spanning trees, has its LLC in the payload.
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
from swarmwire.comms.radio.config.frames import acknowledgement_ns, broadcast_rate_bps, dcf_of
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.timing import HT_BITS_PER_SYMBOL
from swarmwire.comms.robot.packets import FATE_NAMES, TAG_BYTES

ETHERNET, IEEE802_15_4_TAP, IEEE802_11_RADIOTAP, USER0 = 1, 283, 127, 147

# Version 0, length of the header, 2 bytes of 0, sender, receiver (all ones: broadcast), sequence, dBm (NaN: unknown).
PLAIN = struct.Struct("<BBHIIIf")
PLAIN_BROADCAST = 0xFFFFFFFF

FCS_TYPE, RSS, BIT_RATE, CHANNEL = range(4)  # TLVs of TAP
PAN = 0x5357  # "SW"
SHORT_BROADCAST = 0xFFFF
SHORT_ROBOTS = 0xFFFE  # 0xfffe stands for "no short address"
DATA, ACKNOWLEDGE, SAME_PAN, SHORT_TO, SHORT_FROM = 0x0001, 0x0020, 0x0040, 0x0800, 0x8000  # frame control

RADIOTAP_FIELDS = 1 << 1 | 1 << 2 | 1 << 3  # flags, rate, channel
RADIOTAP_STRENGTH = 1 << 5
RADIOTAP_RATE, RADIOTAP_MCS = 1 << 2, 1 << 19
MCS_KNOWN, HT_KNOWN = 0x02, 0x0D  # bandwidth, guard interval and format: 20 MHz, long, HT-mixed
CCK, OFDM, BAND_2_GHZ, BAND_5_GHZ = 0x0020, 0x0040, 0x0080, 0x0100  # channel flags
DATA_FRAME, QOS_DATA_FRAME = 0x0008, 0x0088  # frame control: data between stations of an ad hoc network
NETWORK = bytes.fromhex("025357000000")  # the BSSID
SNAP = bytes.fromhex("aaaa03000000")  # LLC, before a type of Ethernet (IEEE 802)
MAX_LENGTH = 1500  # bytes after Ethernet's header; greater numbers in its field are types, from 1536 on
IPV4 = bytes.fromhex("0800")
UDP, UDP_PORT = 17, 49_152  # the first port that is not registered
APPLICATION = "swarmwire"
SECTION, INTERFACE, PACKET = 0x0A0D0D0A, 1, 6
BYTE_ORDER = 0x1A2B3C4D
UNKNOWN_LENGTH = -1  # unknown length of the section
# Options: SHB_USERAPPL of the section; the others apply to their block.
COMMENT, USER_APPLICATION, NAME, DESCRIPTION, RESOLUTION = 1, 4, 2, 3, 9
NANOSECONDS = b"\x09"  # 10^-9 s
MAX_OPTION = 65_535  # bytes


@dataclass(frozen=True, slots=True)
class CapturedFrame:
    """A packet that was on air, once for all of its receivers; if it was retransmitted, its last attempt."""

    on_air_at_ns: int  # since the start of the run
    sender: int  # index in the arena
    to: int | None  # index of the addressed robot; None: a broadcast
    sequence: int  # number of earlier packets of the sender
    size_bytes: int  # payload
    payload: bytes = b""  # empty if it was not recorded
    rssi_dbm: float | None = None  # strongest at any receiver; None: unknown
    comments: tuple[str, ...] = ()  # content and fates

    @property
    def ethernet(self) -> bytes:
        """The Ethernet frame of a robot's network interface; empty for other packets."""
        is_frame = int.from_bytes(self.payload[:TAG_BYTES], "little") == FRAME_TAG
        return exchanged(self.payload) if is_frame and len(self.payload) == self.size_bytes else b""


class Link(NamedTuple):
    """Link type and encoding of a radio's frames."""

    link_type: int
    max_robots: int  # number of addresses
    header: Callable[[CapturedFrame], bytes]
    # Encodes the frame of a network interface; None: robots have no interfaces.
    interface_frame: Callable[[CapturedFrame], bytes] | None = None
    interface_link_type: int = ETHERNET


def link_of(radio: Radio) -> Link:
    """Return link type and encoding of a radio's frames."""
    if radio.is_phy and radio.frame.startswith("802.11"):
        interface_frame = partial(_ethernet_80211, radio) if radio.interface else None
        headers = partial(_headers_80211, radio)
        return Link(IEEE802_11_RADIOTAP, 1 << 24, headers, interface_frame, IEEE802_11_RADIOTAP)
    interface_frame = attrgetter("ethernet") if radio.interface else None
    if radio.is_phy and radio.reception_or_default.model == "802.15.4":
        return Link(IEEE802_15_4_TAP, SHORT_ROBOTS, partial(_headers_802154, radio), interface_frame)
    return Link(USER0, PLAIN_BROADCAST, _plain, interface_frame)


def _plain(frame: CapturedFrame) -> bytes:
    to = PLAIN_BROADCAST if frame.to is None else frame.to
    rssi_dbm = float("nan") if frame.rssi_dbm is None else frame.rssi_dbm
    return PLAIN.pack(0, PLAIN.size, 0, frame.sender, to, frame.sequence & 0xFFFFFFFF, rssi_dbm)


def _headers_802154(radio: Radio, frame: CapturedFrame) -> bytes:
    return _tap(radio, frame) + _ieee802154(radio, frame)


def _tap(radio: Radio, frame: CapturedFrame) -> bytes:
    """Encode TAP 1.1 (github.com/jkcko/ieee802.15.4-tap): a header and TLVs, each padded to 4 bytes."""
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
    """Encode the header of a data frame within one PAN (IEEE 802.15.4-2006, 7.2)."""
    access = radio.access_or_default
    is_acknowledged = frame.to is not None and access.acknowledged and access.method == "csma-802154"
    control = DATA | SAME_PAN | SHORT_TO | SHORT_FROM | (ACKNOWLEDGE if is_acknowledged else 0)
    to = SHORT_BROADCAST if frame.to is None else frame.to
    return struct.pack("<HBHHH", control, frame.sequence & 0xFF, PAN, to, frame.sender)


def _headers_80211(radio: Radio, frame: CapturedFrame) -> bytes:
    return _radiotap(radio, frame) + _ieee80211(radio, frame)


def _radiotap(radio: Radio, frame: CapturedFrame) -> bytes:
    """Encode radiotap version 0 (radiotap.org): flags, rate in 500 kbit/s or MCS, channel in MHz, strength in dBm."""
    band = BAND_2_GHZ if radio.frequency_hz < 3e9 else BAND_5_GHZ
    kind = band | (CCK if radio.frame == "802.11b" else OFDM)
    is_ht = radio.frame == "802.11n" and frame.to is not None
    bit_rate_bps = radio.bit_rate_bps if frame.to is not None else broadcast_rate_bps(radio)
    fields = struct.pack("<BBHH", 0, 0 if is_ht else bit_rate_bps // 500_000, round(radio.frequency_hz / 1e6), kind)
    present = RADIOTAP_FIELDS
    if frame.rssi_dbm is not None:
        present |= RADIOTAP_STRENGTH
        fields += struct.pack("<b", max(-128, min(round(frame.rssi_dbm), 127)))
    if is_ht:
        present = present ^ RADIOTAP_RATE | RADIOTAP_MCS
        fields_known = HT_KNOWN | (MCS_KNOWN if radio.access_or_default.rate_control == "fixed" else 0)
        fields += struct.pack("<BBB", fields_known, 0, list(HT_BITS_PER_SYMBOL).index(radio.bit_rate_bps))
    return struct.pack("<BBHI", 0, 0, 8 + len(fields), present) + fields


def _ethernet_80211(radio: Radio, frame: CapturedFrame) -> bytes:
    """Encode a frame of a network interface in IEEE 802.11: with the frame's addresses, and its content after LLC."""
    frame_bytes = frame.ethernet
    return _radiotap(radio, frame) + _data_frame(radio, frame, frame_bytes[:ADDRESS_BYTES]) + _llc(frame_bytes)


def _llc(frame_bytes: bytes) -> bytes:
    """Return LLC and content of an Ethernet frame: the type after SNAP, or its length in bytes (IEEE 802.3, 3.2.6)."""
    type_or_length = int.from_bytes(frame_bytes[2 * ADDRESS_BYTES : HEADER_BYTES], "big")
    if type_or_length > MAX_LENGTH:
        return SNAP + frame_bytes[2 * ADDRESS_BYTES :]
    return frame_bytes[HEADER_BYTES : HEADER_BYTES + type_or_length]


def _data_frame(radio: Radio, frame: CapturedFrame, to: bytes) -> bytes:
    """Encode the header of a data frame of an ad hoc network (IEEE 802.11-2007, 7.2.2)."""
    duration_us = 0 if frame.to is None else _duration_us(radio)
    sequence_control = (frame.sequence & 0xFFF) << 4  # fragment number 0 in the lower bits
    sender = station(frame.sender)
    is_qos = radio.frame == "802.11n"
    control = QOS_DATA_FRAME if is_qos else DATA_FRAME
    header = struct.pack("<HH6s6s6sH", control, duration_us, to, sender, NETWORK, sequence_control)
    return header + bytes(2) if is_qos else header  # QoS control: best effort


def _ieee80211(radio: Radio, frame: CapturedFrame) -> bytes:
    """Encode the headers of a data frame with LLC, IPv4 (RFC 791) and UDP (RFC 768)."""
    to = b"\xff" * ADDRESS_BYTES if frame.to is None else station(frame.to)
    length = 8 + frame.size_bytes
    datagram = struct.pack(">HHHH", UDP_PORT, UDP_PORT, length, 0)  # 0: no checksum
    return _data_frame(radio, frame, to) + SNAP + IPV4 + _ipv4(frame, length) + datagram


def _duration_us(radio: Radio) -> int:
    """Return the duration field of a unicast frame: SIFS and the acknowledgement."""
    if not (radio.access_or_default.acknowledged and radio.access_or_default.method == "dcf"):
        return 0
    return -(-(dcf_of(radio).sifs_ns + acknowledgement_ns(radio)) // 1000)


def _ipv4(frame: CapturedFrame, data_bytes: int) -> bytes:
    to = b"\xff" * 4 if frame.to is None else _address(frame.to)
    start = struct.pack(">BBHHHBB", 0x45, 0, 20 + data_bytes, frame.sequence & 0xFFFF, 0, 64, UDP)
    ends = _address(frame.sender) + to
    return start + struct.pack(">H", _checksum(start + ends)) + ends


def _address(robot: int) -> bytes:
    return b"\x0a" + (robot + 1).to_bytes(3, "big")


def _checksum(header: bytes) -> int:
    """Return the one's complement of the one's complement sum of 16-bit words (RFC 791)."""
    total = sum(struct.unpack(f">{len(header) // 2}H", header))
    while total >> 16:
        total = (total & 0xFFFF) + (total >> 16)
    return ~total & 0xFFFF


def write_capture(to: Path, link: Link, name: str, description: str, frames: Iterable[CapturedFrame]) -> int:
    """Write the frames and return their number; BadInput if the file cannot be written.

    Times are since the run's start, which readers show as 1970. A payload that was not recorded is not captured, but
    counts in the frame's length.
    """
    count = 0
    with output_file(to) as part, part.open("wb") as file:
        file.write(section(APPLICATION) + interface(link.link_type, name, description))
        if link.interface_frame and link.interface_link_type != link.link_type:
            file.write(interface(link.interface_link_type, name, f"network interfaces: {description}"))
        for frame in frames:
            index, captured, length = _capture(link, frame)
            file.write(packet(frame.on_air_at_ns, captured, length, frame.comments, index))
            count += 1
    return count


def _capture(link: Link, frame: CapturedFrame) -> tuple[int, bytes, int]:
    """Return the index of the capture's interface, the captured bytes, and the length of a frame."""
    if link.interface_frame and frame.ethernet:
        encoded = link.interface_frame(frame)
        return int(link.interface_link_type != link.link_type), encoded, len(encoded)
    header = link.header(frame)
    return 0, header + frame.payload, len(header) + frame.size_bytes


def frames_on_air(packets: pl.DataFrame, names: Sequence[str]) -> Iterator[CapturedFrame]:
    """Return the frames of one arena in the order of time, from the table `packets` and the robots' names.

    Frames without a receiver in range, which have no row, and packets that never went on air are left out.
    """
    shared = ("on_air_at_ns", "to", "size_bytes", "topic", "payload")
    receptions = packets.filter(pl.col("receiver").is_not_null()).sort("receiver")
    frames = receptions.group_by("sender", "sequence").agg(
        *(pl.col(name).first() for name in shared),
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
    """Return a comment per fate, such as `received: flock-1 -61.5 dBm, flock-2 -70.1 dBm`."""
    receivers: dict[str, list[str]] = {}  # fate: receivers
    for receiver, fate, rssi_dbm in zip(row["receiver"], row["fate"], row["rssi_dbm"], strict=True):
        strength = "" if rssi_dbm is None else f" {rssi_dbm:.1f} dBm"
        receivers.setdefault(fate, []).append(f"{names[receiver]}{strength}")
    return [f"{fate}: {', '.join(receivers[fate])}" for fate in FATE_NAMES if fate in receivers]


def section(application: str) -> bytes:
    """Return the first block of a file, with the writing application."""
    body = struct.pack("<IHHq", BYTE_ORDER, 1, 0, UNKNOWN_LENGTH)
    return _block(SECTION, body, [(USER_APPLICATION, _text(application))])


def interface(link_type: int, name: str, description: str) -> bytes:
    """Return the block of an interface with a link type; packets refer to it by its index in the file, from 0."""
    options = [(NAME, _text(name)), (DESCRIPTION, _text(description)), (RESOLUTION, NANOSECONDS)]
    return _block(INTERFACE, struct.pack("<HHI", link_type, 0, 0), options)


def packet(time_ns: int, captured: bytes, length: int, comments: Sequence[str] = (), index: int = 0) -> bytes:
    """Return the block of a packet of `length` bytes, of which the first are `captured`; `index` of its interface."""
    body = struct.pack("<IIIII", index, time_ns >> 32, time_ns & 0xFFFFFFFF, len(captured), length) + _padded(captured)
    return _block(PACKET, body, [(COMMENT, _text(comment)) for comment in comments])


def _block(kind: int, body: bytes, options: Sequence[tuple[int, bytes]]) -> bytes:
    listed = b"".join(struct.pack("<HH", code, len(value)) + _padded(value) for code, value in options)
    end = struct.pack("<HH", 0, 0) if options else b""
    length = struct.pack("<I", 12 + len(body) + len(listed) + len(end))
    return struct.pack("<I", kind) + length + body + listed + end + length


def _text(text: str) -> bytes:
    """Encode in UTF-8, cut after the last character that fits into an option."""
    return text.encode()[:MAX_OPTION].decode(errors="ignore").encode()


def _padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 4)
