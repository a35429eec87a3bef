"""Packets as a capture: frames of the table, link headers and blocks, byte by byte as specified."""

import struct
from typing import Any

import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.ethernet import exchanged
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.metrics.records.capture import CapturedFrame, frames_on_air, interface, link_of, packet, section
from swarmwire.metrics.records.run_folder.packets import PacketsTable
from tests.support.metrics.films import Captured, read
from tests.unit.world.scenario.test_bodies import radio_of

NAMES = ("a-0", "a-1", "a-2")


def table(*rows: dict[str, object]) -> pl.DataFrame:
    usual = {"arena": 0, "sender": 0, "receivers": 1, "sequence": 0, "size_bytes": 4, "topic": "Beacon"}
    packets = [{**dict.fromkeys(PacketsTable.types), **usual, **row} for row in rows]
    return pl.DataFrame(packets, schema=PacketsTable.types)


def test_packet_is_one_frame_with_its_fate_at_each_receiver():
    one = {"on_air_at_ns": 70, "payload": b"told"}
    packets = table(
        {**one, "receiver": 2, "fate": "collided", "rssi_dbm": -80.0},
        {**one, "receiver": 1, "fate": "received", "rssi_dbm": -61.5},
        {"sequence": 1, "receiver": None, "fate": "channel_busy", "on_air_at_ns": 90},
    )
    comments = ("a-0 to all: Beacon, packet 0", "received: a-1 -61.5 dBm", "collided: a-2 -80.0 dBm")
    assert list(frames_on_air(packets, NAMES)) == [CapturedFrame(70, 0, None, 0, 4, b"told", -61.5, comments)]


def test_frames_are_in_the_order_of_time_and_addressed_ones_say_to_whom():
    packets = table(
        {"sequence": 7, "receiver": 1, "to": 1, "fate": "lost", "on_air_at_ns": 5},
        {"sender": 2, "receiver": 0, "fate": "received", "on_air_at_ns": 3},
        {"sender": 1, "receiver": 0, "fate": "received", "on_air_at_ns": 3},
    )
    frames = list(frames_on_air(packets, NAMES))
    assert [(frame.on_air_at_ns, frame.sender, frame.to) for frame in frames] == [(3, 1, None), (3, 2, None), (5, 0, 1)]
    assert frames[2].comments == ("a-0 to a-1: Beacon, packet 7", "lost: a-1")
    assert (frames[2].payload, frames[2].rssi_dbm) == (b"", None)


def header(radio: Radio, **fields: Any) -> str:
    usual: dict[str, Any] = {"on_air_at_ns": 0, "sender": 0x17, "to": None, "sequence": 0x1234, "size_bytes": 6}
    return link_of(radio).header(CapturedFrame(**{**usual, **fields})).hex()


def joined(*parts: str) -> str:
    return "".join(parts).replace(" ", "")


FCS_NONE, RATE, CHANNEL_18 = "0000 0100 00 000000", "0200 0400 90d00300", "0300 0300 1200 00 00"


def test_ieee_802_15_4_has_a_tap_header_and_short_addresses():
    radio = radio_of({"preset": "ieee802154"})
    assert link_of(radio).link_type == 283
    # RSS: -64.0 as a float is 0xc2800000. MAC: data 0x8841, sequence, PAN "WS", everybody, sender.
    tap, mac = joined("00 00 2400", FCS_NONE, "0100 0400 000080c2", RATE, CHANNEL_18), joined("4188 34 5753 ffff 1700")
    assert header(radio, rssi_dbm=-64.0) == tap + mac
    assert header(radio) == joined("00 00 1c00", FCS_NONE, RATE, CHANNEL_18) + mac
    assert header(radio, to=0x0203).endswith(joined("6188 34 5753 0302 1700"))  # asks for an acknowledgement
    silent = radio_of({"preset": "ieee802154", "access": {"acknowledged": False}})
    assert header(silent, to=0x0203).endswith(joined("4188 34 5753 0302 1700"))


@pytest.mark.parametrize(("frequency_hz", "channel"), [(2.405e9, "0b00"), (2.480e9, "1a00"), (868.3e6, None)])
def test_channel_is_written_only_for_bands_that_have_channels(frequency_hz: float, channel: str | None):
    text = header(radio_of({"preset": "ieee802154", "frequency_hz": frequency_hz}))
    if channel is None:
        assert text.startswith(joined("00 00 1400", FCS_NONE, RATE, "4188"))
    else:
        assert joined("0300 0300", channel, "00 00") in text


def test_ieee_802_11_has_a_radiotap_header_and_udp():
    radio = radio_of({"preset": "wifi-b-1M"})
    assert link_of(radio).link_type == 127
    # Flags, rate 2 x 500 kbit/s, 2412 MHz, CCK at 2 GHz, -61 dBm.
    radiotap = joined("00 00 0f00 2e000000 00 02 6c09 a000 c3")
    mac = joined("0800 0000", "ff" * 6, "025357000018", "025357000000", "4023")
    # IPv4: 34 bytes, identification 0x1234, 64 hops, UDP, 10.0.0.24 to all. Words: 4500 + 0022 + 1234 + 0000 + 4011
    # + 0a00 + 0018 + ffff + ffff = 0x2a17d, folded a17f; its complement is 5e80.
    ip, udp = joined("4500 0022 1234 0000 40 11 5e80 0a000018 ffffffff"), "c000c000000e0000"
    assert header(radio, rssi_dbm=-61.4) == radiotap + mac + "aaaa030000000800" + ip + udp
    assert header(radio).startswith(joined("00 00 0e00 0e000000 00 02 6c09 a000 0800"))


def test_ieee_802_11n_frame_has_its_mcs_and_qos_control():
    radio = radio_of({"preset": "wifi-n-5G", "bit_rate_bps": 39_000_000})
    # Flags, padding, 5180 MHz, OFDM at 5 GHz, then 20 MHz, long guard interval, HT-mixed, MCS 4.
    radiotap = joined("00 00 1100 0a000800 00 00 3c14 4001 0f 00 04")
    # QoS data; reserves SIFS and an acknowledgement at 24 Mbit/s: 16 + 28 us.
    mac = joined("8800 2c00", "025357000003", "025357000018", "025357000000", "4023", "0000")
    assert header(radio, to=2).startswith(radiotap + mac + "aaaa030000000800")
    adaptive = radio_of({"preset": "wifi-n-5G", "access": {"rate_control": "aarf"}})
    assert header(adaptive, to=2).startswith(joined("00 00 1100 0a000800 00 00 3c14 4001 0d"))
    # A broadcast is an OFDM frame: rate 12 x 500 kbit/s.
    assert header(radio).startswith(joined("00 00 0e00 0e000000 00 0c 3c14 4001", "8800"))


@pytest.mark.parametrize(("preset", "duration_us"), [("wifi-b-1M", 10 + 192 + 112), ("wifi-a-6M", 16 + 44)])
def test_addressed_wifi_frame_reserves_the_air_for_its_acknowledgement(preset: str, duration_us: int):
    data = bytes.fromhex(header(radio_of({"preset": preset}), to=2))
    assert data[14:24] == struct.pack("<HH", 8, duration_us) + bytes.fromhex("025357000003")
    words = struct.unpack(">10H", data[14 + 24 + 8 :][:20])
    assert sum(words) % 0xFFFF == 0


# A configuration BPDU (IEEE 802.1D, 9.3.1) of 35 bytes behind LLC with SAP 0x42, 38 bytes by the length; then padding.
BPDU = joined("424203 0000 00 00 00 8000025357000001 00000000 8000025357000001 8001 0000 1400 0200 0f00")
# The frames of Cisco's discovery protocol have SNAP of their own, with OUI 00-00-0c.
CDP = joined("aaaa03 00000c 2000 02b40000")


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("0026" + BPDU + "00" * 8, BPDU),
        (f"{len(CDP) // 2:04x}" + CDP, CDP),
        ("05dc" + "fefe03" + "83" * 1497, "fefe03" + "83" * 1497),  # IS-IS, at the greatest length
        ("0600" + "01" * 46, "aaaa03000000" + "0600" + "01" * 46),  # the smallest type
        ("0806" + "01" * 28, "aaaa03000000" + "0806" + "01" * 28),
        ("8100" + "0005" + "0800" + "45" * 20, "aaaa03000000" + "8100" + "0005" + "0800" + "45" * 20),  # VLAN 5
    ],
)
def test_llc_of_frames_with_a_length_stays_and_types_stand_behind_snap(content: str, expected: str):
    radio = radio_of({"preset": "wifi-a-6M", "interface": {}})
    frame = bytes.fromhex("0180c2000000" + "025357000018" + content)
    carried = link_of(radio).interface_frame
    assert carried is not None
    captured = carried(CapturedFrame(0, 0x17, None, 1, len(frame), exchanged(frame)))
    to_llc = joined("0180c2000000", "025357000018", "025357000000", "1000")
    assert captured.hex().partition(to_llc)[2] == expected


def test_radio_without_a_standard_has_a_plain_header():
    for preset in ("unit-disk", "kilobot", "ble-1M", "gz-rfcomms", "acoustic"):
        radio = radio_of({"preset": preset})
        assert link_of(radio).link_type == 147
        assert header(radio, to=3, rssi_dbm=-64.0) == joined("00 14 0000 17000000 03000000 34120000 000080c2")
    assert header(radio_of({"preset": "unit-disk"})) == joined("00 14 0000 17000000 ffffffff 34120000 0000c07f")


def test_blocks_are_those_of_the_specification():
    expected = "0a0d0d0a 28000000 4d3c2b1a 0100 0000 ffffffffffffffff 0400 0200 73770000 00000000 28000000"
    assert section("sw").hex() == expected.replace(" ", "")
    expected = (
        "01000000 30000000 1b01 0000 00000000"
        " 0200 0300 61697200 0300 0200 68690000 0900 0100 09000000 00000000 30000000"
    )
    assert interface(283, "air", "hi").hex() == expected.replace(" ", "")
    expected = "06000000 28000000 00000000 01000000 02000000 05000000 09000000 0102030405000000 28000000"
    assert packet(2**32 + 2, bytes([1, 2, 3, 4, 5]), 9).hex() == expected.replace(" ", "")


PACKETS = st.lists(
    st.builds(
        Captured, st.integers(0, 2**63), st.binary(max_size=40), st.integers(40, 99), st.lists(st.text(), max_size=3)
    )
)


@given(PACKETS)
def test_capture_is_read_back_as_written(tmp_path_factory, packets: list[Captured]):
    path = tmp_path_factory.mktemp("capture") / "some.pcapng"
    blocks = [packet(one.at_ns, one.data, one.length, one.comments) for one in packets]
    path.write_bytes(section("s") + interface(147, "n", "d") + b"".join(blocks))
    capture = read(path)
    assert (capture.section, capture.interface) == ({4: [b"s"]}, {2: [b"n"], 3: [b"d"], 9: [b"\x09"]})
    assert (capture.link_type, capture.packets) == (147, packets)


def test_comment_too_long_for_an_option_is_cut_between_characters(tmp_path):
    path = tmp_path / "long.pcapng"
    path.write_bytes(section("s") + interface(147, "n", "d") + packet(0, b"", 0, ["é" * 40_000, "next"]))
    assert read(path).packets[0].comments == ["é" * 32_767, "next"]
