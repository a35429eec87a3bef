"""Virtual carrier sense of IEEE 802.11: stations that decode data to another one leave room for its acknowledgement."""

from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.radio.config.phy import Access
from swarmwire.comms.radio.config.radio import Radio, Trace
from swarmwire.comms.radio.traces import LinkTraces
from tests.support.comms.radio import TICK_NS, at, make_medium, packets, trace_of, with_access

US = 1000
# Frames are decoded up to 27 m: all hear their neighbours only. The sender A is heard by its receiver B and by X.
A, B, X, Y = range(4)
POSE = at((0, 0), (20, 0), (-15, 0), (-33, 0))
RADIO = with_access("dcf")
DIFS, SIFS, SLOT = 50 * US, 10 * US, 20 * US
DATA_END = DIFS + (192 + 8 * 46) * US  # 10 bytes of payload and 36 of headers at 1 Mbit/s, sent at 0
ACK = (192 + 8 * 14) * US
ACK_END = DATA_END + SIFS + ACK
HANDED_OVER = DATA_END + SIFS // 2  # the second packet is handed over after the data, before the acknowledgement
LOST = replace(RADIO, loss=1.0, access=Access("dcf", max_retries=0))


def second_on_air_ns(radio: Radio, second: int, first_to: int = B) -> int:
    """When the packet that `second` broadcasts goes on air, after A's packet to `first_to`."""
    medium = make_medium(radio, len(POSE))
    medium.step(0, POSE)
    medium.send_at(np.array([0, HANDED_OVER]), packets([A, second], [first_to, BROADCAST]))
    finished = medium.step(TICK_NS, POSE).finished
    on_air_ns = finished.on_air_at_ns[finished.sender == second]
    assert len(set(on_air_ns.tolist())) == 1
    return int(on_air_ns[0])


def test_nav_third_station_waits_for_an_acknowledgement_it_cannot_hear():
    """DIFS and a backoff follow the NAV: the medium was busy when the packet came (IEEE 802.11-2020, 10.3.2.4)."""
    slots = (second_on_air_ns(RADIO, X) - ACK_END - DIFS) / SLOT
    assert slots in range(32)


@pytest.mark.parametrize(
    ("radio", "first_to"), [(RADIO, BROADCAST), (replace(RADIO, access=Access("dcf", acknowledged=False)), B)]
)
def test_nav_is_not_set_by_frames_without_acknowledgement(radio: Radio, first_to: int):
    assert second_on_air_ns(radio, X, first_to) == HANDED_OVER + DIFS


def test_nav_is_not_set_at_the_addressee():
    """B finds the medium idle, then sends its acknowledgement, and needs no backoff after it."""
    assert second_on_air_ns(RADIO, B) == ACK_END + DIFS


def test_nav_is_not_set_by_a_frame_with_errors_but_eifs_follows():
    """EIFS is as long as the NAV at 1 Mbit/s, but the medium was idle when the packet came: no backoff (9.2.3.4)."""
    assert second_on_air_ns(LOST, X) == ACK_END + DIFS


@pytest.mark.parametrize(("ratio", "idle_from_ns"), [(1.0, ACK_END + SIFS), (0.0, ACK_END + SIFS + ACK)])
def test_eifs_follows_an_acknowledgement_with_errors_at_a_third_station(ratio: float, idle_from_ns: int):
    """The last of three hears the acknowledgement of the second to the first, with errors if `ratio` is 0."""
    radio = replace(RADIO, trace=Trace("a.csv", "model"))
    traces = LinkTraces(delivery_ratio=trace_of("delivery_ratio", [(0, 1, 2, ratio)]))
    medium, pose = make_medium(radio, 3, traces=traces), at((0, 0), (20, 0), (40, 0))
    medium.step(0, pose)
    medium.send_at(np.array([0, ACK_END + SIFS]), packets([0, 2], [1, BROADCAST]))
    finished = medium.step(TICK_NS, pose).finished
    assert set(finished.on_air_at_ns[finished.sender == 2].tolist()) == {idle_from_ns + DIFS}
