"""A sender's radio sends one packet after the other, keeps what waits while it is off, and refuses the rest."""

from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.base.sentinels import NOWHERE, UNDER_WAY
from swarmwire.comms.radio.config.phy import Access
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.disruption import ALL, DROP, NEWEST, Disruption
from swarmwire.comms.radio.transmissions import COLUMNS, FATE, ON_AIR_AT, SENDER, SENT_AT, Admission
from swarmwire.comms.radio.unit_disk.tx_queue import enqueue
from swarmwire.comms.robot.packets import Fate, SentPackets
from tests.support.comms.radio import TICK_NS, Run, at, make_medium, packets, run, run_disrupted, with_access

TRIO = at((0, 0), (1, 0), (9, 0))
SLOW = Radio(2.0, bit_rate_bps=4000, send_offset="tick")  # 10 bytes take 20 ms


def test_packets_of_one_sender_follow_each_other_without_gap():
    """First in, first out; another sender does not wait for them."""
    told = run(make_medium(SLOW, 3), TRIO, lambda _: packets([0, 0, 1, 0], size=[10, 5, 10, 10]), 1)
    times = {
        (int(s), int(n)): int(t)
        for s, n, t in zip(told.on_air("sender"), told.on_air("sequence"), told.on_air("on_air_at_ns"), strict=True)
    }
    assert times == {(0, 0): 0, (0, 1): 20_000_000, (0, 2): 30_000_000, (1, 0): 0}
    assert (told.on_air("sent_at_ns") == 0).all()


@pytest.mark.parametrize("limit", [0, 1, 3])
def test_full_queue_refuses_for_every_intended_receiver(limit: int):
    """One packet is on air and `limit` wait; the refused count as in range where they would have been received."""
    radio = Radio(2.0, bit_rate_bps=4000, send_offset="tick", queue_limit=limit)
    told = run(make_medium(radio, 3), TRIO, lambda _: packets([0] * 5), 1, 3)
    assert told.on_air("sequence").tolist() == list(range(limit + 1))
    assert told.fates() == {"RECEIVED": limit + 1, "OUT_OF_RANGE": limit + 1, "QUEUE_FULL": 2 * (4 - limit)}
    assert told.tally.in_range.tolist() == [5]


def test_full_queue_counts_no_blocked_receiver_in_range():
    radio = Radio(2.0, line_of_sight=True, bit_rate_bps=4000, send_offset="tick", queue_limit=0)
    medium = make_medium(radio, 3, obstacles=[[Obstacle("cylinder", 0.5, 0.0, radius_m=0.1)]])
    told = run(medium, at((0, 0), (1, 0), (0, 1)), lambda _: packets([0, 0]), 1, 3)
    assert told.fates() == {"RECEIVED": 1, "BLOCKED": 1, "QUEUE_FULL": 2}
    assert told.tally.in_range.tolist() == [2]


def test_queue_empties_as_time_passes():
    """Packets of 60 ms, two per tick of 100 ms, and room for one: with every other tick one more is refused."""
    radio = Radio(2.0, bit_rate_bps=4000, send_offset="tick", queue_limit=1)
    told = run(make_medium(radio, 2), at((0, 0), (1, 0)), lambda _: packets([0, 0], size=30), 6, 3)
    on_air_ms = (told.on_air("on_air_at_ns") // 10**6).tolist()
    assert on_air_ms == [0, 60, 120, 200, 260, 320, 400, 460, 520]
    assert told.fates() == {"RECEIVED": 9, "QUEUE_FULL": 3}
    assert (np.diff(told.on_air("sequence")) > 0).all()


def test_queue_counts_packets_of_earlier_ticks():
    """Packets of 60 ms and room for three: 120 and 180 ms still wait at 100 ms, 240 ms at 200 ms."""
    radio = Radio(2.0, bit_rate_bps=4000, send_offset="tick", queue_limit=3)
    told = run(make_medium(radio, 2), at((0, 0), (1, 0)), lambda _: packets([0] * 5, size=30), 3, 6)
    assert told.on_air("sequence").tolist() == [0, 1, 2, 3, 5, 10, 11]
    assert told.on_air("on_air_at_ns")[-3:].tolist() == [240_000_000, 300_000_000, 360_000_000]


def test_refused_packets_are_numbered():
    """And a packet too large takes no time on air: the next goes out at once."""
    told = run(make_medium(SLOW, 2), at((0, 0), (1, 0)), lambda _: packets([0, 0], size=[101, 100]), 1, 3)
    assert told.received("sequence").tolist() == [1]
    assert told.on_air("on_air_at_ns").tolist() == [0]


def test_payload_above_the_maximum_is_too_large_for_every_receiver():
    """Overhead does not count, and nobody was in range of it."""
    radio = Radio(2.0, max_payload_bytes=10, overhead_bytes=50, send_offset="tick")
    told = run(make_medium(radio, 3), TRIO, lambda _: packets([0, 0, 1], [-1, -1, 2], [11, 10, 11]), 1)
    assert told.fates() == {"TOO_LARGE": 3, "RECEIVED": 1, "OUT_OF_RANGE": 1}
    assert told.tally.in_range.tolist() == [1]


def test_refusal_is_final_when_the_packet_was_sent():
    """Offset 150 ms: in the second tick, whose poses tell who would have been in range."""
    radio = Radio(2.0, bit_rate_bps=1000, send_offset=0.15, queue_limit=0)  # on air for 80 ms
    medium = make_medium(radio, 2)
    near = at((0, 0), (1, 0))
    medium.step(0, at((0, 0), (3, 0)))
    medium.send(0, 0, packets([0, 0]))
    assert medium.step(TICK_NS, near).tally.fates.sum() == 0
    tally = medium.step(2 * TICK_NS, near).tally
    assert tally.fates[0].sum() == tally.fates[0, Fate.QUEUE_FULL] == 1
    assert tally.in_range.tolist() == [1]


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


def on_air_ms(told: Run) -> list[int]:
    return (told.on_air("on_air_at_ns") // 1_000_000).tolist()


def test_backlog_is_dropped_by_default():
    told = blacked_out(DROP, one_each(0, 9))
    assert told.fates() == {"RECEIVED": 3, "BLACKOUT": 6}
    assert on_air_ms(told) == [0, 100, 800]


def test_backlog_of_all_waits_up_to_the_limit_and_sends_in_order():
    """Handed over at 0.2 to 0.8 s: four wait, two find the queue full, and the one at 0.8 s goes last."""
    told = blacked_out(ALL, one_each(0, 9))
    assert told.fates() == {"RECEIVED": 7, "QUEUE_FULL": 2}
    assert on_air_ms(told) == [0, 100, 800, 880, 960, 1040, 1120]
    assert told.received("sequence").tolist() == [0, 1, 2, 3, 4, 5, 8]
    refused = told.finished("receiver") < 0
    assert (told.finished("sent_at_ns")[refused] // 10**8).tolist() == [6, 7]


@pytest.mark.parametrize("limit", [0, 1, 4])
def test_backlog_of_newest_waits_with_any_limit(limit: int):
    told = blacked_out(NEWEST, one_each(0, 8), replace(SLOWEST, queue_limit=limit))
    assert told.fates() == {"RECEIVED": 3, "BLACKOUT": 5}
    assert on_air_ms(told) == [0, 100, 800]
    assert told.received("sequence").tolist() == [0, 1, 7]
    told = blacked_out(NEWEST, {2: packets([0] * 3)}, replace(SLOWEST, queue_limit=limit))
    assert told.received("sequence").tolist() == [2]
    assert told.fates() == {"RECEIVED": 1, "BLACKOUT": 2}


def test_backlog_keeps_waiting_packets_and_completes_the_frame_on_air():
    """Four packets at 0.1 s begin at 100, 180, 260 and 340 ms: that of 180 ms is on air when the radio goes off."""
    told = blacked_out(ALL, {1: packets([0] * 4)})
    assert on_air_ms(told) == [100, 180, 800, 880]
    assert told.fates() == {"RECEIVED": 4}


def test_backlog_waits_for_a_frame_longer_than_the_blackout():
    long_ = replace(SLOWEST, max_payload_bytes=200)
    sent = {1: packets([0, 0], size=[100, 10])}
    now = {2: off(ALL, 0), 3: Disruption.none(2)}
    told = run_disrupted(make_medium(long_, 2), PAIR, sent, now, 15)
    assert on_air_ms(told) == [100, 900]


def test_backlog_excludes_packets_that_are_too_large():
    told = blacked_out(ALL, {3: packets([0, 0], size=[101, 10])})
    assert told.fates() == {"RECEIVED": 1, "TOO_LARGE": 1}
    assert told.news[4].tally.fates.sum() == 1


def test_backlog_of_a_robot_that_dies_is_lost():
    dead = off(ALL, 0)
    dead.alive[0] = False
    now = {2: off(ALL, 0), 4: dead, 6: off(ALL, 0), 8: Disruption.none(2)}
    told = run_disrupted(make_medium(SLOWEST, 2), PAIR, {2: packets([0] * 3), 7: packets([0])}, now, 12)
    assert told.fates() == {"RECEIVED": 1, "SENDER_DEAD": 3}
    assert on_air_ms(told) == [800]


def test_backlog_waiting_at_the_end_is_in_flight():
    told = run_disrupted(make_medium(SLOWEST, 2), PAIR, {3: packets([0] * 3)}, {2: off(ALL, 0)}, 6)
    assert told.fates() == {"IN_FLIGHT": 3}


def test_backlog_that_gets_stricter_is_cut_at_once():
    sent = {3: packets([0] * 3)}
    told = run_disrupted(
        make_medium(SLOWEST, 2), PAIR, sent, {2: off(ALL, 0), 5: off(NEWEST, 0), 8: Disruption.none(2)}, 12
    )
    assert told.fates() == {"RECEIVED": 1, "BLACKOUT": 2}
    told = run_disrupted(
        make_medium(SLOWEST, 2), PAIR, sent, {2: off(ALL, 0), 5: off(DROP, 0), 8: Disruption.none(2)}, 12
    )
    assert told.fates() == {"BLACKOUT": 3}


def test_backlog_is_independent_of_other_radios():
    """Robot 1 goes on as if nothing were, and its queue does not count for the other's."""
    both = {tick: packets([0, 1, 1]) for tick in range(2, 6)}
    told = blacked_out(ALL, both)
    sender, on_air = told.on_air("sender"), np.array(on_air_ms(told))
    assert on_air[sender == 0].tolist() == [800, 880, 960, 1040]
    assert on_air[sender == 1].tolist() == [200, 280, 360, 440, 520, 600, 680, 760]
    assert told.fates() == {"RECEIVED": 4, "BLACKOUT": 8}


def test_backlog_holds_only_packets_accepted_by_the_radio():
    """Handed over at 0.35 s: the radio of robot 1 is off by then, and of its two packets the first is too large."""
    later = replace(SLOWEST, send_offset=0.25)
    sent, now = {1: packets([0, 0, 1, 1], size=[10, 10, 101, 10])}, {2: off(ALL, 1), 8: Disruption.none(2)}
    told = run_disrupted(make_medium(later, 2), PAIR, sent, now, 12)
    assert told.fates() == {"RECEIVED": 1, "BLACKOUT": 2, "TOO_LARGE": 1}
    assert on_air_ms(told) == [350, 430, 800]
    assert [one.tally.fates[0, Fate.TOO_LARGE] for one in told.news].index(1) == 4


def test_backlog_starts_after_the_frame_on_air_has_ended():
    """As above, but the radio is on again at 300 ms: the second frame has ended at 260."""
    told = run_disrupted(
        make_medium(SLOWEST, 2), PAIR, {1: packets([0] * 4)}, {2: off(ALL, 0), 3: Disruption.none(2)}, 15
    )
    assert on_air_ms(told) == [100, 180, 300, 380]


def test_backlog_is_released_by_each_radio_separately():
    """Both are off from 0.2 s on, that of robot 1 until 0.5 s, that of robot 0 until 0.8 s."""
    now = {2: off(ALL, 0, 1), 5: off(ALL, 0), 8: Disruption.none(2)}
    told = run_disrupted(make_medium(SLOWEST, 2), PAIR, {3: packets([0, 0, 1, 1])}, now, 15)
    sender, on_air = told.on_air("sender"), np.array(on_air_ms(told))
    assert on_air[sender == 1].tolist() == [500, 580]
    assert on_air[sender == 0].tolist() == [800, 880]


def test_airtime_covers_payload_and_frame_overhead():
    radio = Radio(2.0, bit_rate_bps=1000, overhead_bytes=6, max_payload_bytes=10, send_offset="tick")
    told = run(make_medium(radio, 2), PAIR, lambda _: packets([0, 0, 0], size=[10, 11, 10]), 1, 4)
    assert (told.received("received_at_ns") // 10**6).tolist() == [128, 256]
    departed = [one.departed for one in told.news]
    lasts_ns = np.concatenate([of.off_air_at_ns - of.on_air_at_ns for of in departed])
    fate = np.concatenate([of.fate for of in departed])
    assert sorted(zip(fate.tolist(), (lasts_ns // 1000).tolist(), strict=True)) == [
        (Fate.RECEIVED, 128_000),
        (Fate.RECEIVED, 128_000),
        (Fate.TOO_LARGE, 0),
    ]
    assert lasts_ns[fate == Fate.TOO_LARGE].tolist() == [0]


def test_packets_are_admitted_by_sender_in_any_order_of_arrival():
    intake = Admission(4)
    for before in (0, 2):
        taken = intake.admit(np.zeros(4, np.int64), packets([3, 1, 3, 1], to=[0, 1, 2, 3]), np.full(4, 3), 7)
        assert taken.sender.tolist() == [1, 1, 3, 3]
        assert taken.to.tolist() == [1, 3, 0, 2]
        assert (taken.sequence - before).tolist() == [0, 1, 0, 1]
        assert [taken.payloads.row(k)[0] for k in range(4)] == [1, 3, 0, 2]
        assert (taken.intended.tolist(), taken.epoch.tolist()) == ([1] * 4, [7] * 4)


def test_packets_to_nobody_are_admitted_without_receivers():
    taken = Admission(2).admit(
        np.zeros(3, np.int64), packets([0, 0, 1], to=[NOWHERE, 1, NOWHERE]), np.ones(2, np.int64), 0
    )
    assert (taken.sender.tolist(), taken.sequence.tolist()) == ([0, 0, 1], [0, 1, 0])
    assert (taken.to.tolist(), taken.intended.tolist()) == ([NOWHERE, 1, NOWHERE], [0, 1, 0])


AIRTIME_NS = 1_000_000
SENDERS, WARM_UP, PACKETS = 1500, 150, 400
STANDARD_ERRORS = 4.4
NOBODY = np.empty((COLUMNS, 0), np.int64)


@pytest.mark.parametrize(("load", "stated"), [(0.5, 0.5), (0.8, 2.0), (0.9, 4.5)])
def test_queue_wait_at_random_arrivals_matches_theory(load: float, stated: float):
    """Mean wait rho / (2 (1 - rho)) airtimes; 4.4 standard errors over independent senders (1 in 90,000).

    At a load of 0.9 a queue forgets that it was empty in some 100 airtimes, which the warm-up leaves out.
    """
    gaps_ns = np.random.default_rng(7).exponential(AIRTIME_NS / load, (WARM_UP + PACKETS, SENDERS))
    sent_at_ns = np.cumsum(gaps_ns, axis=0).astype(np.int64)
    free_at_ns, wait = np.zeros(SENDERS, np.int64), np.zeros(SENDERS)
    sizes, limit = np.zeros(SENDERS + 1, np.int64), np.full(SENDERS, 10**9)
    packets = np.zeros((COLUMNS, SENDERS), np.int64)
    packets[SENDER] = np.arange(SENDERS)
    for k, at_ns in enumerate(sent_at_ns):
        packets[FATE], packets[SENT_AT] = UNDER_WAY, at_ns
        enqueue(free_at_ns, NOBODY, packets, sizes, 0, np.array([AIRTIME_NS]), limit)
        assert (packets[FATE] == UNDER_WAY).all()
        if k >= WARM_UP:
            wait += (packets[ON_AIR_AT] - at_ns) / AIRTIME_NS / PACKETS
    assert load / (2.0 * (1.0 - load)) == pytest.approx(stated, rel=1e-12)
    assert abs(wait.mean() - stated) < STANDARD_ERRORS * wait.std() / np.sqrt(SENDERS)


def test_phy_queue_equals_the_unit_disk_queue():
    """Without access there is nothing else to wait for: the same packets go on air at the same instants."""
    signals = replace(with_access("none"), send_offset="uniform", bit_rate_bps=20_000, queue_limit=3)
    assert signals.access == Access("none")
    disk = Radio(
        9.0,
        bit_rate_bps=20_000,
        overhead_bytes=signals.overhead_bytes,
        max_payload_bytes=signals.max_payload_bytes,
        queue_limit=3,
    )
    found = []
    for radio in (signals, disk):
        draws = np.random.default_rng(3)
        told = run(
            make_medium(radio, 3),
            at((0, 0), (1, 0), (0, 1)),
            lambda _, draws=draws: packets(draws.integers(0, 3, 20), size=draws.integers(1, 100, 20)),
            20,
            30,
        )
        columns = [told.finished(name) for name in ("sender", "sequence", "receiver", "on_air_at_ns", "fate")]
        found.append(sorted(zip(*(column.tolist() for column in columns), strict=True)))
    assert len({row[3] for row in found[0]}) > 50
    assert found[0] == found[1]
