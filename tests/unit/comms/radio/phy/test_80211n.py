"""IEEE 802.11n: bit rates, airtimes and access of single frames."""

from dataclasses import replace

import pytest

from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.radio.config.radio import Radio
from tests.support.comms.radio import at, make_medium, packets, run
from tests.unit.world.scenario.test_bodies import radio_of

PAIR = at((0, 0), (1, 0))


def preset(name: str = "wifi-n-5G", **others: object) -> Radio:
    return replace(radio_of({"preset": name, **others}), send_offset="tick")


@pytest.mark.parametrize(
    ("name", "mbps", "to", "us"),
    [
        # AIFS 43 us, then 36 us + 4 us x ceil((22 + 8 x 166) / 26 or 260 bits); at 2.4 GHz AIFS 70 us and 6 us more.
        ("wifi-n-5G", 6.5, 1, 43 + 36 + 4 * 52),
        ("wifi-n-5G", 65, 1, 43 + 36 + 4 * 6),
        ("wifi-n-2G", 65, 1, 70 + 36 + 4 * 6 + 6),
        # A broadcast is an OFDM frame at 6 Mbit/s: 20 us + 4 us x ceil((22 + 8 x 166) / 24 bits).
        ("wifi-n-5G", 65, BROADCAST, 43 + 20 + 4 * 57),
        ("wifi-n-2G", 6.5, BROADCAST, 70 + 20 + 4 * 57 + 6),
    ],
)
def test_80211n_single_packet_is_received_after_access_and_airtime(name: str, mbps: float, to: int, us: int):
    """A packet of 100 bytes has 66 bytes of headers; nothing else is on air."""
    medium = make_medium(preset(name, bit_rate_bps=round(1e6 * mbps)), 2)
    result = run(medium, PAIR, lambda _: packets([0], to, size=100), 1, 3)
    assert result.fates() == {"RECEIVED": 1}
    assert result.received("received_at_ns").tolist() == [1000 * us]
