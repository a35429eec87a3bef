"""What is delivered: the accounts of arenas, robots and links, airtime and throughput, against sums over packets."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.robot.packets import FATE_NAMES, Fate
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.measures.network.latency import RadioTally
from swarmwire.metrics.records.run_folder import radio_totals as links_table
from swarmwire.metrics.records.run_folder.radio_totals import LinkCounts, RobotCounts
from tests.support.comms.radio import make_medium, packets
from tests.support.metrics.radio import radio_runs, rows_of
from tests.support.metrics.recorded import links
from tests.support.metrics.truths import departed, finished, static, tally, truth, watch


def tallied(run, *ticks, last=None):
    observer = RadioTally()
    watch(run, (truth(run, tick, **fields) for tick, fields in enumerate(ticks)), observer)
    return observer.end(last)["radio"]


def test_fates_add_up_to_the_intended_receivers_with_what_was_in_flight():
    ticks = [
        {"tally": tally({Fate.RECEIVED: 6, Fate.LOST: 2}, {Fate.OUT_OF_RANGE: 3})},
        {"tally": tally({Fate.RECEIVED: 1, Fate.BLOCKED: 4}, {})},
    ]
    first, second = tallied(static(arenas=2), *ticks, last=tally({Fate.IN_FLIGHT: 5}, {Fate.IN_FLIGHT: 1}, sent=0))
    assert first["fates"] == {**dict.fromkeys(FATE_NAMES, 0), "received": 7, "lost": 2, "blocked": 4, "in_flight": 5}
    assert sum(first["fates"].values()) == first["intended"] == 18
    assert sum(second["fates"].values()) == second["intended"] == 4
    assert first["sent"] == 2


def test_pdr_is_received_over_intended_and_link_pdr_over_in_range_null_without_any():
    some = {Fate.RECEIVED: 3, Fate.LOST: 1, Fate.OUT_OF_RANGE: 9}
    summaries = tallied(static(arenas=3), {"tally": tally(some, {Fate.OUT_OF_RANGE: 3}, {})})
    assert [(arena["pdr"], arena["link_pdr"]) for arena in summaries] == [(3 / 13, 0.75), (0.0, None), (None, None)]


def test_latency_on_air_ends_at_hearing_and_to_the_agent_at_the_tick_that_hands_it_over():
    [summary] = tallied(static(), {"tally": tally({})}, {"finished": finished([40_000_000], [65_000_000])})
    assert summary["latency_air_s"] == {p: pytest.approx(0.025, rel=0.005) for p in ("p50", "p90", "p99")}
    assert summary["latency_agent_s"] == {p: pytest.approx(0.06, rel=0.005) for p in ("p50", "p90", "p99")}


def test_latency_is_null_where_no_packet_was_received():
    lost = finished([0], [50_000_000], fate=Fate.LOST)
    [summary] = tallied(static(), {"tally": tally({Fate.LOST: 1}), "finished": lost})
    assert summary["latency_air_s"] == {"p50": None, "p90": None, "p99": None}


def test_without_a_radio_the_summary_has_no_part_of_it():
    run, observer = static(radio=False), RadioTally()
    observer.begin(run)
    observer.see(truth(run))
    assert observer.end(None) == {}


@given(st.lists(st.lists(st.integers(0, 9), min_size=len(Fate), max_size=len(Fate)), max_size=5))
def test_fates_of_a_run_are_the_sums_over_its_ticks(ticks):
    table = np.array(ticks, np.int64).reshape(-1, len(Fate))
    tallies = [{"tally": tally(dict(zip(Fate, row, strict=True)))} for row in ticks]
    [summary] = tallied(static(), *tallies, last=tally({}))
    assert list(summary["fates"].values()) == table.sum(axis=0).tolist()
    assert sum(summary["fates"].values()) == summary["intended"]


def test_robot_counts_cover_packets_it_sent_and_those_meant_for_it():
    counts = RobotCounts(static(3, arenas=2))
    refused = links([2], [-1], 4, 0, fate=Fate.QUEUE_FULL, receivers=2, arena=1)
    counts.add(departed([2], intended=2, fate=Fate.QUEUE_FULL, arena=1), refused)
    ended = links([0, 0], [1, 2], 7, 0, fate=[Fate.RECEIVED, Fate.LOST], arena=1)
    counts.add(departed([0], intended=5, out_of_range=2, on_air_at_ns=10, off_air_at_ns=40, arena=1), ended)
    assert counts.packets.tolist() == [0, 0, 0, 1, 0, 1]
    assert counts.packets_on_air.tolist() == [0, 0, 0, 1, 0, 0]
    assert counts.on_air_ns.tolist() == [0, 0, 0, 30, 0, 0]
    assert counts.intended.tolist() == [0, 0, 0, 5, 0, 2]
    assert counts.in_flight.tolist() == [0, 0, 0, 1, 0, 0]  # received, lost, two out of range, and one to come
    expected = {Fate.RECEIVED: 1, Fate.LOST: 1, Fate.OUT_OF_RANGE: 2}
    assert counts.as_sender[3].tolist() == [expected.get(fate, 0) for fate in Fate]
    assert counts.as_sender[5, Fate.QUEUE_FULL] == 2
    assert (counts.as_receiver[4, Fate.RECEIVED], counts.as_receiver[5, Fate.LOST]) == (1, 1)
    assert counts.as_receiver.sum() == 2
    assert counts.received_bytes.tolist() == [0, 0, 0, 0, ended.size_bytes[0], 0]


@settings(max_examples=25)
@given(radio_runs())
def test_robots_have_what_counters_have(run):
    run, truths = run
    counts, as_sender, as_receiver, got, packets = RobotCounts(run), Counter(), Counter(), Counter(), Counter()
    tally = np.zeros((run.arenas, len(Fate)), np.int64)
    for one in truths:
        counts.add(one.departed, one.finished)
        tally += one.tally.fates
        columns = ("arena", "sender", "receiver", "receivers", "fate", "size_bytes")
        for arena, sender, receiver, receivers, fate, size in rows_of(one.finished, *columns):
            as_sender[arena, sender, fate] += receivers
            if receiver >= 0:
                as_receiver[arena, receiver, fate] += 1
                got[arena, receiver] += size if fate == Fate.RECEIVED else 0
        for arena, sender, far in rows_of(one.departed, "arena", "sender", "out_of_range"):
            as_sender[arena, sender, Fate.OUT_OF_RANGE] += far
            packets[arena, sender] += 1
    robots = [divmod(row, run.robots) for row in range(run.arenas * run.robots)]
    assert counts.as_sender.tolist() == [[as_sender[*robot, fate] for fate in Fate] for robot in robots]
    assert counts.as_receiver.tolist() == [[as_receiver[*robot, fate] for fate in Fate] for robot in robots]
    assert counts.received_bytes.tolist() == [got[robot] for robot in robots]
    assert counts.packets.tolist() == [packets[robot] for robot in robots]
    assert (counts.in_flight >= 0).all()
    np.testing.assert_array_equal(counts.as_sender.reshape(run.arenas, run.robots, -1).sum(axis=1), tally)


@pytest.mark.parametrize("waiting", [1, 20, 10**6])
@settings(max_examples=10)
@given(run=radio_runs())
def test_links_have_what_a_counter_has_however_often_they_are_added_up(waiting, run):
    run, truths = run
    counts, expected = LinkCounts(run), Counter()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(links_table, "MAX_PENDING_ROWS", waiting)
        for one in truths:
            counts.add(one.departed, one.finished)
            expected.update(row for row in rows_of(one.finished, "arena", "sender", "receiver", "fate") if row[2] >= 0)
        columns = counts.columns()
    *link, packets = (column.tolist() for column in columns.values())
    assert dict(zip(zip(*link, strict=True), packets, strict=True)) == expected
    assert list(zip(*link, strict=True)) == sorted(expected)


MS = 1_000_000
TICK_MS = 100


def test_airtime_and_throughput_of_steady_senders_match_the_radio():
    """Airtime 8 x bytes x rate / bit rate; throughput n (n - 1) (1 - p) x 8 x bytes x rate, within 3 %: 5 deviations.

    A packet that goes on air late in a tick counts in the next: of 30 packets of a robot that moves at most one.
    """
    run, size, lost, radio = static(20), 25, 0.3, Radio(range_m=50.0, loss=0.3, bit_rate_bps=20_000, overhead_bytes=5)
    air, metrics, values = make_medium(radio, run.robots, run.seeds, [()]), Metrics(["airtime", "throughput"]), []
    metrics.begin(run)
    for tick in range(31):
        news = air.step(tick * TICK_MS * MS, np.zeros((20, 3)))
        metrics.see(truth(run, tick, finished=news.finished, departed=news.departed))
        values.append([metrics.latest[name][0] for name in ("airtime", "throughput")])
        air.send(tick * TICK_MS * MS, tick, packets(np.arange(20), size=np.full(20, size)))
    share, bits = np.mean(values[1:], axis=0)
    assert share == pytest.approx(8 * (size + 5) * 10 / 20_000, rel=1 / 30)
    assert bits == pytest.approx(20 * 19 * (1 - lost) * 8 * size * 10, rel=0.03)


@settings(max_examples=25)
@given(radio_runs())
def test_airtime_and_throughput_are_sums_over_packets(run):
    run, truths = run
    metrics = Metrics(["airtime", "throughput"])
    metrics.begin(run)
    owed_ns = Counter()
    for one in truths:
        metrics.see(one)
        for arena, sender, fate, on, off in rows_of(
            one.departed, "arena", "sender", "fate", "on_air_at_ns", "off_air_at_ns"
        ):
            assert off >= on if fate == Fate.RECEIVED else off == on
            owed_ns[arena, sender] += off - on
        share, bits = np.zeros(run.arenas), np.zeros(run.arenas)
        alive = one.alive.reshape(run.arenas, run.robots)
        for arena, robot in list(owed_ns):
            counted_ns = min(owed_ns[arena, robot], TICK_MS * MS)
            owed_ns[arena, robot] -= counted_ns
            share[arena] += counted_ns / (TICK_MS * MS) / alive[arena].sum() if alive[arena, robot] else 0.0
        for arena, fate, size in rows_of(one.finished, "arena", "fate", "size_bytes"):
            bits[arena] += 8 * size if fate == Fate.RECEIVED else 0
        assert metrics.latest["airtime"] == pytest.approx(share)
        assert metrics.latest["throughput"] == pytest.approx(bits * run.rate_hz)
