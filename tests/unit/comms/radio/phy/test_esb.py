"""Enhanced ShockBurst: a station polls drones in turn, with the timing of the nRF24LU1+ specification."""

from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.radio.config.checks import check_radio
from swarmwire.comms.radio.config.frames import airtime_ns
from swarmwire.comms.radio.config.phy import Access
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.disruption import ALL, DROP, NEWEST, Disruption
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.radio.phy.propagation import receiver_for, sensitivity_of
from swarmwire.comms.radio.reception.receiver import chunk_success
from swarmwire.comms.robot.messages import CRTP_TAG
from swarmwire.comms.robot.packets import Payloads, SentPackets, TxResult
from tests.support.comms.radio import (
    RATE_HZ,
    SIZE_M,
    TICK_NS,
    Run,
    at,
    check_fates,
    living,
    make_medium,
    numbers_received,
    packets,
    run,
    run_disrupted,
)
from tests.support.refusals import refused_input
from tests.unit.world.scenario.test_bodies import radio_of

# Frames of 32 octets have 8 + 40 + 9 + 256 + 16 = 329 bits, null packets 81.
# T_ESB = T_UL + 2 x 130 us + T_OA + T_ACK + T_IRQ, with T_UL = 32 us and T_IRQ = 8.2 us (6.0 us at 2 Mbit/s).
EXCHANGE_US = {"250k": 32 + 260 + 2 * 1316 + 8.2, "1M": 32 + 260 + 2 * 329 + 8.2, "2M": 32 + 260 + 2 * 164.5 + 6.0}
FRAME_US = {"250k": 1316.0, "1M": 329.0, "2M": 164.5}
NULL_US = {"250k": 324.0, "1M": 81.0, "2M": 40.5}
ARD_US = {"250k": 1500, "1M": 500, "2M": 500}  # for answers of 32 octets
RATES = tuple(EXCHANGE_US)
IN_LINE = at(*((float(i), 0.0) for i in range(6)))


def crazyradio(rate: str = "2M", **others: object) -> Radio:
    radio = radio_of({"preset": f"crazyradio-{rate}", "queue_limit": 1000, "send_offset": "tick", **others})
    check_radio(radio, "a test")
    return radio


def polled(rate: str, drones: int, packets_each: int, *, answered: bool = True, **others: object) -> Run:
    """The station sends packets of 32 bytes to each of its drones, which have as many for it."""
    to = np.repeat(np.arange(1, drones + 1), packets_each)
    stations = np.zeros(len(to), np.int64)
    sent = packets(stations, to, 32)
    if answered:
        sent = packets(np.r_[stations, to], np.r_[to, stations], 32)
    pose = np.zeros((drones + 1, 3))
    return run(make_medium(crazyradio(rate, **others), drones + 1), pose, lambda _: sent, 1, 30)


@pytest.mark.parametrize("rate", RATES)
def test_frame_airtime_is_that_of_its_bits(rate: str):
    radio = crazyradio(rate)
    airtimes = airtime_ns(radio, np.array([1, 32]) + radio.overhead_bytes)
    assert airtimes.tolist() == [1e3 * NULL_US[rate], 1e3 * FRAME_US[rate]]


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("drones", [1, 5])
def test_polls_per_drone_are_those_of_the_closed_form(rate: str, drones: int):
    """Each drone's packets follow one another after as many exchanges as there are drones, to the nanosecond."""
    result = polled(rate, drones, 20)
    assert result.fates() == {"RECEIVED": 40 * drones}
    received_ns = result.received("received_at_ns")
    for drone in range(1, drones + 1):
        by_link = (result.received("sender_index") == drone) & (result.received("receiver") == 0)
        periods_ns = np.diff(received_ns[by_link])
        assert set(periods_ns.tolist()) == {round(1e3 * drones * EXCHANGE_US[rate])}


def test_host_delay_lengthens_each_exchange():
    result = polled("2M", 1, 5, access={"host_delay_s": 1e-3})
    from_drone_ns = result.received("received_at_ns")[result.received("receiver") == 0]
    assert set(np.diff(from_drone_ns).tolist()) == {round(1e3 * (EXCHANGE_US["2M"] + 1000.0))}


def test_answers_begin_130_us_after_their_poll():
    """The first poll is a null packet: it began as the packets were sent."""
    result = polled("1M", 1, 5)
    down_ns, up_ns = (result.received("received_at_ns")[result.received("receiver") == r] for r in (1, 0))
    assert set((up_ns[1:] - down_ns[:-1]).tolist()) == {1e3 * (130 + FRAME_US["1M"])}


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("max_retries", [0, 3, 15])
def test_polls_without_answer_are_repeated_arc_times(rate: str, max_retries: int):
    """Of two drones one is out of range: each of its null polls takes (ARC + 1) times frame and ARD."""
    pose = at((0, 0), (1, 0), (1e6, 0))
    sent = packets([1] * 5, 0, 32)
    radio = crazyradio(rate, access={"max_retries": max_retries})
    result = run(make_medium(radio, 3), pose, lambda _: sent, 1, 30)
    upload_us, irq_us = 1.0, 6.0 if rate == "2M" else 8.2
    answered_us = upload_us + 260 + NULL_US[rate] + FRAME_US[rate] + irq_us
    silent_us = upload_us + 130 + (max_retries + 1) * (NULL_US[rate] + ARD_US[rate]) + irq_us
    assert set(np.diff(result.received("received_at_ns")).tolist()) == {round(1e3 * (answered_us + silent_us))}


def test_packets_of_both_directions_survive_losses_as_their_attempts_do():
    """A packet to a drone is received unless all four polls are lost: 1 - 0.5^4; 4.4 standard errors."""
    result = polled("2M", 4, 250, answered=False, loss=0.5)
    share = 1.0 - 0.5**4
    received = result.fates()["RECEIVED"]
    assert result.fates() == {"RECEIVED": received, "LOST": 1000 - received}
    assert received == pytest.approx(1000 * share, abs=4.4 * np.sqrt(1000 * share * (1.0 - share)))


def test_packet_is_delivered_once_though_its_acknowledgement_is_lost():
    result = polled("2M", 2, 100, loss=0.5)
    for drone in (1, 2):
        for numbers in (numbers_received(result, 0, drone), numbers_received(result, drone, 0)):
            assert len(set(numbers)) == len(numbers) > 0
    check_fates(result)


@pytest.mark.parametrize(
    ("senders", "to", "links", "out_of_range"),
    [
        ([0], BROADCAST, {(0, drone) for drone in range(1, 6)}, 0),
        ([3], BROADCAST, {(3, 0)}, 4),
        ([3, 3], [4, 0], {(3, 0)}, 1),  # drones do not hear one another
    ],
)
def test_packets_pass_between_station_and_drones_alone(senders, to, links, out_of_range: int):
    result = run(make_medium(crazyradio(), 6), IN_LINE, lambda _: packets(senders, to, 32), 2, 1)
    assert set(result.rows("received", "sender_index", "receiver")) == links
    assert result.fates().get("OUT_OF_RANGE", 0) == 2 * out_of_range
    assert result.fates()["RECEIVED"] == 2 * len(links)


def test_radio_graph_joins_station_and_drones_alone():
    result = run(make_medium(crazyradio(), 4), IN_LINE[:4], lambda _: SentPackets.none(), 1)
    assert result.edges.tolist() == [[0, 1], [0, 2], [0, 3]]


def test_packet_waits_until_its_drone_is_polled():
    """A poll of each of the other drones comes first, at most; packets wait for less than a round."""
    drones = np.arange(1, 6)
    result = run(make_medium(crazyradio("250k"), 6), IN_LINE, lambda _: packets(drones, 0, 32), 5, 1)
    delay_ns = result.received("received_at_ns") - (result.received("received_at_ns") // TICK_NS) * TICK_NS
    assert result.fates() == {"RECEIVED": 25}
    round_us = 5 * (1.0 + 260 + NULL_US["250k"] + FRAME_US["250k"] + 8.2)
    assert delay_ns.max() < 1e3 * 2.0 * round_us


@pytest.mark.parametrize(("distance_m", "result"), [(1.0, TxResult.ACKNOWLEDGED), (1e6, TxResult.NO_ACKNOWLEDGEMENT)])
def test_station_learns_whether_the_drone_answered(distance_m: float, result: TxResult):
    sent = replace(packets([0], [1], 32), tx_status_id=np.array([7]))
    medium = make_medium(crazyradio(), 2)
    ran = run(medium, at((0, 0), (distance_m, 0)), lambda _: sent, 1, 2)
    assert ran.rows("tx_status", "row", "id", "result") == [(0, 7, result)]


@pytest.mark.parametrize("backlog", [DROP, NEWEST, ALL])
def test_radio_that_is_off_keeps_or_drops_its_packets(backlog: int):
    """Of the station and of a drone; both have three packets, sent while they are off, and are on again in tick 2."""
    off = Disruption.none(3)
    off.radio_on[:2], off.backlog[:2] = False, backlog
    sent = {1: packets([0, 0, 0, 1, 1, 1], [1, 1, 1, 0, 0, 0], 32)}
    result = run_disrupted(make_medium(crazyradio(), 3), IN_LINE[:3], sent, {1: off, 2: Disruption.none(3)}, 5)
    received = {DROP: 0, NEWEST: 2, ALL: 6}[backlog]
    lost = {"BLACKOUT": 6 - received} if received < 6 else {}
    assert result.fates() == ({"RECEIVED": received} if received else {}) | lost


def test_station_that_is_off_puts_nothing_on_air():
    """It goes off in every second tick, at another point of an exchange each time, and keeps its packets."""
    off, sent = Disruption.none(2), {0: packets([0] * 600, 1, 32)}
    off.radio_on[0], off.backlog[0] = False, ALL
    now = {tick: off if tick % 2 else Disruption.none(2) for tick in range(1, 31)}
    result = run_disrupted(make_medium(crazyradio("250k"), 2), IN_LINE[:2], sent, now, 35)
    assert result.fates() == {"RECEIVED": 600}
    assert (result.finished("on_air_at_ns") // TICK_NS % 2 == 0).all()


def test_revived_station_polls_again():
    """What it received in tick 0 is lost with it; what was sent while it was dead waits at the drones."""
    dead, sent = living([False, True, True]), {t: packets([1, 2], 0, 32) for t in range(4)}
    result = run_disrupted(make_medium(crazyradio(), 3), IN_LINE[:3], sent, {1: dead, 2: Disruption.none(3)}, 6)
    assert result.fates() == {"RECEIVED": 6, "RECEIVER_DEAD": 2}
    assert set((result.received("received_at_ns") // TICK_NS).tolist()) == {2, 3}


def test_safelink_delivers_all_packets_once_and_in_order_through_losses():
    """Of a poll and its answer 0.75 are lost, and 0.32 of exchanges have no answer."""
    result = polled("2M", 2, 100, loss=0.5, access={"safelink": True})
    for drone in (1, 2):
        assert numbers_received(result, 0, drone) == list(range(100 * (drone - 1), 100 * drone))
        assert numbers_received(result, drone, 0) == list(range(100))
    assert result.fates() == {"RECEIVED": 400}


def test_safelink_gives_up_after_100_exchanges_without_answer_until_there_is_one():
    """100 exchanges with frames of 32 octets take 283 ms, so in the third tick; the second packet has only one."""
    exchange_us = 32 + 130 + 4 * (FRAME_US["2M"] + ARD_US["2M"]) + 6
    assert 2e5 < 99 * exchange_us < 1e-3 * 3 * TICK_NS
    ids = {0: np.array([0]), 5: np.array([1])}
    sent = {tick: replace(packets([0], [1], 32), tx_status_id=id_) for tick, id_ in ids.items()}
    radio = crazyradio("2M", access={"safelink": True})
    result = run(make_medium(radio, 2), at((0, 0), (1e6, 0)), lambda t: sent.get(t, SentPackets.none()), 6, 2)
    assert result.fates() == {"OUT_OF_RANGE": 2}
    assert [step.tx_status.id.tolist() for step in result.news] == [[], [], [], [0], [], [], [1], [], []]


def test_tag_of_a_crtp_packet_is_not_on_air():
    """31 octets of CRTP, the most that the Crazyflie has, and the tag: more than max_payload_bytes."""
    payloads = Payloads.from_rows([CRTP_TAG.to_bytes(2, "little") + bytes(31)] * 5)
    sent = SentPackets(np.zeros(5, np.int64), np.ones(5, np.int64), payloads)
    result = run(make_medium(crazyradio("250k"), 2), np.zeros((2, 3)), lambda _: sent, 1, 30)
    period_us = 31 + 260 + (57 + 16 + 8 * 31) / 0.25 + NULL_US["250k"] + 8.2
    assert set(np.diff(result.received("received_at_ns")).tolist()) == {round(1e3 * period_us)}


@pytest.mark.parametrize(("rate", "sensitivity_dbm"), [("250k", -94.0), ("1M", -85.0), ("2M", -82.0)])
def test_one_bit_in_a_thousand_is_wrong_at_the_sensitivity(rate: str, sensitivity_dbm: float):
    radio = crazyradio(rate)
    assert sensitivity_of(radio) == sensitivity_dbm
    sinr = 10.0 ** (0.1 * (sensitivity_dbm - radio.noise_or_default.power_dbm))
    assert 1.0 - chunk_success(receiver_for(radio), sinr, 1) == pytest.approx(1e-3, rel=0.05)


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"bit_rate_bps": 500_000}, "radio.bit_rate_bps"),
        ({"max_payload_bytes": 33}, "radio.max_payload_bytes"),
        ({"frame": "plain"}, "radio.access.method"),
        ({"access": Access("aloha")}, "radio.access.method"),
        ({"access": Access("esb", acknowledged=False)}, "radio.access.acknowledged"),
        ({"access": Access("esb", cca_time_s=1e-6)}, "radio.access.cca_time_s"),
    ],
)
def test_contradictions_are_refused(changes: dict[str, object], key: str):
    with refused_input(key=key):
        check_radio(replace(crazyradio(), **changes), "a test")


def test_two_stations_share_the_drones_in_turn():
    """Two cells that do not hear one another: robots 2 and 4 belong to station 0, robots 3 and 5 to station 1."""
    keys, far_m = np.array([derive_key(1, "air")], np.uint64), 1e6
    context = replace(ChannelContext.open_space(crazyradio(), keys, 6, SIZE_M), stations=(0, 1))
    pose = at((0, 0), (far_m, 0), (1, 0), (far_m + 1, 0), (2, 0), (far_m + 2, 0))
    sent = packets([2, 3, 4, 5, 2], [0, 1, 0, 1, 1], 32)
    result = run(RadioMedium(context, RATE_HZ), pose, lambda _: sent, 1, 2)
    assert result.fates() == {"RECEIVED": 4, "OUT_OF_RANGE": 1}
    assert set(result.rows("received", "sender_index", "receiver")) == {(2, 0), (3, 1), (4, 0), (5, 1)}
