"""Times of sending, airtimes and delays."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, stats

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.draws import derive_key, uniform
from swarmwire.comms.base.ethernet import exchanged, station
from swarmwire.comms.radio.config.impairments import DISTRIBUTIONS, Delays, refuse_negative
from swarmwire.comms.radio.config.phy import Access
from swarmwire.comms.radio.config.radio import Interface, Radio
from swarmwire.comms.radio.phy.packets import frames_of
from swarmwire.comms.radio.records import ReceptionRecords
from swarmwire.comms.radio.send_times import SendTimes
from swarmwire.comms.radio.stages.delays import MAX_NS, delay_distribution, varying_delay_ns
from swarmwire.comms.radio.timing import (
    DSSS_RATES_BPS,
    HT_BITS_PER_SYMBOL,
    IEEE_802_11A,
    IEEE_802_11B,
    IEEE_802_11G,
    IEEE_802_15_4,
    OFDM_BITS_PER_SYMBOL,
    US,
    at_bit_rate_ns,
    ieee80211a_ns,
    ieee80211b_ns,
    ieee80211g_ns,
    ieee80211n_ns,
)
from swarmwire.comms.robot.packets import Fate, Payloads, SentPackets
from tests.support.comms.radio import TICK_NS, at, everybody, make_medium, packets, run, scattered, with_access
from tests.support.refusals import refused_input

PAIR = at((0, 0), (1, 0))
AIRTIME_NS = 320_000  # 10 bytes at 250 kbit/s
OCTETS = st.integers(0, 2304)
DRAWS = uniform(derive_key("delays"), np.arange(20_000), 0, 0, 0)
LAST_DRAW = 1.0 - 2.0**-53
UNITS = st.floats(0.0, LAST_DRAW)


def test_results_of_a_tick_are_received_since_the_last():
    result = run(make_medium(Radio(9.0, latency_s=0.15, jitter_s=0.1), 6), scattered(6), everybody(6), 4, 6)
    assert sum(len(step.received) for step in result.news) == 120
    for tick, step in enumerate(result.news):
        assert (step.received.received_at_ns <= tick * TICK_NS).all()
        assert (step.received.received_at_ns > (tick - 1) * TICK_NS).all()
        assert (step.received.sequence < tick).all()


@pytest.mark.parametrize(("late_ns", "ticks"), [(-1, 1), (0, 1), (1, 2)])
def test_packet_due_exactly_at_a_tick_is_received_in_it(late_ns: int, ticks: int):
    """In float seconds it would slip a tick now and then."""
    latency_s = (TICK_NS - AIRTIME_NS + late_ns) / 1e9
    result = run(make_medium(Radio(9.0, latency_s=latency_s, send_offset="tick"), 2), PAIR, everybody(2), 50, 3)
    received = [len(step.received) for step in result.news]
    assert received == [0] * ticks + [2] * 50 + [0] * (4 - ticks)


@pytest.mark.parametrize(("early_ns", "received"), [(1, [0, 2]), (0, [2, 0]), (-1, [2, 0])])
def test_advance_within_a_tick_receives_a_packet_once(early_ns: int, received: list[int]):
    medium = make_medium(Radio(9.0, latency_s=0.0, send_offset="tick"), 2)
    medium.step(0, PAIR)
    medium.send(0, 0, everybody(2)(0))
    assert [len(medium.advance(AIRTIME_NS + late_ns)[0]) for late_ns in (-early_ns, 10)] == received


def test_send_phase_of_a_slow_robot_spans_its_own_period():
    """Of 200 robots with a period of 4 ticks all are in the same quarter of it by chance in none of 10^100 seeds."""
    every, keys = np.where(np.arange(400) % 2, 4, 1), np.array([1], np.uint64)
    mixed, alone = (SendTimes("uniform", keys, e, 10) for e in (every, np.ones(400, np.int64)))
    sent_at_ns = np.stack([mixed.in_tick(tick * TICK_NS, tick) - tick * TICK_NS for tick in range(0, 40, 4)])
    slow, fast = sent_at_ns[:, 1::2], sent_at_ns[:, ::2]
    assert np.histogram(slow[0], 4, (0, 4.4 * TICK_NS))[0].min() > 20
    assert 0 <= slow.min() < slow.max() < 4.8 * TICK_NS
    assert np.ptp(slow, axis=0).max() < 0.8 * TICK_NS
    assert np.array_equal(fast[3], (alone.in_tick(12 * TICK_NS, 12) - 12 * TICK_NS)[::2])


@pytest.mark.parametrize(
    ("radio", "key"),
    [
        *((Radio(9.0, send_offset=offset), "send_offset") for offset in ("phase", -0.1, float("nan"))),
        (Radio(None), "range_m"),
    ],
)
def test_radio_without_a_send_offset_or_range_is_refused(radio: Radio, key: str):
    with pytest.raises(ValueError, match=f"{key}: expected"):
        make_medium(radio, 2)


def test_geometry_is_that_of_the_tick_on_air():
    """Sent in tick 0, on air in tick 1 (its very start included), near in only one of them."""
    near, far = at((0, 0), (1, 0)), at((0, 0), (3, 0))
    for before, after, send_offset, received in ((near, far, 0.15, 0), (far, near, 0.15, 1), (far, near, 0.1, 1)):
        medium = make_medium(Radio(2.0, send_offset=send_offset), 2)
        medium.step(0, before)
        medium.send(0, 0, packets([0]))
        assert len(medium.step(TICK_NS, after).finished.fate) == 0
        assert len(medium.step(2 * TICK_NS, after).received) == received


def test_time_does_not_run_backwards():
    medium = make_medium(Radio(2.0), 2)
    medium.step(TICK_NS, at((0, 0), (1, 0)))
    for pass_time in (medium.advance, lambda until_ns: medium.step(until_ns, at((0, 0), (1, 0)))):
        with pytest.raises(ValueError, match="until_ns"):
            pass_time(TICK_NS - 1)
    with pytest.raises(ValueError, match="at_ns"):
        medium.send(0, 0, packets([0]))


def test_empty_send_takes_no_sequence_number():
    medium = make_medium(Radio(9.0, send_offset="tick"), 2)
    medium.step(TICK_NS, at((0, 0), (1, 0)))
    medium.send_at(np.zeros(0, np.int64), packets([]))  # long ago: packets would be refused
    with pytest.raises(ValueError):
        medium.send_at(np.zeros(1, np.int64), packets([0]))


@pytest.mark.parametrize(
    ("psdu_octets", "stated_us"), [(5, 352), (11, 544), (20, 832), (31, 1184), (60, 2112), (100, 3392), (127, 4256)]
)
def test_airtime_of_802_15_4_matches_the_standard(psdu_octets: int, stated_us: int):
    assert at_bit_rate_ns(6 + psdu_octets, 250_000) == stated_us * US


@pytest.mark.parametrize(
    ("octets", "rate_bps", "stated_us"),
    [
        *((1023 + i, 11_000_000, 936 + i) for i in range(4)),
        *((1023 + i, 2_000_000, us) for i, us in enumerate((4284, 4288, 4292, 4296))),
        *((1023 + i, 1_000_000, us) for i, us in enumerate((8376, 8384, 8392, 8400))),
        (14, 1_000_000, 304),
        (1536, 11_000_000, 1310),
        (76, 11_000_000, 248),
        (14, 11_000_000, 203),
    ],
)
def test_airtime_of_802_11b_matches_ns3(octets: int, rate_bps: int, stated_us: int):
    assert ieee80211b_ns(octets, rate_bps) == stated_us * US


@pytest.mark.parametrize(("octets", "a_us", "g_us"), [(1536, 248, 254), (76, 32, 38), (14, 24, 30)])
def test_airtime_of_802_11a_and_g_matches_ns3(octets: int, a_us: int, g_us: int):
    assert ieee80211a_ns(octets, 54_000_000) == a_us * US
    assert ieee80211g_ns(octets, 54_000_000) == g_us * US


@pytest.mark.parametrize(("octets", "stated_us"), [(1536, 228), (76, 48), (14, 40), (9094, 1156), (43962, 5448)])
def test_airtime_of_802_11n_matches_ns3(octets: int, stated_us: int):
    """MCS 7 in 20 MHz: ns-3's test of durations, and A-MPDU of 6 and 29 packets of 1472 octets."""
    assert ieee80211n_ns(octets, 65_000_000) == stated_us * US


def test_bits_per_symbol_of_802_11n_are_those_of_52_subcarriers():
    """52 data subcarriers x bits of the constellation x code rate; a symbol takes 4 us."""
    codes = map(Fraction, ("1/2", "1/2", "3/4", "1/2", "3/4", "2/3", "3/4", "5/6"))
    modes = zip((1, 2, 2, 4, 4, 6, 6, 6), codes, strict=True)
    by_rate = {int(52 * bits * code * 250_000): int(52 * bits * code) for bits, code in modes}
    assert by_rate == HT_BITS_PER_SYMBOL


def test_airtime_of_a_hundred_octets_over_udp_matches_the_source():
    """Headers: MAC 24, FCS 4, LLC 8, IP and UDP 28; then DIFS and the mean backoff of a broadcast."""
    octets = 100 + 24 + 4 + 8 + 28
    b_ns, a_ns = ieee80211b_ns(octets, 1_000_000), ieee80211a_ns(octets, 6_000_000)
    assert (b_ns, a_ns, ieee80211g_ns(octets, 6_000_000)) == (1504 * US, 244 * US, 250 * US)
    for airtime_ns, dcf, stated_us in ((b_ns, IEEE_802_11B, 1864), (a_ns, IEEE_802_11A, 345.5)):
        assert airtime_ns + dcf.difs_ns + dcf.cw_min * dcf.slot_ns / 2 == stated_us * US


@given(OCTETS, st.integers(1, 10**10))
def test_airtimes_are_whole_bits_and_symbols_rounded_up(octets: int, bit_rate_bps: int):
    """By exact fractions."""
    assert at_bit_rate_ns(octets, bit_rate_bps) == math.ceil(Fraction(8 * octets * 10**9, bit_rate_bps))
    for rate_bps in DSSS_RATES_BPS:
        payload_us = math.ceil(Fraction(8 * octets * 10**6, rate_bps))
        assert ieee80211b_ns(octets, rate_bps) == (192 + payload_us) * US
    for rate_bps in OFDM_BITS_PER_SYMBOL:
        symbols = math.ceil(Fraction(16 + 8 * octets + 6, 4 * rate_bps // 10**6))  # service field, PSDU, tail
        assert ieee80211a_ns(octets, rate_bps) == (16 + 4 + 4 * symbols) * US
        assert ieee80211g_ns(octets, rate_bps) == ieee80211a_ns(octets, rate_bps) + 6 * US


def test_airtimes_of_arrays_equal_those_of_elements():
    octets = np.array([0, 14, 76, 1536])
    for airtime_ns in (
        lambda n: at_bit_rate_ns(n, 9600),
        lambda n: ieee80211b_ns(n, 5_500_000),
        lambda n: ieee80211g_ns(n, 54_000_000),
    ):
        times_ns = airtime_ns(octets)
        assert times_ns.dtype == np.int64
        assert times_ns.tolist() == [airtime_ns(int(n)) for n in octets]


def test_timing_of_802_15_4_is_counted_in_symbols():
    """62 500 a second. For an acknowledgement: backoff, turnaround, 10 of the header and 12 of the frame."""
    timing = IEEE_802_15_4
    assert timing.symbol_ns * 62_500 == 10**9
    stated = {"backoff_ns": 20, "cca_ns": 8, "turnaround_ns": 12, "sifs_ns": 12, "lifs_ns": 40}
    for name, symbols in stated.items():
        assert getattr(timing, name) == symbols * timing.symbol_ns, name
    assert timing.ack_wait_ns == (20 + 12 + 10 + 12) * timing.symbol_ns
    assert timing.ifs_ns(np.array([18, 19])).tolist() == [192 * US, 640 * US]
    frames = frames_of(with_access("csma-802154"))  # with the 6 bytes on air before those that count
    octets = (frames.bits // 8).tolist()
    assert [int(frames.ifs_ns[octets.index(6 + n)]) for n in (18, 19)] == [192 * US, 640 * US]


@pytest.mark.parametrize(
    ("dcf", "difs_us", "window"), [(IEEE_802_11B, 50, 31), (IEEE_802_11A, 34, 15), (IEEE_802_11G, 50, 15)]
)
def test_timing_of_802_11_has_difs_and_window(dcf, difs_us: int, window: int):
    assert dcf.difs_ns == difs_us * US
    assert (dcf.cw_min, dcf.cw_max) == (window, 1023)


def law_of(distribution: str, mean_s: float = 0.02, deviation_s: float = 0.008):
    delays = Delays(distribution, mean_s, deviation_s)
    refuse_negative(delays, "a.toml", "radio.delay")
    return delay_distribution(delays)


def reference(distribution: str, mean_s: float, deviation_s: float):
    """The same law, with scipy's own parameters."""
    if distribution == "uniform":
        half_s = np.sqrt(3.0) * deviation_s
        return stats.uniform(mean_s - half_s, 2.0 * half_s)
    if distribution == "normal":
        return stats.truncnorm(-mean_s / deviation_s, np.inf, mean_s, deviation_s)
    if distribution == "lognormal":
        sigma2 = np.log(1.0 + (deviation_s / mean_s) ** 2)
        return stats.lognorm(np.sqrt(sigma2), scale=mean_s * np.exp(-0.5 * sigma2))
    shape = 1.0 + np.sqrt(1.0 + (mean_s / deviation_s) ** 2)
    return stats.pareto(shape, scale=mean_s * (shape - 1.0) / shape)


@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
@pytest.mark.parametrize(("mean_s", "deviation_s"), [(0.02, 0.008), (0.5, 0.001), (0.01, 0.005)])
def test_delays_are_quantiles_of_their_distribution(distribution: str, mean_s: float, deviation_s: float):
    law, expected = law_of(distribution, mean_s, deviation_s), reference(distribution, mean_s, deviation_s)
    for u in (1e-9, 0.001, 0.1, 0.5, 0.9, 0.999, 1.0 - 1e-9):
        # Rounded down to whole ns; scipy's truncated normal has ten digits or so.
        assert varying_delay_ns(law, u) == pytest.approx(expected.ppf(u) * NS_PER_S, rel=1e-9, abs=1.01)


@pytest.mark.parametrize(("distribution", "tolerance"), [("uniform", 1e-6), ("lognormal", 1e-5), ("pareto", 1e-3)])
def test_delays_have_the_configured_mean_and_deviation(distribution: str, tolerance: float):
    """Integrated over the draw; a Pareto's second moment converges slowly."""
    law = law_of(distribution)
    moments = [
        integrate.quad(lambda t, n=n: (varying_delay_ns(law, 1.0 - np.exp(-t)) * 1e-9) ** n * np.exp(-t), 0.0, 36.0)[0]
        for n in (1, 2)
    ]
    assert moments[0] == pytest.approx(0.02, rel=tolerance)
    assert np.sqrt(moments[1] - moments[0] ** 2) == pytest.approx(0.008, rel=10 * tolerance)


def test_delays_of_a_normal_law_are_never_negative():
    near, far = law_of("normal", 0.01, 0.02), law_of("normal", 0.02, 0.002)
    delays_ns = np.array([varying_delay_ns(near, u) for u in DRAWS])
    assert delays_ns.min() >= 0
    assert delays_ns.mean() > 0.015 * NS_PER_S
    far_ns = np.array([varying_delay_ns(far, u) for u in DRAWS])
    assert abs(far_ns.mean() / NS_PER_S - 0.02) < 4.4 * 0.002 / np.sqrt(len(DRAWS))


@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
@given(UNITS, UNITS)
def test_delays_never_fall_with_the_draw(distribution: str, first: float, other: float):
    law = law_of(distribution)
    assert 0 <= varying_delay_ns(law, min(first, other)) <= varying_delay_ns(law, max(first, other))


@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
@pytest.mark.parametrize(("mean_s", "deviation_s"), [(1e-6, 5e-7), (3600.0, 2000.0)])
def test_delays_of_the_last_draw_are_finite_integers(distribution: str, mean_s: float, deviation_s: float):
    law = law_of(distribution, mean_s, deviation_s)
    for u in (0.0, LAST_DRAW):
        assert isinstance(varying_delay_ns(law, u), int)
        assert 0 <= varying_delay_ns(law, u) <= MAX_NS


def test_uniform_delay_that_would_be_negative_is_refused():
    with refused_input("a.toml", "radio.delay.deviation_s"):
        law_of("uniform", 0.01, 0.006)
    assert varying_delay_ns(law_of("uniform", 0.01, 0.005), 0.5) == pytest.approx(0.01 * NS_PER_S, abs=1)


def interface_radio(frame: str, model: str) -> Radio:
    """A radio with a network interface that carries IP packets of up to 1500 bytes."""
    overhead, most = (64, 1472) if frame == "802.11a" else (0, 1514)
    return Radio(
        range_m=5.0,
        model=model,
        frame=frame,
        bit_rate_bps=6_000_000,
        overhead_bytes=overhead,
        max_payload_bytes=most,
        interface=Interface(),
        access=None if model == "unit-disk" else Access("none"),
    )


def finished_frames(radio: Radio, *packet_bytes: int) -> ReceptionRecords:
    """What becomes of frames with IP packets of these sizes."""
    medium = make_medium(radio, 2)
    medium.step(0, PAIR)
    for size in packet_bytes:
        frame = Payloads.from_row(exchanged(station(1) + station(0) + b"\x08\x00" + bytes(size)))
        medium.send_at(np.zeros(1, np.int64), SentPackets(np.array([0]), np.array([1]), frame))
    return medium.step(TICK_NS, PAIR).finished


@pytest.mark.parametrize("model", ["unit-disk", "log-distance"])
@pytest.mark.parametrize(("frame", "headers"), [("802.11a", 24 + 8 + 4), ("plain", 14)])
@pytest.mark.parametrize("packet_bytes", [28, 500, 1500])
def test_interface_frame_takes_the_airtime_of_its_standard(model, frame, headers, packet_bytes):
    """802.11: MAC header, LLC with SNAP, FCS (IEEE 802.11-2007, 7.1.3); other radios carry the Ethernet header."""
    finished = finished_frames(interface_radio(frame, model), packet_bytes)
    airtime = ieee80211a_ns if frame == "802.11a" else at_bit_rate_ns
    assert finished.final_at_ns[0] - finished.on_air_at_ns[0] == airtime(headers + packet_bytes, 6_000_000)
    assert finished.size_bytes[0] == 14 + packet_bytes


@pytest.mark.parametrize("frame", ["802.11a", "plain"])
def test_interface_frame_above_the_mtu_is_too_large(frame):
    radio = interface_radio(frame, "unit-disk")
    assert radio.mtu_bytes == 1500
    assert sorted(finished_frames(radio, 1500, 1501).fate.tolist()) == [Fate.RECEIVED, Fate.TOO_LARGE]
