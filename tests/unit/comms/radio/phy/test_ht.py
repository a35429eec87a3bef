"""IEEE 802.11n: airtimes, frame exchanges (A-MPDU, block acknowledgements, RTS, CTS, NAV), and rate control."""

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.radio.config.checks import check_radio
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.robot.packets import Fate, SentPackets, TxResult
from tests.support.comms.radio import TICK_NS, Run, at, living, make_medium, packets, run, run_disrupted
from tests.support.refusals import refused_input
from tests.unit.world.scenario.test_bodies import radio_of

PAIR, FAR_THIRD = at((0, 0), (1, 0)), at((0, 0), (1, 0), (900, 0))
AIFS, SIFS, SLOT = 43, 16, 9  # us, at 5 GHz
RTS, CTS, BLOCK_ACK = 52, 44, 32  # us: 20 and 14 bytes at 6 Mbit/s, 32 at 24


def radio_n(access: dict[str, Any] | None = None, **others: Any) -> Radio:
    """A radio at 65 Mbit/s, with 38 bytes of headers."""
    return radio_of(
        {"preset": "wifi-n-5G", "overhead_bytes": 38, "send_offset": "tick", "access": access or {}, **others}
    )


def ht_us(octets: int, symbol_bits: int = 260) -> int:
    """Airtime of a PSDU: preamble, service and tail bits, symbols (802.11n-2009, 20.4.3)."""
    return 36 + 4 * -(-(22 + 8 * octets) // symbol_bits)


def received_us(result: Run, sender: int = 0) -> list[int]:
    is_sender = result.received("sender_index") == sender
    return (result.received("received_at_ns")[is_sender] // 1000).tolist()


def burst(size: int, count: int, sender: int = 0, to: int = 1) -> SentPackets:
    return packets([sender] * count, to, size)


def at_start(sent: SentPackets, later: SentPackets | None = None) -> Any:
    return lambda tick: sent if tick == 0 else later or packets([])


def test_ampdu_of_six_packets_is_received_at_its_end():
    """Subframes of 4 + 1510 bytes, all but the last padded to 1516: 9094 bytes."""
    result = run(make_medium(radio_n(), 2), PAIR, at_start(burst(1472, 6)), 1, 3)
    assert ht_us(9094) == 1156
    at_us = received_us(result)
    assert len(at_us) == 6
    assert at_us == [at_us[0]] * 6
    assert 1156 <= at_us[0] < SLOT + 1156  # an idle medium is free from the next slot on


@pytest.mark.parametrize(
    ("access", "size", "counts"),
    [
        # 29 subframes of 1516 bytes take 5448 us, and 30 more than 5484; 64 is the window of a block acknowledgement.
        ({}, 1472, [29, 29, 12]),
        ({}, 100, [64, 6]),
        ({"aggregation_bytes": 4000}, 1472, [2] * 35),
        ({"aggregation_bytes": 0}, 1472, [1] * 70),
    ],
)
def test_ampdu_has_limits_of_time_window_and_size(access: dict[str, Any], size: int, counts: list[int]):
    result = run(make_medium(radio_n(access), 2), PAIR, at_start(burst(size, 70)), 1, 3)
    assert list(Counter(received_us(result)).values()) == counts


def test_ampdus_follow_after_block_acknowledgement_aifs_and_backoff():
    result = run(make_medium(radio_n(), 2), PAIR, at_start(burst(1472, 290)), 1, 3)
    ends = np.unique(received_us(result))
    slots = (np.diff(ends) - (SIFS + BLOCK_ACK + AIFS + 5448)) / SLOT
    assert len(ends) == 10
    assert (slots == slots.round()).all()
    assert slots.min() >= 0
    assert 0 < slots.max() <= 15


@pytest.mark.parametrize(("threshold", "is_reserved"), [(138, False), (137, True)])
def test_rts_and_cts_precede_frames_beyond_the_threshold(threshold: int, is_reserved: bool):
    """A packet of 100 bytes makes a frame of 138."""
    radio = radio_n({"rts_threshold_bytes": threshold})
    result = run(make_medium(radio, 2), PAIR, at_start(burst(100, 1)), 1, 3)
    reservation = RTS + SIFS + CTS + SIFS if is_reserved else 0
    (at_us,) = received_us(result)
    assert 0 <= at_us - (reservation + ht_us(138)) < SLOT


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
    radio = radio_n(preset=name, overhead_bytes=66, bit_rate_bps=round(1e6 * mbps))
    result = run(make_medium(radio, 2), PAIR, lambda _: packets([0], to, size=100), 1, 3)
    assert result.fates() == {"RECEIVED": 1}
    (at_ns,) = result.received("received_at_ns").tolist()
    assert 0 <= at_ns - 1000 * us < (9_000 if name == "wifi-n-5G" else 20_000)


def test_80211n_bit_rate_may_change_during_a_run():
    """From the second tick on MCS 0 in place of MCS 7."""
    radio = radio_n()
    slow = replace(radio, bit_rate_bps=6_500_000)
    out = run(make_medium(radio, 2), PAIR, lambda _: packets([0], 1, 100), 2, radios={1: slow})
    airtime_us = (out.departed("off_air_at_ns") - out.departed("on_air_at_ns")) // 1000
    assert airtime_us.tolist() == [ht_us(138), ht_us(138, 26)]


def exact(loss: float, seed: int = 3) -> Run:
    sent = replace(burst(200, 60), tx_status_id=np.arange(60))
    radio = radio_n(loss=loss, queue_lifetime_s=10.0, bit_rate_bps=13_000_000)
    return run(make_medium(radio, 2, [seed]), PAIR, at_start(sent), 1, 8)


def test_lost_packets_of_an_ampdu_are_sent_again_and_received_in_order():
    """Each packet, and each block acknowledgement, is lost with 0.3; every packet arrives, once."""
    result = exact(0.3)
    sequence, at_ns = result.received("sequence"), result.received("received_at_ns")
    assert sequence[np.argsort(at_ns, kind="stable")].tolist() == list(range(60))
    assert len(np.unique(at_ns)) > 2
    results = np.concatenate([step.tx_status.result for step in result.news])
    assert results.tolist() == [int(TxResult.ACKNOWLEDGED)] * 60


def test_packets_of_an_ampdu_are_lost_independently():
    """Of 60 packets in one frame, 60 x 0.7 +- 3 deviations arrive; those behind the first lost one wait for it."""
    seeds = range(20)
    medium = make_medium(radio_n({"max_retries": 0}, loss=0.3), 2, seeds)
    sent = packets([2 * seed for seed in seeds for _ in range(60)], 1, 50)
    result = run(medium, np.tile(PAIR, (20, 1)), at_start(sent), 1, 8)
    mean = result.tally.fates[:, Fate.RECEIVED].mean() / 60.0
    assert abs(mean - 0.7) < 3.0 * np.sqrt(0.3 * 0.7 / 1200.0)
    assert len(np.unique(result.tally.fates[:, Fate.RECEIVED])) > 3


def test_packet_to_a_robot_out_of_reach_is_retried_until_its_lifetime_ends():
    sent = replace(burst(100, 1), tx_status_id=np.array([7]))
    result = run(make_medium(radio_n(), 2), at((0, 0), (900, 0)), at_start(sent), 1, 9)
    ended = [tick for tick, step in enumerate(result.news) if len(step.tx_status)]
    assert ended == [6]  # 0.5 s, then the next access
    assert result.fates() == {"OUT_OF_RANGE": 1}


def test_packets_to_a_robot_out_of_reach_do_not_stop_those_to_others():
    """Each tick has packets to either robot and a broadcast; requests end with the retries of what they ask for."""
    radio = radio_n({"max_retries": 7})
    sent = packets([0] * 5, [1, 2, BROADCAST, 1, 2], 100)
    result = run(make_medium(radio, 3), FAR_THIRD, lambda _: sent, 12, 15)
    assert result.fates() == {"RECEIVED": 36, "OUT_OF_RANGE": 36}
    assert result.received("receiver").tolist() == [1] * 36


def hidden(access: dict[str, Any]) -> Run:
    """Two stations that do not hear one another fill the queue with packets to one between them, at 6.5 Mbit/s."""
    radio = radio_n({"aggregation_bytes": 0, **access}, bit_rate_bps=6_500_000)
    pose = at((-41, 0), (0, 0), (41, 0))
    return run(make_medium(radio, 3), pose, lambda _: packets([0, 2] * 60, 1, 1400), 4)


def test_rts_and_cts_protect_hidden_stations_from_one_another():
    """A packet takes 1.8 ms; without reservation frames of hidden stations overlap most of the time."""
    bare, reserved = (len(hidden(access).received("sequence")) for access in ({}, {"rts_threshold_bytes": 0}))
    assert reserved > 0.75 * 0.3e6 / 1800
    assert bare < 0.6 * reserved


def bianchi_mbps(stations: int, frame_us: int, response_us: int, payload_bytes: int) -> float:
    """Throughput of stations that always send (G. Bianchi, IEEE JSAC 18, 2000): CWmin 15, six doublings."""
    low, high, tau = 0.0, 1.0, 0.5
    for _ in range(60):
        tau = 0.5 * (low + high)
        p = 1.0 - (1.0 - tau) ** (stations - 1)
        is_above = 2 / (17 + 16 * p * sum((2 * p) ** doubling for doubling in range(6))) > tau
        low, high = (tau, high) if is_above else (low, tau)
    idle, one = (1.0 - tau) ** stations, stations * tau * (1.0 - tau) ** (stations - 1)
    success_us, collision_us = frame_us + SIFS + response_us + AIFS, frame_us + AIFS
    return 8 * payload_bytes * one / (idle * SLOT + one * success_us + (1.0 - idle - one) * collision_us)


@pytest.mark.parametrize("stations", [2, 5, 10])
def test_saturated_stations_share_the_throughput_of_bianchi(stations: int):
    """Single frames; 0.9 s hold about 2,200 of them, so that 6 % are three deviations and the model's own 2 %."""
    pose = at(*((0.05 * index, 0.0) for index in range(stations)))
    senders = np.repeat(np.arange(stations), 300 // stations + 50)
    sent = packets(senders, (senders + 1) % stations, 1472)
    result = run(make_medium(radio_n({"aggregation_bytes": 0}), stations), pose, lambda _: sent, 10)
    mbps = 8 * 1472 * np.count_nonzero(np.array(result.received("received_at_ns")) > 100_000_000) / 0.9e6
    assert mbps == pytest.approx(bianchi_mbps(stations, ht_us(1510), 28, 1472), rel=0.06)


def test_nav_of_an_unanswered_rts_is_reset():
    """A station that decodes an RTS, but neither CTS nor data, waits for 2 SIFS, CTS, 20 us and 2 slots, then AIFS.

    The RTS announces a frame of 20 packets, which would take 3.5 ms.
    """
    medium = make_medium(radio_n({"rts_threshold_bytes": 1000}), 3)
    result = Run(medium, [medium.step(0, FAR_THIRD)])
    medium.send_at(np.zeros(20, np.int64), burst(1400, 20, 0, 2))
    medium.send_at(np.array([30_000]), burst(50, 1, 1, 0))  # during the RTS
    result.news.append(medium.step(TICK_NS, FAR_THIRD))
    reset = 2 * SIFS + CTS + 20 + 2 * SLOT
    (at_us,) = received_us(result, 1)
    assert RTS + reset + AIFS + ht_us(88) <= at_us < 3000


def test_frame_of_a_sender_that_dies_is_received_but_its_queue_ends():
    sent = {0: burst(1400, 300)}
    dead = {1: living([False, True])}
    result = run_disrupted(make_medium(radio_n(bit_rate_bps=6_500_000), 2), PAIR, sent, dead, 4)
    fates = result.fates()
    assert fates["RECEIVED"] + fates["SENDER_DEAD"] == 300
    assert max(received_us(result)) > 100_000  # the frame on air


def test_802_11n_requires_dcf():
    radio = radio_n()
    with refused_input(key="radio.access.method"):
        check_radio(replace(radio, access=replace(radio.access_or_default, method="aloha")), "a.toml")


# Rate control: ideal and AARF.


SYMBOL_BITS = (26, 52, 78, 104, 156, 208, 234, 260)  # by MCS
NOISE_DBM, POWER_DBM, LOSS_DB = -93.965, 16.0, 40.0  # 20 MHz at 290 K and 7 dB; log-distance, exponent 2
# ns-3's thresholds of IdealWifiManager for its table-based error rates, in dB, by MCS.
IDEAL_DB = (1.465, 4.475, 6.985, 10.375, 13.465, 17.865, 19.125, 20.775)


def rates(result: Run) -> list[int]:
    """The MCS of each packet of 1000 bytes, by its airtime."""
    by_us = {ht_us(1066, bits): mcs for mcs, bits in enumerate(SYMBOL_BITS)}
    airtime_us = (result.departed("off_air_at_ns") - result.departed("on_air_at_ns")) // 1000
    order = np.argsort(result.departed("on_air_at_ns"))
    return [by_us[us] for us in airtime_us[order].tolist()]


def one_a_tick(rate_control: str, sinr_db: float, ticks: int, **others: Any) -> list[int]:
    """The MCS of one packet in each tick between two robots with this SINR."""
    loss = {"exponent": 2.0, "reference_loss_db": LOSS_DB}
    radio = radio_n({"rate_control": rate_control}, overhead_bytes=66, log_distance=loss, **others)
    pose = at((0, 0), (10.0 ** ((POWER_DBM - LOSS_DB - NOISE_DBM - sinr_db) / 20.0), 0))
    return rates(run(make_medium(radio, 2), pose, lambda _: packets([0], 1, 1000), ticks, 2))


@pytest.mark.parametrize("mcs", [4, 5, 6, 7])
def test_ideal_takes_the_highest_rate_for_the_reported_sinr(mcs: int):
    """The first packet has MCS 0, since its receiver has not reported yet; preambles need -82 dBm, 12 dB."""
    above_db = IDEAL_DB[mcs + 1] if mcs < 7 else IDEAL_DB[7] + 3.0
    assert one_a_tick("ideal", 0.5 * (IDEAL_DB[mcs] + above_db), 4) == [0, mcs, mcs, mcs]


@pytest.mark.parametrize("rate_control", ["ideal", "aarf"])
def test_rate_control_exceeds_no_highest_rate(rate_control: str):
    assert max(one_a_tick(rate_control, 40.0, 35, bit_rate_bps=19_500_000)) == 2


def test_aarf_rises_after_ten_successes_and_falls_back_after_a_failed_probe():
    """At 15 dB MCS 4 passes and MCS 5 fails: a failed probe falls back, and the next rise needs 20 successes."""
    result = one_a_tick("aarf", 15.0, 85)
    # A packet whose first attempt failed is seen at the rate of its last one.
    assert result[:50] == [0] * 10 + [1] * 10 + [2] * 10 + [3] * 10 + [4] * 10
    assert max(result) == 4
