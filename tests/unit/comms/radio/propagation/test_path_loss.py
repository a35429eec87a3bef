"""Path loss: the closed forms, evaluated apart with 40 digits, and what ns-3's own tests state."""

from decimal import Decimal, getcontext

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.radio.config.path_loss_models import (
    Friis,
    ItuIndoor,
    LogDistance,
    LossCurve,
    TwoRay,
    loss_at_1_m_db,
)
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.propagation.decibels import from_db
from swarmwire.comms.radio.propagation.path_loss import loss_db, reach_m, rssi_dbm
from swarmwire.comms.radio.reception.receiver import chunk_success, ieee802154

getcontext().prec = 40
PI = Decimal("3.1415926535897932384626433832795028841972")
LIGHT = Decimal(299_792_458)
EXACT = 1e-12
NS3_HZ, NS3_W = 2_398_339_664.0, 0.05035702
MODELS = (
    Friis(),
    LogDistance(2.7),
    LogDistance(3.0, 46.6777),
    LogDistance(2.0, 0.0, absorption_db_per_m=0.0074),
    TwoRay(),
    TwoRay(0.2, 0.2),
    TwoRay(0.05, 0.05),
    ItuIndoor("residential", floors=2),
    ItuIndoor("office"),
    ItuIndoor("commercial", distance_coefficient_db=25.0),
)
DISTANCES = st.floats(0.0, 1e5)
FREQUENCIES = st.floats(4e8, 6e9)


def friis_db(distance_m: float, frequency_hz: float) -> Decimal:
    return 20 * (4 * PI * Decimal(distance_m) * Decimal(frequency_hz) / LIGHT).log10()


def received_w(model, distance_m: float) -> float:
    """As ns-3's tests of propagation have it."""
    return NS3_W / from_db(loss_db(model.curve(NS3_HZ), distance_m))


@pytest.mark.parametrize(
    ("frequency_hz", "stated_db"),
    [
        (868e6, 31.218),
        (915e6, 31.676),
        (2.400e9, 40.052),
        (2.412e9, 40.095),
        (2.437e9, 40.185),
        (2.440e9, 40.196),
        (2.450e9, 40.231),
        (5.150e9, 46.684),
        (5.180e9, 46.734),
    ],
)
def test_free_space_takes_the_known_loss_over_one_metre(frequency_hz: float, stated_db: float):
    assert loss_at_1_m_db(frequency_hz) == pytest.approx(stated_db, abs=5e-4)
    assert loss_db(Friis().curve(frequency_hz), 1.0) == loss_at_1_m_db(frequency_hz)


@given(st.floats(1.0, 1e5), FREQUENCIES)
def test_friis_is_exact(distance_m: float, frequency_hz: float):
    assert loss_db(Friis().curve(frequency_hz), distance_m) == pytest.approx(
        float(friis_db(distance_m, frequency_hz)), rel=EXACT
    )


@given(st.floats(1.0, 1e5), FREQUENCIES, st.floats(1.5, 6.0))
def test_log_distance_is_exact(distance_m: float, frequency_hz: float, exponent: float):
    expected = friis_db(1.0, frequency_hz) + 10 * Decimal(exponent) * Decimal(distance_m).log10()
    curve = LogDistance(exponent).curve(frequency_hz)
    assert loss_db(curve, distance_m) == pytest.approx(float(expected), rel=EXACT)


@given(st.floats(1.0, 1e5), FREQUENCIES, st.floats(0.2, 30.0), st.floats(0.2, 30.0))
def test_two_ray_is_exact(distance_m: float, frequency_hz: float, sender_m: float, receiver_m: float):
    heights = Decimal(sender_m) * Decimal(receiver_m)
    near = Decimal(distance_m) <= 4 * PI * heights * Decimal(frequency_hz) / LIGHT
    ground = 40 * Decimal(distance_m).log10() - 20 * heights.log10()
    expected = float(friis_db(distance_m, frequency_hz) if near else ground)
    curve = TwoRay(sender_m, receiver_m).curve(frequency_hz)
    assert loss_db(curve, distance_m) == pytest.approx(expected, rel=EXACT, abs=1e-12)


@given(FREQUENCIES, st.floats(0.05, 30.0), st.floats(0.05, 30.0))
def test_the_crossover_of_two_rays_is_exact_and_both_lines_meet_there(
    frequency_hz: float, sender_m: float, receiver_m: float
):
    model = TwoRay(sender_m, receiver_m)
    expected = 4 * PI * Decimal(sender_m) * Decimal(receiver_m) * Decimal(frequency_hz) / LIGHT
    assert model.crossover_m(frequency_hz) == pytest.approx(float(expected), rel=EXACT)
    curve = model.curve(frequency_hz)
    ground_db = float(40 * expected.log10() - 20 * (Decimal(sender_m) * Decimal(receiver_m)).log10())
    assert friis_db(float(expected), frequency_hz) == pytest.approx(Decimal(ground_db), abs=Decimal("1e-11"))
    assert curve.break_m == model.crossover_m(frequency_hz)


@given(st.floats(1.0, 1e5), FREQUENCIES, st.integers(0, 4))
def test_itu_indoor_is_exact(distance_m: float, frequency_hz: float, floors: int):
    floor_db = 15 + 4 * (floors - 1) if floors else 0
    expected = 20 * (Decimal(frequency_hz) / 10**6).log10() + 30 * Decimal(distance_m).log10() + floor_db - 28
    curve = ItuIndoor("office", floors=floors).curve(frequency_hz)
    assert loss_db(curve, distance_m) == pytest.approx(float(expected), rel=EXACT)


@pytest.mark.parametrize(
    ("distance_m", "stated_w"), [(100, 4.98265e-10), (500, 1.99306e-11), (1000, 4.98265e-12), (2000, 1.24566e-12)]
)
def test_friis_gives_the_powers_of_ns3(distance_m: float, stated_w: float):
    assert received_w(Friis(), distance_m) == pytest.approx(stated_w, rel=2e-6)


@pytest.mark.parametrize(
    ("receiver_height_m", "distance_m", "stated_w"),
    [
        (1.5, 500, 4.07891862e-12),
        (1.5, 1000, 2.5493241375e-13),
        (1.5, 2000, 1.593327585938e-14),
        (2.5, 500, 1.13303295e-11),
        (5.5, 1000, 3.42742467375e-12),
        (11.5, 2000, 9.36522547734e-13),
    ],
)
def test_two_ray_gives_the_powers_of_ns3(receiver_height_m: float, distance_m: float, stated_w: float):
    assert received_w(TwoRay(1.5, receiver_height_m), distance_m) == pytest.approx(stated_w, rel=1e-9)


def test_two_ray_is_friis_below_its_crossover_which_low_antennas_have_near():
    assert received_w(TwoRay(), 100) == pytest.approx(4.98265e-10, rel=2e-6)
    assert TwoRay().crossover_m(NS3_HZ) == pytest.approx(226.19, abs=0.005)
    assert TwoRay(0.2, 0.2).crossover_m(NS3_HZ) == pytest.approx(4.02, abs=0.005)


@pytest.mark.parametrize(
    ("distance_m", "stated_w"), [(10, 4.98265e-9), (20, 6.22831e-10), (40, 7.78539e-11), (80, 9.73173e-12)]
)
def test_log_distance_gives_the_powers_of_ns3(distance_m: float, stated_w: float):
    assert received_w(LogDistance(3.0, 40.045997), distance_m) == pytest.approx(stated_w, rel=3e-6)


def test_itu_indoor_gives_the_loss_of_ns3():
    """Two floors and (0, 30, 9) m apart in a residential building."""
    curve = ItuIndoor("residential", floors=2).curve(2.114e9)
    assert loss_db(curve, (30.0**2 + 9.0**2) ** 0.5) == pytest.approx(88.3855, abs=1e-4)


def test_a_frame_of_802_15_4_crosses_95_m_as_in_ns3():
    """Of 1000 frames with 20 octets of payload (37 on air), ns-3's own test wants 990 to 1000."""
    power_dbm = rssi_dbm(0.0, 0.0, 0.0, loss_db(LogDistance(3.0, 46.6777).curve(2.4e9), 95.0))
    assert chunk_success(ieee802154(), from_db(power_dbm + 106.987), 37 * 8) > 0.99


def test_gains_of_both_antennas_count():
    assert rssi_dbm(10.0, 2.0, -1.0, 60.0) == -49.0


@pytest.mark.parametrize("model", MODELS)
@given(DISTANCES, DISTANCES, FREQUENCIES)
def test_more_distance_never_has_less_loss(model, one_m: float, other_m: float, frequency_hz: float):
    curve = model.curve(frequency_hz)
    # At a crossover the two lines meet but for rounding.
    assert loss_db(curve, min(one_m, other_m)) <= loss_db(curve, max(one_m, other_m)) + 1e-12


@pytest.mark.parametrize("model", MODELS)
def test_below_a_metre_the_loss_is_that_at_a_metre(model):
    curve = model.curve(2.44e9)
    assert loss_db(curve, 0.0) == loss_db(curve, 0.5) == loss_db(curve, 1.0)


@pytest.mark.parametrize("model", MODELS)
@given(st.floats(1.0, 1e5), FREQUENCIES)
def test_reach_is_the_inverse_of_loss(model, distance_m: float, frequency_hz: float):
    curve = model.curve(frequency_hz)
    assert reach_m(curve, loss_db(curve, distance_m) + 1e-12) == pytest.approx(distance_m, rel=EXACT, abs=2e-12)


@pytest.mark.parametrize("model", MODELS)
def test_who_cannot_afford_the_loss_at_a_metre_reaches_nobody(model):
    curve = model.curve(2.44e9)
    assert reach_m(curve, loss_db(curve, 1.0) - 1e-6) == 0.0


def test_reach_stops_at_a_jump_that_it_cannot_afford():
    """A steeper line from 16 m on that starts 12.04 dB higher, as wmediumd has ITU-R P.1238."""
    curve = LossCurve(40.0, 28.0, 16.0, 40.0, 38.0)
    at_break_db = loss_db(curve, 16.0)
    assert loss_db(curve, 16.000001) - at_break_db == pytest.approx(12.04, abs=0.005)
    for spare_db in (0.0, 6.0, 12.0):
        assert reach_m(curve, at_break_db + spare_db) == pytest.approx(16.0, rel=EXACT)
    assert reach_m(curve, loss_db(curve, 30.0)) == pytest.approx(30.0, rel=EXACT)


@pytest.mark.parametrize(
    ("radio", "law"),
    [
        (Radio(model="log-distance"), LogDistance()),
        (Radio(model="friis"), Friis()),
        (Radio(model="two-ray"), TwoRay()),
        (Radio(model="itu-indoor"), ItuIndoor()),
    ],
)
def test_a_model_without_a_table_has_the_usual_one(radio: Radio, law: object):
    assert radio.loss_model == law


def test_a_disk_has_no_path_loss():
    with pytest.raises(ValueError, match="model: a unit disk has no path loss"):
        _ = Radio(2.0).loss_model
