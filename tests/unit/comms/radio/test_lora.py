"""LoRa: airtime, sensitivity, capture, channel activity detection, duty cycle and dwell time."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.radio.config.antennas import RobotAntenna
from swarmwire.comms.radio.config.checks import check_spreading
from swarmwire.comms.radio.config.frames import airtime_ns
from swarmwire.comms.radio.config.lora import Lora
from swarmwire.comms.radio.config.phy import Access
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.phy.propagation import sensitivity_of
from swarmwire.comms.radio.timing import lora_ns, lora_symbol_ns
from swarmwire.comms.robot.packets import Fate
from tests.support.comms.radio import Run, at, make_medium, packets, run
from tests.support.refusals import refused_input
from tests.unit.comms.radio.test_antennas import medium_of
from tests.unit.world.scenario.test_bodies import radio_of

PAIR = at((0, 0), (1, 0))


def lora(**keys: Any) -> Radio:
    others = {name: keys.pop(name) for name in tuple(keys) if name not in Lora.__dataclass_fields__}
    return radio_of({"preset": "lora-eu868", "send_offset": "tick", "lora": {"duty_cycle": 1.0, **keys}, **others})


@pytest.mark.parametrize(
    ("octets", "spreading_factor", "ms"),
    [
        (13, 9, 164.864),  # The Things Network's spreadsheet after Semtech's AN1200.13
        # By hand: 20.25 symbols, and blocks of five: 6, 6, 6, 5, 6 and 5; 13 for 64 octets.
        *((23, 7, 61.696), (23, 8, 113.152), (23, 9, 205.824), (23, 10, 370.688), (23, 11, 823.296)),
        *((23, 12, 1482.752), (64, 12, 2793.472)),
    ],
)
def test_lora_airtime_matches_published_values(octets: int, spreading_factor: int, ms: float):
    radio = lora(spreading_factor=spreading_factor)
    assert airtime_ns(radio, np.array([octets])).tolist() == [round(ms * 1e6)]


@given(
    st.integers(0, 255),
    st.integers(7, 12),
    st.sampled_from([125_000, 250_000, 500_000]),
    st.integers(1, 4),
    st.integers(6, 65535),
    st.booleans(),
    st.booleans(),
    st.booleans(),
)
def test_lora_airtime_matches_the_data_sheet_formula(
    octets: int, sf: int, bandwidth_hz: int, cr: int, preamble: int, header: bool, crc: bool, low_rate: bool
):
    """In float64; H is 0 for an explicit header."""
    symbol_s = 2.0**sf / bandwidth_hz
    ratio = (8 * octets - 4 * sf + 28 + 16 * crc - 20 * (1 - header)) / (4 * (sf - 2 * low_rate))
    payload_symbols = 8 + max(np.ceil(ratio) * (cr + 4), 0)
    airtime_s = (preamble + 4.25) * symbol_s + payload_symbols * symbol_s
    got_ns = lora_ns(
        octets,
        sf,
        bandwidth_hz,
        parity_bits=cr,
        preamble_symbols=preamble,
        explicit_header=header,
        crc=crc,
        low_data_rate=low_rate,
    )
    assert got_ns == round(airtime_s * 1e9)


@pytest.mark.parametrize(
    ("sf", "bandwidth_hz", "on"), [(10, 125_000, 0), (11, 125_000, 1), (11, 250_000, 0), (12, 250_000, 1)]
)
def test_low_data_rate_optimisation_is_on_for_symbols_of_16_ms(sf: int, bandwidth_hz: int, on: bool):
    assert Lora(sf, bandwidth_hz).optimises_low_data_rate == on
    assert (lora_symbol_ns(sf, bandwidth_hz) >= 16_000_000) == on


@pytest.mark.parametrize(
    ("bandwidth_hz", "sensitivity_dbm"),
    [
        # SX1276 data sheet, rev. 7, table 10, high band: up to 2.5 dB above k T B, 6 dB and its own SNR limits.
        (125_000, (-123, -126, -129, -132, -133, -136)),
        (250_000, (-120, -123, -125, -128, -130, -133)),
        (500_000, (-116, -119, -122, -125, -128, -130)),
    ],
)
def test_lora_sensitivity_is_within_3_db_of_the_data_sheet(bandwidth_hz: int, sensitivity_dbm: tuple[int, ...]):
    for sf, stated_dbm in zip(range(7, 13), sensitivity_dbm, strict=True):
        simulated_dbm = sensitivity_of(lora(spreading_factor=sf, bandwidth_hz=bandwidth_hz))
        assert simulated_dbm == pytest.approx(-174 + 10 * np.log10(bandwidth_hz) + 6 - 7.5 - 2.5 * (sf - 7), abs=0.05)
        assert simulated_dbm == pytest.approx(stated_dbm, abs=2.6)


@pytest.mark.parametrize("sf", [7, 12])
def test_lora_lone_frame_is_received_down_to_the_snr_limit(sf: int):
    """At 10 m the loss is 61.2 dB: free space at 868.1 MHz up to 1 m, then 30 dB."""
    for margin_db, fate in ((0.1, "RECEIVED"), (-0.1, "OUT_OF_RANGE")):
        power_dbm = sensitivity_of(lora(spreading_factor=sf)) + 61.2192 + margin_db
        radio = lora(spreading_factor=sf, antenna={"power_dbm": power_dbm})
        assert run(make_medium(radio, 2), at((0, 0), (10, 0)), lambda _: packets([0]), 1, 30).fates() == {fate: 1}


def overlap(second_m: float, second_after: int, radio: Radio) -> Run:
    """Robots 1 and 2 send to robot 0, robot 1 first, from 10 m; ticks of 0.1 s."""
    pose = at((0, 0), (10, 0), (-second_m, 0))
    sent = {0: packets([1], 0), second_after: packets([2], 0)}
    return run(make_medium(radio, 3), pose, lambda tick: sent.get(tick, packets([])), second_after + 1, 40)


def fates_by_sender(result: Run) -> dict[int, str]:
    return {s: Fate(f).name for s, f in zip(result.finished("sender"), result.finished("fate"), strict=True)}


@pytest.mark.parametrize(
    ("second_m", "first", "second"),
    [
        (10 * 10 ** (6.1 / 30), "RECEIVED", "COLLIDED"),  # 6.1 dB weaker, exponent 3
        (10 * 10 ** (5.9 / 30), "COLLIDED", "COLLIDED"),
        (10 * 10 ** (-5.9 / 30), "COLLIDED", "COLLIDED"),
        (10 * 10 ** (-6.1 / 30), "COLLIDED", "RECEIVED"),
    ],
)
def test_lora_frame_captures_the_receiver_by_6_db(second_m: float, first: str, second: str):
    """SF12, 10 + 4 bytes: 1.15 s; the second starts 0.5 s after the first."""
    result = overlap(second_m, 5, lora(spreading_factor=12))
    assert fates_by_sender(result) == {1: first, 2: second}


@pytest.mark.parametrize(("ticks", "fate"), [(11, "RECEIVED"), (10, "COLLIDED")])
def test_lora_frames_overlap_from_the_critical_section_of_the_preamble_on(ticks: int, fate: str):
    """14 octets at SF12 take 1.155 s. The second's first three symbols (98 ms) may overlap the first frame's end."""
    assert airtime_ns(lora(spreading_factor=12), np.array([14])).tolist() == [1_155_072_000]
    assert fates_by_sender(overlap(10.0, ticks, lora(spreading_factor=12))) == {1: fate, 2: fate}


def test_lora_robot_receives_nothing_while_it_sends():
    result = run(make_medium(lora(), 2), PAIR, lambda _: packets([0, 1]), 1, 3)
    assert result.fates() == {"COLLIDED": 2}


def test_lora_robots_receive_frames_of_their_spreading_factor_alone():
    """14 octets: 46.336 ms at SF7, 164.864 ms at SF9; see the airtime tests for the formula."""
    groups = [None, None, RobotAntenna(spreading_factor=9), RobotAntenna(spreading_factor=9)]
    pose = at((0, 0), (10, 0), (0, 10), (10, 10))
    result = run(medium_of(lora(), groups), pose, lambda tick: packets([0] if tick == 0 else [2]), 2, 10)
    assert sorted(result.rows("received", "sender_index", "receiver")) == [(0, 1), (2, 3)]
    assert result.fates() == {"RECEIVED": 2, "OUT_OF_RANGE": 4}
    ends_ns = dict(zip(result.finished("sender"), result.finished("final_at_ns"), strict=True))
    assert ends_ns[0] == 46_336_000
    assert ends_ns[2] == 100_000_000 + 164_864_000
    assert result.edges.tolist() == [[0, 1], [2, 3]]


@pytest.mark.parametrize(
    ("signal", "interferer", "least_sir_db"),
    # Croce et al. 2018, table II, as also in FLoRa's LoRaReceiver.h.
    [(7, 10, -9), (7, 12, -9), (8, 11, -13), (9, 12, -15), (10, 7, -19), (11, 8, -22), (12, 7, -25), (12, 9, -25)],
)
def test_lora_frame_survives_another_spreading_factor_down_to_its_co_channel_rejection(
    signal: int, interferer: int, least_sir_db: int
):
    """The longer frame begins 0.2 s before the other; exponent 3 beyond 1 m."""
    groups = [None if sf == 7 else RobotAntenna(spreading_factor=sf) for sf in (signal, signal, interferer)]
    first, second = ([1], [2]) if signal > interferer else ([2], [1])
    sent = {0: packets(first, 0), 2: packets(second, 0)}
    for margin_db, fate in ((0.1, "RECEIVED"), (-0.1, "COLLIDED")):
        pose = at((0, 0), (20, 0), (-20 * 10 ** ((least_sir_db + margin_db) / 30), 0))
        result = run(medium_of(lora(), groups), pose, lambda tick: sent.get(tick, packets([])), 3, 30)
        assert fates_by_sender(result) == {1: fate}


@pytest.mark.parametrize("sf", [8, 12])
def test_lora_group_has_the_sensitivity_of_its_spreading_factor_and_measures_the_power(sf: int):
    """At 10 m the loss is 61.2192 dB, see above."""
    for margin_db, fate in ((0.1, "RECEIVED"), (-0.1, "OUT_OF_RANGE")):
        strength_dbm = sensitivity_of(lora(spreading_factor=sf)) + margin_db
        radio = lora(antenna={"power_dbm": strength_dbm + 61.2192}, measures={"rssi": {}})
        groups = [RobotAntenna(spreading_factor=sf)] * 2
        result = run(medium_of(radio, groups), at((0, 0), (10, 0)), lambda _: packets([0]), 1, 30)
        assert result.fates() == {fate: 1}
        np.testing.assert_allclose(result.measured("rssi_dbm"), strength_dbm, atol=0.01)


def test_channel_activity_detection_spares_what_aloha_loses():
    """12 in one spot, each 20 frames of 46 ms in 10 s: an offered load of 1.1."""
    delivered = {}
    for method in ("aloha", "cad"):
        radio = replace(lora(), access=Access(method), send_offset="uniform")
        result = run(
            make_medium(radio, 12), np.zeros((12, 3)), lambda t: packets(range(12) if t % 5 == 0 else []), 50, 100
        )
        delivered[method] = result.fates().get("RECEIVED", 0) / (12 * 11 * 10)
    assert delivered["aloha"] < 0.4
    assert delivered["cad"] > 0.8


def test_duty_cycle_refuses_packets_beyond_the_airtime_of_an_hour():
    """1 % of an hour is 36 s: 31 frames of 1155 ms; the other robot has its own allowance."""
    radio = lora(spreading_factor=12, duty_cycle=0.01, queue_limit=100)
    result = run(make_medium(radio, 2), PAIR, lambda t: packets([0] if t % 20 == 0 else []), 20 * 40, 20)
    assert result.fates() == {"RECEIVED": 31, "DUTY_CYCLE": 9}
    refused = result.finished("fate") == Fate.DUTY_CYCLE
    assert (result.finished("receiver")[refused] < 0).all()  # at the sender's radio


def test_duty_cycle_counts_frames_in_the_queue_when_they_go_on_air():
    radio = lora(spreading_factor=12, duty_cycle=0.001, queue_limit=100)
    result = run(make_medium(radio, 2), PAIR, lambda _: packets([0] * 5), 1, 100)
    assert result.fates() == {"RECEIVED": 3, "DUTY_CYCLE": 2}


def test_duty_cycle_allowance_returns_after_an_hour():
    """Sent at 0 s, in minutes 1 and 59, and after 61 minutes, when the first frame no longer counts."""
    radio, second = lora(spreading_factor=12, duty_cycle=0.0004), 10
    sent = {0: packets([0]), 59 * 60 * second: packets([0]), 61 * 60 * second: packets([0])}
    medium = make_medium(radio, 2)
    fates = np.zeros(len(Fate), np.int64)
    for tick in sorted({*sent, *(at_tick + 30 for at_tick in sent)}):
        fates += medium.step(tick * 100_000_000, PAIR).tally.fates.sum(axis=0)
        if tick in sent:
            medium.send(tick * 100_000_000, tick, sent[tick])
    assert {Fate(i).name: n for i, n in enumerate(fates.tolist()) if n} == {"RECEIVED": 2, "DUTY_CYCLE": 1}


def test_us915_frames_of_255_bytes_last_at_most_the_dwell_time():
    radio = radio_of({"preset": "lora-us915"})
    longest_ns = int(airtime_ns(radio, np.array([radio.max_payload_bytes + radio.overhead_bytes]))[0])
    assert 0.39e9 < longest_ns <= 0.4e9


@pytest.mark.parametrize(
    ("keys", "key"),
    [
        ({"lora": {"spreading_factor": 6}}, "radio.lora.spreading_factor"),
        ({"lora": {"spreading_factor": 13}}, "radio.lora.spreading_factor"),
        ({"lora": {"bandwidth_hz": 62_500}}, "radio.lora.bandwidth_hz"),
        ({"lora": {"coding_rate": "4/9"}}, "radio.lora.coding_rate"),
        ({"lora": {"duty_cycle": 0.0}}, "radio.lora.duty_cycle"),
        ({"preset": "lora-us915", "lora": {"spreading_factor": 9}}, "radio.max_payload_bytes"),
        ({"preset": "lora-us915", "lora": {"spreading_factor": 12}}, "radio.lora.max_airtime_s"),
        ({"max_payload_bytes": 252}, "radio.max_payload_bytes"),
        ({"frame": "plain"}, "radio.lora"),
        ({"bit_rate_bps": 5470}, "radio.bit_rate_bps"),
        ({"reception": {"model": "802.15.4"}}, "radio.reception"),
        ({"noise": {"bandwidth_hz": 1e6}}, "radio.noise.bandwidth_hz"),
        ({"access": {"method": "dcf"}}, "radio.access.method"),
        ({"access": {"method": "csma-802154"}}, "radio.access.method"),
        ({"preset": "ieee802154", "access": {"method": "cad"}}, "radio.access.method"),
        ({"preset": "unit-disk", "frame": "lora"}, "radio.frame"),
    ],
)
def test_unfit_lora_keys_are_refused(keys: dict[str, Any], key: str):
    with refused_input(key=key):
        radio_of({"preset": "lora-eu868", **keys})


@pytest.mark.parametrize(
    ("keys", "key"),
    [
        ({"preset": "ieee802154"}, "robots.scouts.radio.spreading_factor"),
        ({"access": {"method": "cad"}}, "robots.scouts.radio.spreading_factor"),
        ({"preset": "lora-us915"}, "radio.max_payload_bytes"),
    ],
)
def test_unfit_spreading_factors_of_groups_are_refused(keys: dict[str, Any], key: str):
    radio = radio_of({"preset": "lora-eu868", **keys})
    with refused_input(key=key):
        check_spreading(radio, 9, "scenario.toml", "robots.scouts.radio")
