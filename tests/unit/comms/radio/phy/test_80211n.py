"""IEEE 802.11n: bit rates, airtimes and access of single frames."""

from dataclasses import replace

import pytest

from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.radio.config.radio import Radio
from tests.support.comms.radio import TICK_NS, Run, at, make_medium, packets, run
from tests.unit.world.scenario.test_bodies import radio_of

PAIR = at((0, 0), (1, 0))


def preset(name: str = "wifi-n-5G", **others: object) -> Radio:
    return replace(radio_of({"preset": name, **others}), send_offset="tick")


@pytest.mark.parametrize(
    ("name", "mbps", "to", "us"),
    [
        # 36 us + 4 us x ceil((22 + 8 x 166) / 26 or 260 bits); at 2.4 GHz 6 us more.
        ("wifi-n-5G", 6.5, 1, 36 + 4 * 52),
        ("wifi-n-5G", 65, 1, 36 + 4 * 6),
        ("wifi-n-2G", 65, 1, 36 + 4 * 6 + 6),
        # A broadcast is an OFDM frame at 6 Mbit/s: 20 us + 4 us x ceil((22 + 8 x 166) / 24 bits).
        ("wifi-n-5G", 65, BROADCAST, 20 + 4 * 57),
        ("wifi-n-2G", 6.5, BROADCAST, 20 + 4 * 57 + 6),
    ],
)
def test_80211n_single_packet_is_received_after_access_and_airtime(name: str, mbps: float, to: int, us: int):
    """A packet of 100 bytes has 66 bytes of headers; nothing else is on air, so it goes on air in the next slot."""
    medium = make_medium(preset(name, bit_rate_bps=round(1e6 * mbps)), 2)
    result = run(medium, PAIR, lambda _: packets([0], to, size=100), 1, 3)
    assert result.fates() == {"RECEIVED": 1}
    (at_ns,) = result.received("received_at_ns").tolist()
    assert 0 <= at_ns - 1000 * us < (9_000 if name == "wifi-n-5G" else 20_000)


def test_80211n_bit_rate_may_change_during_a_run():
    """From the second tick on MCS 0 in place of MCS 7."""
    radio = preset(bit_rate_bps=65_000_000)
    slow, medium = replace(radio, bit_rate_bps=6_500_000), make_medium(radio, 2)
    out = Run(medium)
    for tick in range(3):
        out.news.append(medium.step(tick * TICK_NS, PAIR, radio=slow if tick == 1 else None))
        medium.send(tick * TICK_NS, tick, packets([0], 1, 100))
    airtime_us = (out.departed("off_air_at_ns") - out.departed("on_air_at_ns")) // 1000
    assert airtime_us.tolist() == [36 + 4 * 6, 36 + 4 * 52]
