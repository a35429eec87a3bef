"""A sender's radio sends one packet after the other, keeps what waits while it is off, and refuses the rest."""

from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.base.sentinels import NOWHERE, UNDER_WAY
from swarmwire.comms.radio.config.phy import Access
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.counters import PacketCounters
from swarmwire.comms.radio.disruption import ALL, DROP, NEWEST, Disruption
from swarmwire.comms.radio.transmissions import PACKET, Transmissions
from swarmwire.comms.radio.unit_disk.tx_queue import QueueState, TxQueues, enqueue
from swarmwire.comms.robot.packets import Fate, SentPackets
from tests.support.comms.radio import Run, at, make_medium, packets, run, run_disrupted, with_access

PAIR = at((0, 0), (1, 0))
# Ten bytes take 80 ms.
SLOWEST = Radio(2.0, bit_rate_bps=1000, send_offset="tick", queue_limit=4)


def off(backlog: int, *rows: int) -> Disruption:
    now = Disruption.none(2)
    now.radio_on[list(rows)] = False
    now.backlog[:] = backlog
    return now


def one_each(first: int, stop: int, count: int = 1) -> dict[int, SentPackets]:
    return {tick: packets([0] * count) for tick in range(first, stop)}


def blacked_out(backlog: int, sent: dict[int, SentPackets], radio: Radio = SLOWEST, ticks: int = 15) -> Run:
    """The sender's radio is off from 0.2 to 0.8 s."""
    return run_disrupted(make_medium(radio, 2), PAIR, sent, {2: off(backlog, 0), 8: Disruption.none(2)}, ticks)


def on_air_ms(result: Run) -> list[int]:
    return (result.on_air("on_air_at_ns") // 1_000_000).tolist()


def test_backlog_is_dropped_by_default():
    result = blacked_out(DROP, one_each(0, 9))
    assert result.fates() == {"RECEIVED": 3, "BLACKOUT": 6}
    assert on_air_ms(result) == [0, 100, 800]


def test_backlog_of_all_waits_up_to_the_limit_and_sends_in_order():
    """Handed over at 0.2 to 0.8 s: four wait, two find the queue full, and the one at 0.8 s goes last."""
    result = blacked_out(ALL, one_each(0, 9))
    assert result.fates() == {"RECEIVED": 7, "QUEUE_FULL": 2}
    assert on_air_ms(result) == [0, 100, 800, 880, 960, 1040, 1120]
    assert result.received("sequence").tolist() == [0, 1, 2, 3, 4, 5, 8]
    refused = result.finished("receiver") < 0
    assert (result.finished("sent_at_ns")[refused] // 10**8).tolist() == [6, 7]


@pytest.mark.parametrize("limit", [0, 1, 4])
def test_backlog_of_newest_waits_with_any_limit(limit: int):
    result = blacked_out(NEWEST, one_each(0, 8), replace(SLOWEST, queue_limit=limit))
    assert result.fates() == {"RECEIVED": 3, "BLACKOUT": 5}
    assert on_air_ms(result) == [0, 100, 800]
    assert result.received("sequence").tolist() == [0, 1, 7]
    result = blacked_out(NEWEST, {2: packets([0] * 3)}, replace(SLOWEST, queue_limit=limit))
    assert result.received("sequence").tolist() == [2]
    assert result.fates() == {"RECEIVED": 1, "BLACKOUT": 2}


@pytest.mark.parametrize(("on_at", "on_air"), [(8, [100, 180, 800, 880]), (3, [100, 180, 300, 380])])
def test_backlog_keeps_waiting_packets_and_completes_the_frame_on_air(on_at: int, on_air: list[int]):
    """Four packets at 0.1 s begin at 100, 180, 260 and 340 ms: that of 180 ms is on air when the radio goes off."""
    now = {2: off(ALL, 0), on_at: Disruption.none(2)}
    result = run_disrupted(make_medium(SLOWEST, 2), PAIR, {1: packets([0] * 4)}, now, 15)
    assert on_air_ms(result) == on_air
    assert result.fates() == {"RECEIVED": 4}


def test_backlog_waits_for_a_frame_longer_than_the_blackout():
    medium, sent = make_medium(replace(SLOWEST, max_payload_bytes=200), 2), {1: packets([0, 0], size=[100, 10])}
    assert on_air_ms(run_disrupted(medium, PAIR, sent, {2: off(ALL, 0), 3: Disruption.none(2)}, 15)) == [100, 900]


def test_backlog_excludes_packets_that_are_too_large():
    result = blacked_out(ALL, {3: packets([0, 0], size=[101, 10])})
    assert result.fates() == {"RECEIVED": 1, "TOO_LARGE": 1}
    assert result.news[4].tally.fates.sum() == 1


def test_backlog_of_a_robot_that_dies_is_lost():
    dead = off(ALL, 0)
    dead.alive[0] = False
    now = {2: off(ALL, 0), 4: dead, 6: off(ALL, 0), 8: Disruption.none(2)}
    result = run_disrupted(make_medium(SLOWEST, 2), PAIR, {2: packets([0] * 3), 7: packets([0])}, now, 12)
    assert result.fates() == {"RECEIVED": 1, "SENDER_DEAD": 3}
    assert on_air_ms(result) == [800]


def test_backlog_waiting_at_the_end_is_in_flight():
    result = run_disrupted(make_medium(SLOWEST, 2), PAIR, {3: packets([0] * 3)}, {2: off(ALL, 0)}, 6)
    assert result.fates() == {"IN_FLIGHT": 3}


@pytest.mark.parametrize(
    ("stricter", "fates"), [(NEWEST, {"RECEIVED": 1, "BLACKOUT": 2}), (DROP, {"BLACKOUT": 3})], ids=["newest", "drop"]
)
def test_backlog_that_gets_stricter_is_cut_at_once(stricter: int, fates: dict[str, int]):
    now = {2: off(ALL, 0), 5: off(stricter, 0), 8: Disruption.none(2)}
    assert run_disrupted(make_medium(SLOWEST, 2), PAIR, {3: packets([0] * 3)}, now, 12).fates() == fates


def test_backlog_is_independent_of_other_radios():
    """Robot 1 goes on as if nothing were, and its queue does not count for the other's."""
    both = {tick: packets([0, 1, 1]) for tick in range(2, 6)}
    result = blacked_out(ALL, both)
    sender, on_air = result.on_air("sender"), np.array(on_air_ms(result))
    assert on_air[sender == 0].tolist() == [800, 880, 960, 1040]
    assert on_air[sender == 1].tolist() == [200, 280, 360, 440, 520, 600, 680, 760]
    assert result.fates() == {"RECEIVED": 4, "BLACKOUT": 8}


def test_backlog_holds_only_packets_accepted_by_the_radio():
    """Handed over at 0.35 s: the radio of robot 1 is off by then, and of its two packets the first is too large."""
    later = replace(SLOWEST, send_offset=0.25)
    sent, now = {1: packets([0, 0, 1, 1], size=[10, 10, 101, 10])}, {2: off(ALL, 1), 8: Disruption.none(2)}
    result = run_disrupted(make_medium(later, 2), PAIR, sent, now, 12)
    assert result.fates() == {"RECEIVED": 1, "BLACKOUT": 2, "TOO_LARGE": 1}
    assert on_air_ms(result) == [350, 430, 800]
    assert [step.tally.fates[0, Fate.TOO_LARGE] for step in result.news].index(1) == 4


def test_backlog_is_released_by_each_radio_separately():
    """Both are off from 0.2 s on, that of robot 1 until 0.5 s, that of robot 0 until 0.8 s."""
    now = {2: off(ALL, 0, 1), 5: off(ALL, 0), 8: Disruption.none(2)}
    result = run_disrupted(make_medium(SLOWEST, 2), PAIR, {3: packets([0, 0, 1, 1])}, now, 15)
    sender, on_air = result.on_air("sender"), np.array(on_air_ms(result))
    assert on_air[sender == 1].tolist() == [500, 580]
    assert on_air[sender == 0].tolist() == [800, 880]


def test_packets_are_admitted_by_sender_in_any_order_of_arrival():
    table, accounts = Transmissions(), PacketCounters(1, 4)
    queues = TxQueues(SLOWEST, 4, table)
    for before in (0, 2):
        sent = packets([3, 1, 3, 1], to=[0, 2, 2, 3])
        queues.accept(np.zeros(4, np.int64), sent, np.full(4, 3), 7, accounts.counts)
        admitted = table.rows[-4:]
        assert admitted["sender"].tolist() == [1, 1, 3, 3]
        assert admitted["to"].tolist() == [2, 3, 0, 2]
        assert (admitted["sequence"] - before).tolist() == [0, 1, 0, 1]
        assert table.data[admitted["first_byte"]].tolist() == [1, 3, 0, 2]
        assert (admitted["intended"].tolist(), admitted["epoch"].tolist()) == ([1] * 4, [7] * 4)
    assert (accounts.counts["sent"].tolist(), accounts.counts["intended"].tolist()) == ([8], [8])


def test_packets_to_nobody_are_admitted_without_receivers():
    table, sent = Transmissions(), packets([0, 0, 1], to=[NOWHERE, 1, NOWHERE])
    queues = TxQueues(SLOWEST, 2, table)
    queues.accept(np.zeros(3, np.int64), sent, np.ones(2, np.int64), 0, PacketCounters(1, 2).counts)
    assert (table.rows["sender"].tolist(), table.rows["sequence"].tolist()) == ([0, 0, 1], [0, 1, 0])
    assert (table.rows["to"].tolist(), table.rows["intended"].tolist()) == ([NOWHERE, 1, NOWHERE], [0, 1, 0])


AIRTIME_NS = 1_000_000
SENDERS, WARM_UP, PACKETS = 1500, 150, 400
STANDARD_ERRORS = 4.4


@pytest.mark.parametrize(("load", "stated"), [(0.5, 0.5), (0.8, 2.0), (0.9, 4.5)])
def test_queue_wait_at_random_arrivals_matches_theory(load: float, stated: float):
    """Mean wait rho / (2 (1 - rho)) airtimes; 4.4 standard errors over independent senders (1 in 90,000).

    At a load of 0.9 a queue forgets that it was empty in some 100 airtimes, which the warm-up leaves out.
    """
    gaps_ns = np.random.default_rng(7).exponential(AIRTIME_NS / load, (WARM_UP + PACKETS, SENDERS))
    sent_at_ns = np.cumsum(gaps_ns, axis=0).astype(np.int64)
    wait, table, used = np.zeros(SENDERS), np.zeros(SENDERS, PACKET), np.array([SENDERS, 0])
    queue = QueueState(np.zeros(SENDERS, np.int64), np.full(SENDERS, 10**9), np.full(SENDERS, DROP))
    table["sender"] = np.arange(SENDERS)
    for k, at_ns in enumerate(sent_at_ns):
        table["fate"], table["sent_at_ns"] = UNDER_WAY, at_ns
        enqueue(table, used, 0, queue, 0, np.array([AIRTIME_NS]))
        assert (table["fate"] == UNDER_WAY).all()
        if k >= WARM_UP:
            wait += (table["on_air_at_ns"] - at_ns) / AIRTIME_NS / PACKETS
    assert load / (2.0 * (1.0 - load)) == pytest.approx(stated, rel=1e-12)
    assert abs(wait.mean() - stated) < STANDARD_ERRORS * wait.std() / np.sqrt(SENDERS)


def test_phy_queue_equals_the_unit_disk_queue():
    """Without access there is nothing else to wait for: the same packets go on air at the same instants."""
    signals = replace(with_access("none"), send_offset="uniform", bit_rate_bps=20_000, queue_limit=3)
    assert signals.access == Access("none")
    sizes = {"overhead_bytes": signals.overhead_bytes, "max_payload_bytes": signals.max_payload_bytes}
    disk = Radio(9.0, bit_rate_bps=20_000, queue_limit=3, **sizes)
    draws, tables = np.random.default_rng(3), []
    sent = [packets(draws.integers(0, 3, 20), size=draws.integers(1, 100, 20)) for _ in range(20)]
    for radio in (signals, disk):
        result = run(make_medium(radio, 3), at((0, 0), (1, 0), (0, 1)), sent.__getitem__, 20, 30)
        tables.append(sorted(result.rows("finished", "sender", "sequence", "receiver", "on_air_at_ns", "fate")))
    assert len({row[3] for row in tables[0]}) > 50
    assert tables[0] == tables[1]
