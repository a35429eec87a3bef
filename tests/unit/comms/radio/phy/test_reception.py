"""Reception with a PHY: which packets arrive, and what is counted."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.sentinels import BROADCAST, NO_ROBOT
from swarmwire.comms.radio.config.antennas import Antenna
from swarmwire.comms.radio.config.impairments import Measures, RangeMeasure
from swarmwire.comms.radio.config.phy import Access, Fading, Reception, Shadowing
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import Disruption, Jammers
from swarmwire.comms.radio.phy import model
from swarmwire.comms.radio.phy.model import Reporter
from swarmwire.comms.radio.phy.results import ResultBuffer
from swarmwire.comms.radio.reception.error_rates import oqpsk_bit_errors
from swarmwire.comms.robot.packets import Fate
from tests.support.comms.radio import (
    ALL_MEASURES,
    METHODS,
    OBSTACLES,
    TICK_NS,
    WIFI_B,
    Run,
    at,
    everybody,
    living,
    make_medium,
    packets,
    run,
    scattered,
    signal_radios,
    with_access,
)

ROBOTS = 12


@pytest.mark.parametrize("distance_m", [60.0, 95.0, 105.0, 115.0, 120.0])
@pytest.mark.parametrize("method", ["none", "csma-802154"])
def test_delivery_of_802_15_4_over_distance_matches_its_formula(distance_m: float, method: str):
    """2,000 packets each: within 0.02, and four standard errors where that is more (false alarm below 1e-4)."""
    pose = at((-distance_m / 2, 0), (distance_m / 2, 0))
    sent = packets([0] * 20, size=20)
    result = run(make_medium(with_access(method), 2), pose, lambda _: sent, 100, 2)
    snr = 10 ** ((-46.6777 - 30 * np.log10(distance_m) + 106.987) / 10)
    expected = (1 - oqpsk_bit_errors(snr)) ** (8 * 37)
    tolerance = max(0.02, 4 * (expected * (1 - expected) / 2000) ** 0.5)
    assert result.fates().get("RECEIVED", 0) / 2000 == pytest.approx(expected, abs=tolerance)


def test_rssi_is_equal_in_both_directions():
    radio = replace(with_access("none"), shadowing=Shadowing(), fading=Fading())
    result = run(make_medium(radio, 12), scattered(12) * [20, 20, 1], everybody(12), 1, 1)
    links = {(s, r): rssi for s, r, rssi in result.rows("finished", "sender", "receiver", "rssi_dbm")}
    both = [pair for pair in links if pair[::-1] in links]
    assert len(both) > 50
    assert all(links[pair] == links[pair[::-1]] for pair in both)


@pytest.mark.parametrize("far_first", [True, False])
def test_near_frame_of_two_is_received_as_in_ns3(far_first: bool):
    """ns-3's lr-wpan-collision-test: senders 1 m and 30 m away, one frame received, whoever has the lower row."""
    senders = ((30, 0), (-1, 0)) if far_first else ((-1, 0), (30, 0))
    result = run(make_medium(with_access("aloha"), 3), at(*senders, (0, 0)), lambda _: packets([0, 1], 2), 1, 1)
    assert result.fates() == {"RECEIVED": 1, "COLLIDED": 1}
    assert result.received("sender_index").tolist() == [int(far_first)]


def test_equal_frames_at_once_are_both_lost_without_capture():
    """One of IEEE 802.15.4 has as much, by its spreading: at 0 dB it hears 95 of 100 frames."""
    radio = replace(with_access("aloha"), reception=Reception("threshold", min_sinr_db=3.0))
    result = run(make_medium(radio, 3), at((-1, 0), (1, 0), (0, 0)), lambda _: packets([0, 1], 2), 1, 1)
    assert result.fates() == {"COLLIDED": 2}


def test_sender_hears_nothing_while_it_sends():
    result = run(make_medium(with_access("aloha"), 2), at((0, 0), (1, 0)), everybody(2), 1, 1)
    assert result.fates() == {"COLLIDED": 2}
    assert run(make_medium(with_access("none"), 2), at((0, 0), (1, 0)), everybody(2), 1, 1).fates() == {"RECEIVED": 2}


def test_carrier_sense_lets_one_after_the_other_send():
    """Three robots hand over two packets each at once, 20 times; of DCF, the first ones collide for certain."""
    received = {}
    for method in METHODS[1:]:
        pose, sent = at((0, 0), (1, 0), (0.5, 1)), packets([0, 1, 2] * 2)
        result = run(make_medium(with_access(method), 3), pose, lambda _, sent=sent: sent, 20, 1)
        received[method] = result.fates().get("RECEIVED", 0) / 240
    assert received["aloha"] == 0.0
    assert received["csma-802154"] > 0.5
    assert 0.3 < received["dcf"] <= 0.5


@pytest.mark.parametrize("load", [0.25, 0.5, 1.0])
def test_aloha_throughput_matches_abramson(load: float):
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
    result = run(make_medium(radio, senders + 1), pose, lambda _: packets(range(senders), senders), ticks, 1)
    received = result.fates().get("RECEIVED", 0) / (senders * ticks)
    assert received == pytest.approx(np.exp(-2 * load), abs=0.03)


@pytest.mark.parametrize("method", ["csma-802154", "dcf"])
def test_acknowledged_packets_are_sent_again(method: str):
    """Half of all frames, and of all acknowledgements, are lost: hardly a packet is, with three or seven retries."""
    pose, sent = at((0, 0), (1, 0)), packets([0] * 5, 1)
    for acknowledged, least, most in ((True, 0.9, 1.0), (False, 0.4, 0.6)):
        radio = with_access(method)
        radio = replace(radio, loss=0.5, access=replace(radio.access_or_default, acknowledged=acknowledged))
        result = run(make_medium(radio, 2), pose, lambda _: sent, 60, 3)
        assert least <= result.fates()["RECEIVED"] / 300 <= most
        assert result.fates()["RECEIVED"] + result.fates().get("LOST", 0) == 300


def test_csma_defers_to_a_frame_that_it_is_receiving():
    """-100 dBm: received without errors, though below the threshold of energy (-96.6 dBm); equal backoffs collide."""
    pose, sent = at((0, 0), (60, 0)), packets([0, 1], size=100)
    result = run(make_medium(with_access("csma-802154"), 2), pose, lambda _: sent, 100, 1)
    assert result.fates()["RECEIVED"] / 200 == pytest.approx(7 / 8, abs=0.05)


@pytest.mark.parametrize(
    ("cca_time_s", "later_ns", "received"),
    [(None, 4_000, 0), (None, 4_001, 2), (10e-6, 10_000, 0), (10e-6, 10_001, 2), (0.0, 0, 0), (0.0, 1, 2)],
)
def test_dcf_stations_collide_within_the_cca_time(cca_time_s: float | None, later_ns: int, received: int):
    """Both find the medium idle and are due DIFS later; without a value it is 4 us, as in ns-3."""
    radio = replace(with_access("dcf"), access=Access("dcf", cca_time_s=cca_time_s))
    medium, pose, steps = make_medium(radio, 2), at((0, 0), (1, 0)), []
    for tick, at_ns in enumerate((0, later_ns)):
        steps.append(medium.step(at_ns, pose))
        medium.send(at_ns, tick, packets([tick]))
    steps.append(medium.step(TICK_NS, pose))
    medium.end()
    assert sum(len(step.received.receiver) for step in steps) == received


@pytest.mark.parametrize(("cca_sensitivity_dbm", "waits"), [(None, True), (-70.0, False)])
def test_dcf_medium_is_busy_while_frames_collide(cca_sensitivity_dbm: float | None, waits: bool):
    """Two frames at once, of which robot 2 finds neither (both at -77 dBm, far below -62 dBm): as in ns-3 it waits."""
    radio = replace(with_access("dcf"), access=Access("dcf", cca_sensitivity_dbm=cca_sensitivity_dbm))
    medium, pose = make_medium(radio, 3), at((-10.2, 0), (10.2, 0), (0, 0))
    result = Run(medium)
    result.news.append(medium.step(0, pose))
    medium.send(0, 0, packets([0, 1], size=60))
    result.news.append(medium.step(200_000, pose))
    medium.send(200_000, 1, packets([2], size=60))
    result.news.append(medium.step(TICK_NS, pose))
    medium.end()
    on_air_at_ns = result.finished("on_air_at_ns")[result.finished("sender") == 2]
    assert len(on_air_at_ns)
    assert (on_air_at_ns > 50_000 + 1_000_000).all() == waits


@pytest.mark.parametrize(("nodes", "on_air_delivery"), [(2, 0.883), (10, 0.3375), (20, 0.1268)])
def test_dcf_full_queues_collide_as_often_as_in_ns3(nodes: int, on_air_delivery: float):
    """Broadcasts of 164 octets at 6 Mbit/s from full queues: ns-3's recorded ratios, with 0.002 of standard error.

    Of 20 nodes a sixth of the successes have a backoff of no slots after a collision. Ours are 0.6 s, with standard
    errors of 0.007 at most.
    """
    radio = replace(
        WIFI_B,
        frame="802.11a",
        bit_rate_bps=6_000_000,
        queue_limit=1000,
        max_payload_bytes=128,
        reception=Reception("802.11ag", preamble_sinr_db=4.0, capture_window_s=4e-6),
        access=Access("dcf"),
    )
    sent = packets(np.repeat(np.arange(nodes), 400), size=128)
    result = run(make_medium(radio, nodes), np.zeros((nodes, 3)), lambda _: sent, 6)
    on_air = result.finished("fate")[result.finished("receiver") >= 0]
    assert np.mean(on_air == Fate.RECEIVED) == pytest.approx(on_air_delivery, abs=0.02)


def test_radio_graph_joins_robots_that_a_lone_packet_reaches():
    medium = make_medium(with_access("none"), 3)
    pose = at((0, 0), (90, 0), (230, 0))
    assert medium.step(0, pose).edges.tolist() == [[0, 1]]
    assert medium.step(1, pose, living([True, False, True])).edges.tolist() == []


@given(signal_radios(), st.integers(2, 8), st.integers(0, 1000))
def test_fates_add_up_when_robots_die_and_are_revived(radio: Radio, robots: int, seed: int):
    rng = np.random.default_rng(seed)
    medium = make_medium(radio, robots)
    pose, tally = scattered(robots, seed) * [10.0, 10.0, 1.0], []
    disruption = [random_disruption(robots, rng) for _ in range(6)]
    for tick in range(6):
        other = replace(radio, queue_limit=int(rng.integers(0, 4)), loss=0.2, antenna=Antenna(power_dbm=-3.0))
        new_radio = other if rng.random() < 0.3 else None
        tally.append(medium.step(tick * 10**8, pose, disruption[tick], new_radio).tally)
        living = np.flatnonzero(disruption[tick].alive)
        if len(living):
            medium.send(tick * 10**8, tick, packets(rng.choice(living, 2 * robots)))
    tally.append(medium.end())
    assert sum(t.fates.sum() for t in tally) == sum(t.intended.sum() for t in tally)
    assert min(t.fates.min() for t in tally) >= 0


def random_disruption(robots: int, rng: np.random.Generator) -> Disruption:
    """Some are dead, some have their radio off, some are kept apart."""
    sides = rng.integers(0, 3, (1, robots))
    one_way = rng.integers(0, 3, (int(rng.integers(0, 2)), robots))
    backlog = rng.integers(0, 3, robots)
    gain_db = rng.normal(0.0, 3.0, (2, robots))
    jammers = random_jammers(robots, rng)
    return Disruption(rng.random(robots) < 0.7, rng.random(robots) < 0.8, backlog, sides, one_way, *gain_db, jammers)


def random_jammers(robots: int, rng: np.random.Generator) -> Jammers:
    """Up to three in the one arena, some of them carried."""
    k = int(rng.integers(0, 4))
    period_ns = rng.integers(10**5, 10**8, k)
    return Jammers(
        arena=np.zeros(k, np.int64),
        carrier=rng.integers(NO_ROBOT, robots, k),
        x_m=rng.normal(0.0, 20.0, k),
        y_m=rng.normal(0.0, 20.0, k),
        power_dbm=rng.uniform(-60.0, 20.0, k),
        on_ns=rng.integers(1, period_ns + 1),
        period_ns=period_ns,
        phase_ns=rng.integers(0, period_ns),
    )


@pytest.mark.parametrize("method", METHODS)
def test_unfinished_packets_are_in_flight_at_the_end(method: str):
    """Two frames of each robot, the run over at their first bits."""
    medium = make_medium(with_access(method), 3)
    pose = at((0, 0), (1, 0), (2, 0))
    medium.step(0, pose)
    medium.send(0, 0, packets([0, 0, 1, 1, 2], [BROADCAST] * 4 + [1]))
    first = medium.step(1000, pose)
    last = medium.end()
    assert first.tally.intended.tolist() == [9]
    assert last.fates[0, Fate.IN_FLIGHT] == 9


def test_full_queue_counts_receivers_in_range():
    """Five frames of 90 ms, room for one: three are refused, each with its two receivers in range."""
    radio = replace(with_access("aloha"), bit_rate_bps=2400, queue_limit=1)
    result = run(make_medium(radio, 3), at((0, 0), (1, 0), (2, 0)), lambda _: packets([0] * 5), 1, 4)
    assert result.fates() == {"RECEIVED": 4, "QUEUE_FULL": 6}
    assert result.tally.in_range.tolist() == [10]


def test_obstacle_blocks_only_with_line_of_sight():
    pose = at((-1, -2), (-1, 2), (-2.8, -2))
    for line_of_sight, fates in ((True, {"RECEIVED": 4, "BLOCKED": 2}), (False, {"RECEIVED": 6})):
        radio = replace(with_access("none"), line_of_sight=line_of_sight)
        result = run(make_medium(radio, 3, [1], [OBSTACLES]), pose, everybody(3), 1)
        assert result.fates() == fates


def test_packet_given_up_ticks_after_its_last_attempt_is_lost():
    """Every packet is lost, and waits for its acknowledgement across the ends of ticks."""
    radio = replace(
        with_access("csma-802154"),
        bit_rate_bps=20_000,
        loss=1.0,
        jitter_s=0.1,
        measures=ALL_MEASURES,
        send_offset="uniform",
    )
    to = (np.arange(6) + 1) % 6
    result = run(make_medium(radio, 6), scattered(6), lambda _: packets(np.arange(6), to), 60, 1)
    assert result.fates()["LOST"] > 100


def crowded() -> Run:
    """Five packets of each robot in each of three ticks."""
    radio = replace(with_access("aloha"), queue_limit=9)
    return run(make_medium(radio, ROBOTS), scattered(ROBOTS), lambda _: packets(np.repeat(range(ROBOTS), 5)), 3, 2)


def finished(result: Run) -> list[tuple[int, ...]]:
    """Every link's fate, with when."""
    columns = ("sender", "sequence", "receiver", "fate", "on_air_at_ns", "final_at_ns")
    return sorted(result.rows("finished", *columns))


def test_fates_are_independent_of_the_result_buffer_capacity(monkeypatch: pytest.MonkeyPatch):
    at_once, goes, report = finished(crowded()), set[int](), Reporter.report

    def counted(self: Reporter, parts: list[ResultBuffer], *more: Any) -> None:
        goes.add(len(parts))
        report(self, parts, *more)

    monkeypatch.setattr(Reporter, "report", counted)
    for room in (1, 200, 300, 400):
        monkeypatch.setattr(model, "MIN_CAPACITY", room)
        assert finished(crowded()) == at_once
    assert goes >= {1, 2, 3}


@pytest.mark.parametrize("queue_limit", [0, 9])
def test_dead_robots_are_intended_by_unicast_only(queue_limit: int):
    """Robot 2 is dead; of what a full queue refuses, too, and then it would have been in range."""
    radio = replace(with_access("aloha"), queue_limit=queue_limit, send_offset="tick")
    medium, pose = make_medium(radio, 4), at((0, 0), (1, 0), (0, 1), (500, 0))
    result = Run(medium)
    medium.step(0, pose, living([True, True, False, True]))
    medium.send(0, 0, packets([0, 0, 0, 0], [-1, -1, 2, 1]))
    result.news.append(medium.step(5 * TICK_NS, pose))
    result.last = medium.end()
    refused = {
        0: {"RECEIVED": 1, "OUT_OF_RANGE": 1, "QUEUE_FULL": 4},
        9: {"RECEIVED": 3, "OUT_OF_RANGE": 2, "RECEIVER_DEAD": 1},
    }
    assert result.fates() == refused[queue_limit]
    assert result.tally.intended.tolist() == [6]
    assert result.tally.in_range.tolist() == [4]


def test_packet_queued_at_the_death_of_its_sender_counts_as_in_range():
    """Frames of 90 ms: at 100 ms the second is on air, and the third waits."""
    medium = make_medium(replace(with_access("aloha"), bit_rate_bps=2400, send_offset="tick"), 2)
    result, pose = Run(medium), at((0, 0), (1, 0))
    medium.step(0, pose)
    medium.send(0, 0, packets([0, 0, 0]))
    result.news += [medium.step(TICK_NS, pose, living([False, True])), medium.step(5 * TICK_NS, pose)]
    assert result.fates() == {"RECEIVED": 2, "SENDER_DEAD": 1}
    assert result.tally.in_range.tolist() == [3]


def test_measured_range_is_that_at_the_time_on_air():
    """Two frames that end in the same tick; one went on air in the tick before, when the robots were nearer."""
    radio = replace(with_access("aloha"), bit_rate_bps=10_000, send_offset=0.06, measures=Measures(RangeMeasure(0.0)))
    medium = make_medium(radio, 2)
    result = Run(medium)
    for tick, (x_m, sender, size) in enumerate([(1.0, 0, 90), (2.0, 1, 10), (4.0, 0, 10)]):
        result.news.append(medium.step(tick * TICK_NS, at((0, 0), (x_m, 0))))
        medium.send(tick * TICK_NS, tick, packets([sender], size=size))
    result.news.append(medium.step(4 * TICK_NS, at((0, 0), (4, 0))))
    assert [len(step.received.receiver) for step in result.news] == [0, 0, 2, 1]
    assert result.measured("range_m").tolist() == pytest.approx([2.0, 1.0, 4.0])  # by receiver
