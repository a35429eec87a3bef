"""What signals do to one another and to noise, against formulas."""

from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.packets import Fate
from swarmwire.comms.radio.config.impairments import Bursts
from swarmwire.comms.radio.config.phy import Fading, Reception, Shadowing
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.reception.error_rates import oqpsk_bit_errors
from tests.support.comms.radio.phy.radios import METHODS, with_access
from tests.support.comms.radio.runs import at, everybody, living, make_medium, packets, run, scattered


@pytest.mark.parametrize("distance_m", [60.0, 95.0, 105.0, 115.0, 120.0])
@pytest.mark.parametrize("method", ["none", "csma-802154"])
def test_delivery_of_802154_over_distance_is_that_of_its_formula(distance_m: float, method: str):
    """2,000 packets each: within 0.02, and four standard errors where that is more (false alarm below 1e-4)."""
    pose = at((-distance_m / 2, 0), (distance_m / 2, 0))
    sent = packets([0] * 20, size=20)
    told = run(make_medium(with_access(method), 2), pose, lambda _: sent, 100, 2)
    snr = 10 ** ((-46.6777 - 30 * np.log10(distance_m) + 106.987) / 10)
    expected = (1 - oqpsk_bit_errors(snr)) ** (8 * 37)
    tolerance = max(0.02, 4 * (expected * (1 - expected) / 2000) ** 0.5)
    assert told.fates().get("RECEIVED", 0) / 2000 == pytest.approx(expected, abs=tolerance)


def test_more_distance_never_helps_on_average():
    """The same draws decide at each distance, so not even by chance."""
    received = [
        run(make_medium(with_access("none"), 2), at((0, 0), (d, 0)), lambda _: packets([0] * 20, size=20), 10, 2)
        .fates()
        .get("RECEIVED", 0)
        for d in np.linspace(80, 140, 13)
    ]
    assert received == sorted(received, reverse=True)
    assert received[0] > received[-1]


def test_strength_is_equal_both_ways_to_the_last_bit():
    radio = replace(with_access("none"), shadowing=Shadowing(), fading=Fading())
    told = run(make_medium(radio, 12), scattered(12) * [20, 20, 1], everybody(12), 1, 1)
    links = {
        (int(s), int(r)): rssi
        for one in told.news
        if one.finished.rssi_dbm is not None
        for s, r, rssi in zip(one.finished.sender, one.finished.receiver, one.finished.rssi_dbm, strict=True)
    }
    both = [pair for pair in links if pair[::-1] in links]
    assert len(both) > 50
    assert all(links[pair] == links[pair[::-1]] for pair in both)


@pytest.mark.parametrize("far_first", [True, False])
def test_of_two_frames_at_once_the_near_one_is_received_as_in_ns_3(far_first: bool):
    """ns-3's lr-wpan-collision-test: senders 1 m and 30 m away, one frame received, whoever has the lower row."""
    senders = ((30, 0), (-1, 0)) if far_first else ((-1, 0), (30, 0))
    told = run(make_medium(with_access("aloha"), 3), at(*senders, (0, 0)), lambda _: packets([0, 1], 2), 1, 1)
    assert told.fates() == {"RECEIVED": 1, "COLLIDED": 1}
    assert told.received("sender").tolist() == [int(far_first)]


def test_two_equal_frames_at_once_are_both_lost_to_a_receiver_without_capture():
    """One of IEEE 802.15.4 has as much, by its spreading: at 0 dB it hears 95 of 100 frames."""
    radio = replace(with_access("aloha"), reception=Reception("threshold", min_sinr_db=3.0))
    told = run(make_medium(radio, 3), at((-1, 0), (1, 0), (0, 0)), lambda _: packets([0, 1], 2), 1, 1)
    assert told.fates() == {"COLLIDED": 2}


def test_who_sends_hears_nothing():
    told = run(make_medium(with_access("aloha"), 2), at((0, 0), (1, 0)), everybody(2), 1, 1)
    assert told.fates() == {"COLLIDED": 2}
    assert run(make_medium(with_access("none"), 2), at((0, 0), (1, 0)), everybody(2), 1, 1).fates() == {"RECEIVED": 2}


def test_carrier_sense_lets_one_after_the_other_send():
    """Three robots hand over two packets each at once, 20 times; of DCF, the first ones collide for certain."""
    received = {}
    for method in METHODS[1:]:
        pose, sent = at((0, 0), (1, 0), (0.5, 1)), packets([0, 1, 2] * 2)
        told = run(make_medium(with_access(method), 3), pose, lambda _, sent=sent: sent, 20, 1)
        received[method] = told.fates().get("RECEIVED", 0) / 240
    assert received["aloha"] == 0.0
    assert received["csma-802154"] > 0.5
    assert 0.3 < received["dcf"] <= 0.5


@pytest.mark.parametrize("load", [0.25, 0.5, 1.0])
def test_throughput_of_aloha_is_that_of_abramson(load: float):
    """S = G exp(-2 G) of pure ALOHA: many equal senders, one listener, no capture.

    4,000 frames, whose losses come in pairs: standard errors of 0.011 at most, so that 0.03 are 2.7 or more (false
    alarm below 1 in 140 for each load).
    """
    senders, ticks = 200, 20
    radio = replace(
        with_access("aloha"),
        send_offset="uniform",
        range_m=300.0,
        bit_rate_bps=int(senders * 10 * 27 * 8 / load),
        reception=Reception("threshold", min_sinr_db=3.0),
    )
    angle = np.linspace(0, 2 * np.pi, senders, endpoint=False)
    pose = np.vstack([np.column_stack([10 * np.cos(angle), 10 * np.sin(angle), angle]), [[0.0, 0.0, 0.0]]])
    told = run(make_medium(radio, senders + 1), pose, lambda _: packets(range(senders), senders), ticks, 1)
    received = told.fates().get("RECEIVED", 0) / (senders * ticks)
    assert received == pytest.approx(np.exp(-2 * load), abs=0.03)


@pytest.mark.parametrize("method", ["csma-802154", "dcf"])
def test_acknowledged_packets_are_sent_again(method: str):
    """Half of all frames, and of all acknowledgements, are lost: hardly a packet is, with three or seven retries."""
    pose, sent = at((0, 0), (1, 0)), packets([0] * 5, 1)
    for acknowledged, least, most in ((True, 0.9, 1.0), (False, 0.4, 0.6)):
        radio = with_access(method)
        radio = replace(radio, loss=0.5, access=replace(radio.access_or_default, acknowledged=acknowledged))
        told = run(make_medium(radio, 2), pose, lambda _: sent, 60, 3)
        assert least <= told.fates()["RECEIVED"] / 300 <= most
        assert told.fates()["RECEIVED"] + told.fates().get("LOST", 0) == 300


def test_a_lone_broadcast_of_802154_goes_on_air_after_whole_backoffs():
    """320 us k + 128 + 192, k from 0 to 7 (IEEE 802.15.4-2006), all of them drawn."""
    told = run(make_medium(with_access("csma-802154"), 2), at((0, 0), (1, 0)), lambda _: packets([0]), 200, 1)
    wait_ns = told.on_air("on_air_at_ns") - told.on_air("sent_at_ns")
    assert sorted(set(((wait_ns - 320_000) / 320_000).tolist())) == list(range(8))


def test_a_lone_frame_of_80211_goes_on_air_after_difs():
    """50 us at 802.11b."""
    told = run(make_medium(with_access("dcf"), 2), at((0, 0), (1, 0)), lambda _: packets([0]), 20, 1)
    assert set((told.on_air("on_air_at_ns") - told.on_air("sent_at_ns")).tolist()) == {50_000}


def test_the_radio_graph_joins_those_whom_a_lone_packet_reaches():
    medium = make_medium(with_access("none"), 3)
    pose = at((0, 0), (90, 0), (230, 0))
    assert medium.step(0, pose).edges.tolist() == [[0, 1]]
    assert medium.step(1, pose, living([True, False, True])).edges.tolist() == []


def test_bursts_take_packets_of_disks_and_signals_alike():
    """Bursts last as long whatever carries them: within 0.05 of the share of bad time."""
    for radio in (Radio(9.0, send_offset="tick"), with_access("none")):
        bursty = replace(radio, bursts=Bursts(0.1, 0.3))
        told = run(make_medium(bursty, 20), scattered(20), everybody(20), 20, 1)
        assert told.tally.fates[0, Fate.BURST] / told.tally.in_range[0] == pytest.approx(0.25, abs=0.05)
