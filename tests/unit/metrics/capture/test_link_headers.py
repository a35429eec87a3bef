"""Link headers, byte by byte, worked out by hand from their specifications."""

import struct
from typing import Any

import pytest

from swarmwire.comms.air.radio import Radio
from swarmwire.metrics.capture.frame import Frame
from swarmwire.metrics.capture.link_headers import link_of
from tests.unit.world.scenario.test_radio_tables import radio_of


def header(radio: Radio, **fields: Any) -> str:
    known: dict[str, Any] = {"on_air_at_ns": 0, "sender": 0x17, "to": None, "sequence": 0x1234, "size_bytes": 6}
    return link_of(radio).header(Frame(**{**known, **fields})).hex()


def of(*parts: str) -> str:
    return "".join(parts).replace(" ", "")


FCS_NONE, RATE, CHANNEL_18 = "0000 0100 00 000000", "0200 0400 90d00300", "0300 0300 1200 00 00"


def test_ieee_802_15_4_has_a_tap_header_and_short_addresses():
    radio = radio_of({"preset": "ieee802154"})
    assert link_of(radio).link_type == 283
    # RSS: -64.0 as a float is 0xc2800000. MAC: data 0x8841, sequence, PAN "WS", everybody, sender.
    tap, mac = of("00 00 2400", FCS_NONE, "0100 0400 000080c2", RATE, CHANNEL_18), of("4188 34 5753 ffff 1700")
    assert header(radio, rssi_dbm=-64.0) == tap + mac
    assert header(radio) == of("00 00 1c00", FCS_NONE, RATE, CHANNEL_18) + mac
    assert header(radio, to=0x0203).endswith(of("6188 34 5753 0302 1700"))  # asks for an acknowledgement
    silent = radio_of({"preset": "ieee802154", "access": {"acknowledged": False}})
    assert header(silent, to=0x0203).endswith(of("4188 34 5753 0302 1700"))


@pytest.mark.parametrize(("frequency_hz", "channel"), [(2.405e9, "0b00"), (2.480e9, "1a00"), (868.3e6, None)])
def test_the_channel_is_told_where_the_band_has_channels(frequency_hz: float, channel: str | None):
    found = header(radio_of({"preset": "ieee802154", "frequency_hz": frequency_hz}))
    if channel is None:
        assert found.startswith(of("00 00 1400", FCS_NONE, RATE, "4188"))
    else:
        assert of("0300 0300", channel, "00 00") in found


def test_ieee_802_11_has_a_radiotap_header_and_udp():
    radio = radio_of({"preset": "wifi-b-1M"})
    assert link_of(radio).link_type == 127
    # Flags, rate 2 x 500 kbit/s, 2412 MHz, CCK at 2 GHz, -61 dBm.
    radiotap = of("00 00 0f00 2e000000 00 02 6c09 a000 c3")
    mac = of("0800 0000", "ff" * 6, "025357000018", "025357000000", "4023")
    # IPv4: 34 bytes, identification 0x1234, 64 hops, UDP, 10.0.0.24 to all. Words: 4500 + 0022 + 1234 + 0000 + 4011
    # + 0a00 + 0018 + ffff + ffff = 0x2a17d, folded a17f; its complement is 5e80.
    ip, udp = of("4500 0022 1234 0000 40 11 5e80 0a000018 ffffffff"), "c000c000000e0000"
    assert header(radio, rssi_dbm=-61.4) == radiotap + mac + "aaaa030000000800" + ip + udp
    assert header(radio).startswith(of("00 00 0e00 0e000000 00 02 6c09 a000 0800"))


@pytest.mark.parametrize(("preset", "duration_us"), [("wifi-b-1M", 10 + 192 + 112), ("wifi-a-6M", 16 + 44)])
def test_an_addressed_frame_keeps_the_air_for_its_acknowledgement(preset: str, duration_us: int):
    found = bytes.fromhex(header(radio_of({"preset": preset}), to=2))
    assert found[14:24] == struct.pack("<HH", 8, duration_us) + bytes.fromhex("025357000003")
    words = struct.unpack(">10H", found[14 + 24 + 8 :][:20])
    assert sum(words) % 0xFFFF == 0


def test_a_radio_without_a_standard_has_a_plain_header():
    for preset in ("disk", "kilobot", "ble-1M", "gz-rfcomms", "acoustic"):
        radio = radio_of({"preset": preset})
        assert link_of(radio).link_type == 147
        assert header(radio, to=3, rssi_dbm=-64.0) == of("00 14 0000 17000000 03000000 34120000 000080c2")
    assert header(radio_of({"preset": "disk"})) == of("00 14 0000 17000000 ffffffff 34120000 0000c07f")
