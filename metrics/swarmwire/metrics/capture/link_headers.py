"""Link headers: the headers before the payload of a frame in a capture, by kind of radio.

| link type | headers |
| --- | --- |
| 283, IEEE802_15_4_TAP | TAP (strength, rate, channel), then IEEE 802.15.4 with short addresses |
| 127, IEEE802_11_RADIOTAP | radiotap (rate, channel, strength), then IEEE 802.11, LLC, IPv4 and UDP |
| 147, USER0 | `PLAIN`, for radios without a standard |

Robots' addresses are their indices. No frame has a checksum at its end.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from swarmwire.comms.radio.config.radio import Radio, acknowledgement_bytes, airtime_ns
from swarmwire.comms.radio.timing import IEEE_802_11A, IEEE_802_11B, IEEE_802_11G

IEEE802_15_4_TAP, IEEE802_11_RADIOTAP, USER0 = 283, 127, 147

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
NETWORK = bytes.fromhex("025357000000")  # the BSSID, and the first bytes of stations
LLC_IPV4 = bytes.fromhex("aaaa030000000800")
UDP, UDP_PORT = 17, 49_152  # the first port that belongs to nobody


@dataclass(frozen=True, slots=True)
class Frame:
    """A packet that was on air, once for all of its receivers; of one that was sent again, the last time."""

    on_air_at_ns: int  # since the start of the run
    sender: int  # index in the arena
    to: int | None  # index of the one that it is addressed to; None: a broadcast
    sequence: int  # packets that the sender had sent before
    size_bytes: int  # payload
    payload: bytes = b""  # as far as it is known
    rssi_dbm: float | None = None  # at the receiver where it was strongest; None: unknown
    comments: tuple[str, ...] = ()  # its content, and its fates


class Link(NamedTuple):
    """How frames of a radio are captured."""

    link_type: int
    most_robots: int  # that have addresses
    header: Callable[[Frame], bytes]


def link_of(radio: Radio) -> Link:
    """The link type of a radio's frames."""
    if radio.is_phy and radio.frame != "plain":
        return Link(IEEE802_11_RADIOTAP, 1 << 24, partial(_headers_80211, radio))
    if radio.is_phy and radio.reception_or_default.model == "802.15.4":
        return Link(IEEE802_15_4_TAP, SHORT_ROBOTS, partial(_headers_802154, radio))
    return Link(USER0, EVERYBODY, _plain)


def _plain(frame: Frame) -> bytes:
    to = EVERYBODY if frame.to is None else frame.to
    rssi_dbm = float("nan") if frame.rssi_dbm is None else frame.rssi_dbm
    return PLAIN.pack(0, PLAIN.size, 0, frame.sender, to, frame.sequence & 0xFFFFFFFF, rssi_dbm)


def _headers_802154(radio: Radio, frame: Frame) -> bytes:
    return _tap(radio, frame) + _ieee802154(radio, frame)


def _tap(radio: Radio, frame: Frame) -> bytes:
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


def _ieee802154(radio: Radio, frame: Frame) -> bytes:
    """The header of a data frame within one PAN (IEEE 802.15.4-2006, 7.2)."""
    access = radio.access_or_default
    is_answered = frame.to is not None and access.acknowledged and access.method == "csma-802154"
    control = DATA | SAME_PAN | SHORT_TO | SHORT_FROM | (ACKNOWLEDGE if is_answered else 0)
    to = SHORT_EVERYBODY if frame.to is None else frame.to
    return struct.pack("<HBHHH", control, frame.sequence & 0xFF, PAN, to, frame.sender)


def _headers_80211(radio: Radio, frame: Frame) -> bytes:
    return _radiotap(radio, frame) + _ieee80211(radio, frame)


def _radiotap(radio: Radio, frame: Frame) -> bytes:
    """Version 0 (radiotap.org): flags, rate in 500 kbit/s, channel in MHz with its kind, and strength in dBm."""
    band = AT_2_GHZ if radio.frequency_hz < 3e9 else AT_5_GHZ
    kind = band | (CCK if radio.frame == "802.11b" else OFDM)
    fields = struct.pack("<BBHH", 0, radio.bit_rate_bps // 500_000, round(radio.frequency_hz / 1e6), kind)
    present = RADIOTAP_FIELDS
    if frame.rssi_dbm is not None:
        present |= RADIOTAP_STRENGTH
        fields += struct.pack("<b", max(-128, min(round(frame.rssi_dbm), 127)))
    return struct.pack("<BBHI", 0, 0, 8 + len(fields), present) + fields


def _ieee80211(radio: Radio, frame: Frame) -> bytes:
    """A data frame of an ad hoc network (IEEE 802.11-2007, 7.2.2) with LLC, IPv4 (RFC 791) and UDP (RFC 768)."""
    to = b"\xff" * 6 if frame.to is None else _station(frame.to)
    duration_us = 0 if frame.to is None else _answer_us(radio)
    head = struct.pack("<HH6s6s6sH", DATA_FRAME, duration_us, to, _station(frame.sender), NETWORK, _count(frame))
    length = 8 + frame.size_bytes
    datagram = struct.pack(">HHHH", UDP_PORT, UDP_PORT, length, 0)  # 0: no checksum
    return head + LLC_IPV4 + _ipv4(frame, length) + datagram


def _count(frame: Frame) -> int:
    return (frame.sequence & 0xFFF) << 4  # the fragment's number below: 0


def _station(robot: int) -> bytes:
    return NETWORK[:3] + (robot + 1).to_bytes(3, "big")


def _answer_us(radio: Radio) -> int:
    """How long the medium is taken after a frame that is acknowledged: SIFS and the acknowledgement."""
    if not (radio.access_or_default.acknowledged and radio.access_or_default.method == "dcf"):
        return 0
    dcf = {"802.11a": IEEE_802_11A, "802.11b": IEEE_802_11B, "802.11g": IEEE_802_11G}[radio.frame]
    answer_ns = int(airtime_ns(radio, np.array([acknowledgement_bytes(radio)]))[0])
    return -(-(dcf.sifs_ns + answer_ns) // 1000)


def _ipv4(frame: Frame, data_bytes: int) -> bytes:
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
