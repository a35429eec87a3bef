"""Receivers and packet error rates."""

import math
from decimal import Decimal, getcontext
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, special

from swarmwire.comms.radio.config.phy import (
    ReceiverNoise,
    Reception,
    SuccessTable,
    noise_dbm,
    refuse_unfit,
    refuse_unless_rising,
)
from swarmwire.comms.radio.propagation.decibels import from_db, to_db
from swarmwire.comms.radio.reception import error_rates
from swarmwire.comms.radio.reception.receiver import (
    MAX_DB,
    MIN_DB,
    Model,
    by_table,
    by_threshold,
    chunk_success,
    gazebo,
    ieee80211ag,
    ieee80211b,
    ieee802154,
    receiver_of,
    sensitivity_dbm,
    sinr_for_db,
)
from swarmwire.comms.radio.timing import DSSS_RATES_BPS
from tests.support.refusals import refused_input

THRESHOLD = by_threshold(4.0)
BY_BITS = (
    by_table(SuccessTable((-1.0, 0.0, 3.0), (0.0, 0.2, 1.0), 1000)),
    ieee802154(),
    *(ieee80211b(rate_bps) for rate_bps in DSSS_RATES_BPS),
    *(ieee80211ag(rate_bps) for rate_bps in error_rates.OFDM_RATES_BPS),
    *(ieee80211ag(rate_bps, Model.NIST) for rate_bps in error_rates.OFDM_RATES_BPS),
    gazebo(),
)
MEASURED = SuccessTable((-94.0, -93.0, -90.0), (0.4, 0.6, 0.86), 800)
NS3_BOLTZMANN_DB = 10.0 * math.log10(1.3803e-23 / 1.380649e-23)
TABLE = SuccessTable((0.0, 6.0), (0.0, 1.0), 800)
getcontext().prec = 60
PI = Decimal("3.14159265358979323846264338327950288419716939937510582097494")
EXACT = 1e-12
FRAME_BITS = 2000 * 8  # of ns-3's test
DSSS_FRAME_BITS, NOISE_DBM = (1024 + 40 + 14) * 8, -93.5522786  # of ns-3's test


def test_threshold_receiver_decodes_from_its_sinr_on():
    assert [chunk_success(THRESHOLD, from_db(db), 10_000) for db in (3.9, 4.0, 4.1)] == [0.0, 1.0, 1.0]


@pytest.mark.parametrize("receiver", [THRESHOLD, *BY_BITS])
@given(st.floats(-40.0, 50.0), st.floats(-40.0, 50.0), st.integers(0, 20_000))
def test_success_never_falls_with_sinr(receiver, one_db: float, other_db: float, bits: int):
    weak, strong = (chunk_success(receiver, from_db(db), bits) for db in sorted((one_db, other_db)))
    assert weak <= strong + 1e-12
    assert weak >= 0.0
    assert strong <= 1.0


@pytest.mark.parametrize("receiver", BY_BITS)
@given(st.floats(-10.0, 30.0), st.floats(0.0, 20_000.0), st.floats(0.0, 20_000.0))
def test_success_of_chunks_multiplies(receiver, sinr_db: float, one_bits: float, other_bits: float):
    sinr = from_db(sinr_db)
    product = chunk_success(receiver, sinr, one_bits) * chunk_success(receiver, sinr, other_bits)
    assert product == pytest.approx(chunk_success(receiver, sinr, one_bits + other_bits), rel=1e-9, abs=1e-300)


@pytest.mark.parametrize("receiver", BY_BITS)
def test_success_of_no_bits_is_one_and_without_signal_zero(receiver):
    assert chunk_success(receiver, 0.0, 0) == 1.0
    assert chunk_success(receiver, 0.0, 1000) < 1e-6
    assert chunk_success(receiver, 1e6, 10_000) == 1.0


@given(st.floats(1e-18, 0.4), st.integers(1, 20_000))
def test_success_keeps_the_digits_of_rare_errors(error_rate: float, bits: int):
    assert error_rates.all_right(error_rate, bits) == pytest.approx(
        float((1 - Decimal(error_rate)) ** bits), rel=1e-11, abs=1e-300
    )


@given(st.floats(-200.0, 200.0))
def test_decibels_and_ratios_are_inverse(db: float):
    assert to_db(from_db(db)) == pytest.approx(db, rel=1e-13, abs=1e-13)
    assert (to_db(0.0), from_db(-math.inf)) == (-math.inf, 0.0)


def test_success_table_interpolates_and_holds_its_ends():
    receiver = by_table(MEASURED)
    for sinr_db, success in ((-94, 0.4), (-93.5, 0.5), (-93, 0.6), (-91.5, 0.73), (-90, 0.86), (-200, 0.4), (50, 0.86)):
        assert chunk_success(receiver, from_db(sinr_db), 800) == pytest.approx(success, rel=1e-12)
    assert chunk_success(receiver, 0.0, 800) == 0.4
    assert chunk_success(receiver, from_db(-93.5), 1600) == pytest.approx(0.25, rel=1e-12)


@pytest.mark.parametrize(
    ("sinr_db", "success", "key"),
    [
        ((0.0, 1.0, 1.0), (0.1, 0.2, 0.3), "sinr_db"),
        ((0.0, 2.0, 1.0), (0.1, 0.2, 0.3), "sinr_db"),
        ((0.0, 1.0, 2.0), (0.1, 0.3, 0.2), "success"),
        ((0.0, 1.0), (0.1, 1.1), "success"),
        ((0.0, 1.0), (-0.1, 1.0), "success"),
        ((0.0, 1.0), (0.1,), "success"),
        ((0.0,), (0.1,), "success"),
        ((0.0, math.nan), (0.1, 0.2), "sinr_db"),
    ],
)
def test_success_table_that_does_not_rise_is_refused(sinr_db, success, key: str):
    refuse_unless_rising(MEASURED, "a.toml", "radio.reception")
    with refused_input(key=f"radio.reception.{key}"):
        refuse_unless_rising(SuccessTable(sinr_db, success, 100), "a.toml", "radio.reception")


@pytest.mark.parametrize(("bandwidth_hz", "stated_dbm"), [(1.0, -173.975), (1e6, -113.975), (2e6, -110.965)])
def test_thermal_noise_is_k_t_b(bandwidth_hz: float, stated_dbm: float):
    assert noise_dbm(bandwidth_hz) == pytest.approx(stated_dbm, abs=5e-4)
    assert noise_dbm(bandwidth_hz, 7.0) == pytest.approx(noise_dbm(bandwidth_hz) + 7.0, rel=1e-15)


@pytest.mark.parametrize(("bandwidth_hz", "stated_dbm"), [(5e6, -106.987), (20e6, -100.966), (22e6, -100.552)])
def test_thermal_noise_matches_ns3_but_for_boltzmann(bandwidth_hz: float, stated_dbm: float):
    """It has 1.3803e-23 J/K, which is 0.0011 dB less."""
    assert noise_dbm(bandwidth_hz) + NS3_BOLTZMANN_DB == pytest.approx(stated_dbm, abs=6e-4)


@given(st.floats(1e3, 1e9), st.floats(0.0, 40.0))
def test_thermal_noise_is_exact(bandwidth_hz: float, figure_db: float):
    milliwatts = 1000 * Decimal("1.380649e-23") * Decimal(290) * Decimal(bandwidth_hz)
    expected = float(10 * milliwatts.log10() + Decimal(figure_db))
    assert noise_dbm(bandwidth_hz, figure_db) == pytest.approx(expected, rel=1e-12, abs=1e-12)
    assert ReceiverNoise(bandwidth_hz, figure_db).power_dbm == noise_dbm(bandwidth_hz, figure_db)


def test_sensitivity_of_802_15_4_matches_ns3():
    assert sinr_for_db(ieee802154(), 0.99, 20 * 8) == pytest.approx(0.4035, abs=5e-4)
    assert sensitivity_dbm(ieee802154(), -106.987, 0.99, 20 * 8) == pytest.approx(-106.583, abs=1e-3)


def test_sensitivity_is_where_frames_begin_to_get_through():
    receiver = ieee80211ag(24_000_000)
    sinr_db = sinr_for_db(receiver, 0.9, 8000)
    assert chunk_success(receiver, from_db(sinr_db), 8000) == pytest.approx(0.9, rel=1e-9)


def test_sensitivity_of_constant_success_is_at_the_ends():
    flat = by_table(SuccessTable((0.0, 1.0), (0.5, 0.5), 8))
    assert sinr_for_db(flat, 0.4, 8) == pytest.approx(MIN_DB)
    assert sinr_for_db(flat, 0.6, 8) == MAX_DB


@pytest.mark.parametrize(
    ("reception", "bit_rate_bps", "expected"),
    [
        (Reception(), 250_000, ieee802154()),
        (Reception("threshold", min_sinr_db=3.0), 1, by_threshold(3.0)),
        (Reception("table", table=TABLE), 1, by_table(TABLE)),
        *((Reception("802.11b"), rate_bps, ieee80211b(rate_bps)) for rate_bps in DSSS_RATES_BPS),
        *((Reception("802.11ag"), rate_bps, ieee80211ag(rate_bps)) for rate_bps in error_rates.OFDM_RATES_BPS),
        (Reception("802.11ag-nist"), 6_000_000, ieee80211ag(6_000_000, Model.NIST)),
        (Reception("gazebo"), 1, gazebo()),
    ],
)
def test_receiver_is_chosen_by_name(reception: Reception, bit_rate_bps: int, expected):
    refuse_unfit(reception, bit_rate_bps, "a.toml", "radio.reception")
    receiver = receiver_of(reception, bit_rate_bps)
    assert receiver[:4] == expected[:4]
    for sinr in (0.1, 1.0, 1.99, 2.0, 3.0, 10.0, 100.0):
        assert chunk_success(receiver, sinr, 400) == chunk_success(expected, sinr, 400)


@pytest.mark.parametrize(
    ("reception", "key"),
    [
        (Reception("table"), "radio.reception.table"),
        (Reception("table", table=SuccessTable((1.0, 0.0), (0.0, 1.0), 8)), "radio.reception.table.sinr_db"),
        (Reception("802.11b"), "radio.reception.model"),
        (Reception("802.11ag"), "radio.reception.model"),
        (Reception("802.11ag-nist"), "radio.reception.model"),
    ],
)
def test_receiver_with_an_unfit_bit_rate_or_table_is_refused(reception: Reception, key: str):
    with refused_input(key=key):
        refuse_unfit(reception, 250_000, "a.toml", "radio.reception")


def erfc(x: Decimal) -> Decimal:
    """1 - 2 / sqrt(pi) sum of (-1)^n x^(2n+1) / (n! (2n+1)); its terms reach 10^14 for x = 6, of 60 digits."""
    term, total, n = x, x, 0
    while abs(term) > Decimal("1e-55"):
        n += 1
        term *= -x * x / n
        total += term / (2 * n + 1)
    return 1 - 2 / PI.sqrt() * total


@pytest.mark.parametrize("points", [2, 4, 16, 64])
@pytest.mark.parametrize("sinr", [0.0, 0.01, 0.5, 2.0, 7.5, 20.0])
def test_raw_errors_by_modulation_are_exact(points: int, sinr: float):
    """Evaluated apart with 60 digits: erfc(sqrt(s)) of BPSK, and so on."""
    s = Decimal(sinr)
    if points <= 4:
        expected = erfc((s if points == 2 else s / 2).sqrt()) / 2
    else:
        side = math.isqrt(points)
        bits = side.bit_length() - 1  # log2 of the side
        expected = Decimal(side - 1) / (side * bits) * erfc((3 * s / (2 * (points - 1))).sqrt())
    assert error_rates.raw_bit_errors(points, sinr) == pytest.approx(float(expected), rel=EXACT)


@pytest.mark.parametrize("rate", range(8))
@pytest.mark.parametrize("sinr_db", [3.0, 6.0, 10.0, 15.0, 20.0, 24.0])
def test_hard_decisions_of_802_11ag_have_chernoffs_bound(rate: int, sinr_db: float):
    sinr = from_db(sinr_db)
    points = (2, 2, 4, 4, 16, 16, 64, 64)[rate]
    raw = {
        2: 0.5 * special.erfc(np.sqrt(sinr)),
        4: 0.5 * special.erfc(np.sqrt(sinr / 2.0)),
        16: 3.0 / 8.0 * special.erfc(np.sqrt(sinr / 10.0)),
        64: 7.0 / 24.0 * special.erfc(np.sqrt(sinr / 42.0)),
    }[points]
    first, step, factor, weights = error_rates.SPECTRA[(0, 2, 0, 2, 0, 2, 1, 2)[rate]]
    d = Fraction(float(np.sqrt(4.0 * raw * (1.0 - raw))))
    bound = Fraction(factor).limit_denominator(6) * sum(w * d ** (first + i * step) for i, w in enumerate(weights))
    # Errors of erfc count up to 26-fold.
    assert error_rates.nist_bit_errors(rate, sinr) == pytest.approx(min(float(bound), 1.0), rel=EXACT, abs=1e-300)


@pytest.mark.parametrize(
    ("rate_mbps", "sinr_db", "stated", "tolerance"),
    [
        (6, 2.5, 2.04e-10, 1e-12), (6, 3.0, 0.020, 1e-3), (6, 4.0, 0.885, 1e-3), (6, 5.0, 0.997, 1e-3),
        (9, 6.0, 0.097, 1e-3), (9, 7.0, 0.918, 1e-3), (9, 8.0, 0.998, 1e-3), (12, 6.0, 0.0174, 1e-3),
        (12, 7.0, 0.881, 1e-3), (12, 8.0, 0.997, 1e-3), (18, 8.5, 2.85e-6, 1e-8), (18, 9.5, 0.623, 1e-3),
        (18, 10.5, 0.985, 1e-3), (24, 12.0, 2.22e-7, 1e-9), (24, 13.0, 0.495, 1e-3), (24, 14.0, 0.974, 1e-3),
        (36, 15.5, 0.012, 1e-3), (36, 16.5, 0.818, 1e-3), (36, 17.5, 0.993, 1e-3), (48, 20.0, 1.3e-4, 1e-6),
        (48, 21.0, 0.649, 1e-3), (48, 22.0, 0.983, 1e-3), (54, 21.0, 5.44e-8, 1e-10),
        (54, 22.0, 0.410, 1e-3), (54, 23.0, 0.958, 1e-3),
    ],
)  # fmt: skip
def test_frames_of_802_11ag_survive_hard_decisions_as_in_ns3(
    rate_mbps: int, sinr_db: float, stated: float, tolerance: float
):
    rate = error_rates.OFDM_RATES_BPS.index(rate_mbps * 1_000_000)
    assert error_rates.nist_success(rate, from_db(sinr_db), FRAME_BITS) == pytest.approx(stated, abs=tolerance)


def test_frames_of_the_lowest_ht_rate_survive_as_in_ns3():
    assert error_rates.nist_success(0, from_db(4.0), 13_000) == pytest.approx(0.905685, abs=1e-6)


# Output bits by bit in, of R = 1/2, 2/3, 3/4.
PUNCTURING = {1: [(1, 1)], 2: [(1, 1), (1, 0)], 3: [(1, 1), (1, 0), (0, 1)]}


@pytest.mark.parametrize("code", range(3))
def test_punctured_code_paths_are_those_of_the_trellis(code: int):
    """Every path that leaves the state 0 and comes back, by the weight of its output; generators 133 and 171."""
    period, stated = error_rates.PATHS[code]
    first, step, _, weights = error_rates.SPECTRA[code]
    highest = first + step * (len(stated) - 1)
    path_counts, bit_weights = np.zeros(highest + 1), np.zeros(highest + 1)
    for start in range(period):
        paths, errors = np.zeros((64, highest + 1)), np.zeros((64, highest + 1))
        phase, paths[0, 0] = start, 1.0
        while paths.any():
            next_paths, next_errors = np.zeros_like(paths), np.zeros_like(errors)
            for state in np.flatnonzero(paths.any(axis=1)):
                for bit in (0, 1):
                    if state == 0 and bit == 0:
                        continue
                    register = bit << 6 | int(state)
                    outputs = zip((0o133, 0o171), PUNCTURING[period][phase], strict=True)
                    weight = sum((register & generator).bit_count() % 2 for generator, is_sent in outputs if is_sent)
                    room = slice(weight, highest + 1), slice(0, highest + 1 - weight)
                    next_paths[register >> 1, room[0]] += paths[state, room[1]]
                    next_errors[register >> 1, room[0]] += errors[state, room[1]] + bit * paths[state, room[1]]
            path_counts, bit_weights = path_counts + next_paths[0], bit_weights + next_errors[0]
            next_paths[0] = next_errors[0] = 0.0
            paths, errors, phase = next_paths, next_errors, (phase + 1) % period
    assert path_counts[first::step].tolist() == list(stated)
    assert bit_weights[first : first + 5 * step : step].tolist() == list(weights[:5])


@pytest.mark.parametrize("sinr_db", [-2.0, 0.0, 1.0, 3.0])
def test_soft_decisions_of_bpsk_have_the_union_bound(sinr_db: float):
    """6 Mbit/s: a path of weight d wins with Q(sqrt(2 d SINR))."""
    weights = 10 + 2 * np.arange(len(error_rates.PATHS[0][1]))
    bound = float(np.sum(np.array(error_rates.PATHS[0][1]) * special.ndtr(-np.sqrt(2.0 * weights * from_db(sinr_db)))))
    assert error_rates.ofdm_path_errors(0, from_db(sinr_db)) == pytest.approx(min(bound, 1.0), rel=1e-12)


@pytest.mark.parametrize("rate", range(8))
def test_soft_decisions_gain_three_to_five_decibels_over_hard_ones(rate: int):
    """At 90 % of 1458 octets; 3 dB of those that the bits lose, and what Chernoff's bound adds."""
    soft, hard = (
        ieee80211ag(error_rates.OFDM_RATES_BPS[rate]),
        ieee80211ag(error_rates.OFDM_RATES_BPS[rate], Model.NIST),
    )
    assert 3.0 < sinr_for_db(hard, 0.9, 8 * 1458) - sinr_for_db(soft, 0.9, 8 * 1458) < 4.6


# By Mbit/s: SINR in dB at which ns-3 3.44 loses 10 % and 1 % of frames of so many octets. Its TableBasedErrorRateModel
# has tables for 32 and 1458 octets, and interpolates linearly over the SINR. Below 400 octets the success is that of 32
# octets to the power octets / 32, from 400 on that of 1458 to the power octets / 1458. It has no table for 9 Mbit/s.
NS3_OCTETS = (32, 236, 399, 400, 636, 1458)
NS3_DB = {
    6: ((-0.36, 0.47), (0.39, 1.06), (0.51, 1.28), (0.47, 1.28), (0.67, 1.40), (0.93, 1.56)),
    12: ((2.61, 3.47), (3.40, 4.09), (3.51, 4.30), (3.48, 4.30), (3.69, 4.41), (3.94, 4.60)),
    18: ((5.10, 5.96), (5.88, 6.59), (5.99, 6.80), (5.98, 6.79), (6.19, 6.91), (6.43, 7.11)),
    24: ((8.06, 9.11), (8.96, 9.88), (9.20, 9.99), (9.20, 10.03), (9.38, 10.25), (9.70, 10.48)),
    36: ((11.28, 12.25), (12.07, 12.96), (12.31, 13.18), (12.30, 13.15), (12.45, 13.34), (12.80, 13.56)),
    48: ((15.31, 16.44), (16.31, 17.29), (16.49, 17.47), (16.47, 17.48), (16.72, 17.72), (17.04, 17.98)),
    54: ((16.61, 17.77), (17.58, 18.60), (17.84, 18.83), (17.82, 18.81), (17.99, 18.95), (18.38, 19.31)),
}


@pytest.mark.parametrize("mbps", NS3_DB)
def test_soft_decisions_agree_with_ns3_tables_at_every_length(mbps: int):
    receiver = ieee80211ag(mbps * 1_000_000)
    for octets, stated_db in zip(NS3_OCTETS, NS3_DB[mbps], strict=True):
        sinr_db = [sinr_for_db(receiver, success, 8 * octets) for success in (0.9, 0.99)]
        assert sinr_db == pytest.approx(stated_db, abs=0.23)


@given(st.floats(-20.0, 15.0))
def test_errors_of_802_11b_at_1_and_2_mbps_are_exact(sinr_db: float):
    sinr = Decimal(from_db(sinr_db))
    assert error_rates.dbpsk_bit_errors(float(sinr)) == pytest.approx(float((-22 * sinr).exp() / 2), rel=EXACT)
    x, root2 = 11 * sinr, Decimal(2).sqrt()
    bound = (root2 + 1) / (8 * PI * root2 * x).sqrt() * (-(2 - root2) * x).exp()
    assert error_rates.dqpsk_bit_errors(float(sinr)) == pytest.approx(min(float(bound), 0.5), rel=EXACT)


@pytest.mark.parametrize("signal", [0.0, 0.3, 1.0, 3.0, 6.0, 10.0, 15.0])
def test_errors_of_biorthogonal_codes_agree_with_quadrature(signal: float):
    def not_all_lower(y: float) -> float:
        wrong = -np.expm1(7.0 * np.log1p(-special.erfc(y / np.sqrt(2.0))))
        return wrong * np.exp(-0.5 * (y - signal) ** 2) / np.sqrt(2.0 * np.pi)

    up_to, _ = integrate.quad(not_all_lower, 0.0, 0.5 * signal, epsabs=0.0, epsrel=1e-13)
    beyond, _ = integrate.quad(not_all_lower, 0.5 * signal, 0.5 * signal + 15.0, epsabs=0.0, epsrel=1e-13)
    expected = up_to + beyond + 0.5 * special.erfc(signal / np.sqrt(2.0))
    assert signal > 0.0 or expected == pytest.approx(15 / 16, rel=1e-14)
    assert error_rates.biorthogonal_errors(signal) == pytest.approx(expected, rel=EXACT)


@pytest.mark.parametrize(
    ("rate_bps", "rss_dbm", "stated", "tolerance"),
    [
        (1_000_000, -105, 0, 1e-13), (1_000_000, -100, 1.5e-13, 1e-13), (1_000_000, -99, 0.0003, 1e-4),
        (1_000_000, -98, 0.202, 5e-3), (1_000_000, -97, 0.813, 5e-3), (1_000_000, -96, 0.984, 5e-3),
        (1_000_000, -95, 0.999, 1e-3), (2_000_000, -96, 0, 1e-13), (2_000_000, -95, 4.5e-6, 1e-6),
        (2_000_000, -94, 0.036, 5e-3), (2_000_000, -93, 0.519, 5e-3), (2_000_000, -92, 0.915, 5e-3),
        (2_000_000, -91, 0.993, 5e-3), (2_000_000, -90, 0.999, 1e-3), (5_500_000, -94, 0, 1e-13),
        (5_500_000, -93, 6.6e-14, 1e-14), (5_500_000, -92, 1e-4, 5e-5), (5_500_000, -91, 0.132, 5e-3),
        (5_500_000, -90, 0.744, 5e-3), (5_500_000, -89, 0.974, 5e-3), (5_500_000, -88, 0.999, 1e-3),
        (11_000_000, -91, 0, 1e-14), (11_000_000, -90, 4.7e-14, 1e-14), (11_000_000, -89, 8.85e-5, 1e-5),
        (11_000_000, -88, 0.128, 5e-3), (11_000_000, -87, 0.739, 5e-3), (11_000_000, -86, 0.973, 5e-3),
        (11_000_000, -85, 0.999, 1e-3),
    ],
)  # fmt: skip
def test_frames_of_802_11b_survive_as_in_ns3(rate_bps: int, rss_dbm: float, stated: float, tolerance: float):
    sinr = from_db(rss_dbm - NOISE_DBM)
    assert error_rates.dsss_success(DSSS_RATES_BPS.index(rate_bps), sinr, DSSS_FRAME_BITS) == pytest.approx(
        stated, abs=tolerance
    )


@pytest.mark.parametrize("sinr_db", [-12.0, -7.0, -3.0, 0.0, 0.407, 2.0, 5.0, 9.0, 13.0])
def test_errors_of_802_15_4_are_exact(sinr_db: float):
    sinr = from_db(sinr_db)
    terms = ((-1) ** k * math.comb(16, k) * (20 * Decimal(sinr) * (Decimal(1) / k - 1)).exp() for k in range(2, 17))
    expected = float(sum(terms) * 8 / (15 * 16))
    # Below 0 dB the terms cancel each other down to a thousandth.
    assert error_rates.oqpsk_bit_errors(sinr) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("sinr_db", "stated", "tolerance"),
    [
        *((5, 7.386009e-14, 5e-20), (2, 5.131392e-07, 5e-13), (-1, 1.148944e-03, 5e-10)),
        *((-4, 3.916346e-02, 5e-9), (-7, 1.752462e-01, 5e-8)),
    ],
)
def test_errors_of_802_15_4_match_ns3(sinr_db: float, stated: float, tolerance: float):
    assert error_rates.oqpsk_bit_errors(from_db(sinr_db)) == pytest.approx(stated, abs=tolerance)


@pytest.mark.parametrize(
    ("sinr_db", "bit_errors", "lost_20", "lost_40", "lost_127"),
    [
        (-5, 7.517e-2, 1, 1, 1), (-4, 3.916e-2, 0.99833, 1, 1), (-3, 1.642e-2, 0.92926, 0.99500, 1),
        (-2, 5.197e-3, 0.56556, 0.81126, 0.99498), (-1, 1.149e-3, 0.16801, 0.30780, 0.68901),
        (0, 1.615e-4, 0.02552, 0.05038, 0.15136), (0.407, 6.227e-5, 0.00991, 0.01973, 0.06131),
        (1, 1.291e-5, 0.00206, 0.00412, 0.01303), (2, 5.131e-7, 0.00008, 0.00016, 0.00052),
        (3, 8.597e-9, 0, 0, 0.00001),
    ],
)  # fmt: skip
def test_frames_of_802_15_4_are_lost_by_the_table(sinr_db, bit_errors, lost_20, lost_40, lost_127):
    sinr = from_db(sinr_db)
    assert error_rates.oqpsk_bit_errors(sinr) == pytest.approx(bit_errors, rel=2e-4)
    for octets, lost in ((20, lost_20), (40, lost_40), (127, lost_127)):
        # The table has five digits, and no row for frames that are lost surely but for 1e-5.
        assert 1.0 - error_rates.oqpsk_success(sinr, octets * 8) == pytest.approx(lost, abs=1.2e-5)
