"""Delivery, latency and age of the messages in robots' logs, computed by hand."""

import numpy as np
import polars as pl
import pytest

from examples.middleware import delivery, node
from examples.middleware.delivery import ALL, RECORD, Logs, age_s, messages_of, results, sent_late_p99_ms

START_NS = 7_000_000_000


def records(*rows):
    """Records of (time of arrival in s, kind, sender, receiver, number, time of sending in s)."""
    ns = [(at, kind, sender, to, number, sent) for at, kind, sender, to, number, sent in rows]
    return np.array(
        [(START_NS + round(at * 1e9), k, s, to, n, START_NS + round(sent * 1e9)) for at, k, s, to, n, sent in ns],
        RECORD,
    )


def logs(*messages, begin_s=0.0, halves=(True, False), split_s=(20.0, 40.0), end_s=60.0):
    """Logs of messages (topic, sender, receiver, sent_s, received_s)."""
    names = ("topic", "sender", "receiver", "sent_s", "received_s")
    return Logs(
        pl.DataFrame(list(messages), schema=list(names), orient="row"), begin_s, np.array(halves), split_s, end_s
    )


def of_topic(topic, result):
    return next(row for row in results(result) if row["topic"] == topic)


def test_record_is_that_of_the_programs():
    assert RECORD.itemsize == node.RECORD.size
    head = node.HEAD.pack(node.STATE, 3, ALL, 9, 5)
    record = np.frombuffer(node.RECORD.pack(8, *node.HEAD.unpack(head)), RECORD)[0]
    assert record.tolist() == (8, b"s", 3, 255, 9, 5)
    assert set(delivery.TOPICS.values()) == set(node.SIZES_BYTES)


def test_messages_have_a_row_for_each_robot_that_they_are_for_and_their_first_arrival():
    sent = records((1.0, b"s", 0, ALL, 0, 1.0), (2.0, b"c", 0, 2, 1, 2.0))
    arrived = {
        0: records(),
        1: records((1.5, b"s", 0, ALL, 0, 1.0), (1.2, b"s", 0, ALL, 0, 1.0)),
        2: records((2.25, b"c", 0, 2, 1, 2.0)),
    }
    assert messages_of(sent, arrived, START_NS).rows() == [
        ("command", 0, 2, 2.0, 2.25),
        ("state", 0, 1, 1.0, 1.2),
        ("state", 0, 2, 1.0, None),
    ]


def test_sent_late_is_behind_the_earliest_state_of_each_program(tmp_path):
    assert 1e3 * node.PERIODS_S[node.STATE] == delivery.STATE_PERIOD_MS
    for robot, late_s in enumerate([0.0, 0.05]):
        (folder := tmp_path / "programs" / f"team-{robot}").mkdir(parents=True)
        sent_s = [1.0 + robot + 0.1 * k + (late_s if k == 1 else 0.0) for k in range(3)]
        rows = [(at_s, b"s", robot, ALL, k, at_s) for k, at_s in enumerate(sent_s)]
        (folder / "sent.bin").write_bytes(records(*rows, (9.0, b"m", robot, ALL, 9, 9.0)).tobytes())
    assert sent_late_p99_ms(tmp_path) == pytest.approx(np.percentile([0, 0, 0, 0, 50, 0], 99))


def test_age_is_that_of_the_newest_message_also_if_older_ones_arrive_after_it():
    sent_s, received_s = np.array([1.0, 2.0, 3.0]), np.array([1.5, 4.0, 3.5])
    ages_s = age_s(sent_s, received_s, np.array([1.0, 1.5, 3.0, 3.5, 4.0]))
    assert ages_s.tolist() == [1.0, 0.5, 2.0, 0.5, 1.0]
    assert age_s(np.empty(0), np.empty(0), np.array([4.0])).tolist() == [4.0]
    assert age_s(np.empty(0), np.empty(0), np.array([4.0]), begin_s=1.0).tolist() == [3.0]


def test_delivery_counts_by_phase_and_by_half():
    result = logs(
        ("state", 0, 1, 11.0, 11.25),  # before the split
        ("state", 0, 1, 12.0, None),
        ("state", 1, 0, 12.0, 12.75),
        ("state", 0, 1, 25.0, 45.0),  # across it, late
        ("state", 1, 0, 25.0, None),
        ("state", 2, 0, 25.0, 25.1),  # within a half
        ("state", 0, 1, 41.0, None),  # neither settled
        ("state", 0, 1, 51.0, 51.1),
        ("state", 0, 1, 59.0, None),  # nor early enough to arrive
        halves=(True, False, True),
    )
    row = of_topic("state", result)
    assert row["delivery_before"] == pytest.approx(2 / 3)
    assert row["delivery_across"] == pytest.approx(1 / 2)
    assert (row["delivery_within"], row["delivery_after"]) == (1.0, 1.0)
    assert (row["latency_p50_ms"], row["latency_p99_ms"]) == pytest.approx((500.0, 745.0))
    assert of_topic("map", result)["delivery_before"] is None


def test_discovery_and_recovery_are_times_to_the_first_message_of_a_pair():
    result = logs(
        ("state", 0, 1, 1.0, 3.0),
        ("state", 0, 1, 2.0, 2.5),
        ("state", 1, 0, 2.0, 6.0),
        ("state", 2, 0, 2.0, None),
        ("state", 0, 1, 39.0, 40.5),  # sent before the end of the split
        ("state", 0, 1, 41.0, 47.0),
        ("state", 1, 0, 41.0, None),
        begin_s=0.5,
        halves=(True, False, True),
    )
    row = of_topic("state", result)
    assert (row["pairs"], row["discovered"], row["discovery_p50_s"], row["discovery_max_s"]) == (3, 2, 5.5, None)
    assert (row["cut_pairs"], row["recovered"], row["recovery_p50_s"], row["recovery_max_s"]) == (2, 1, 7.0, None)


def test_age_before_the_split_is_averaged_over_time_and_pairs():
    """Middlewares begin at 2 s. One pair hears each 2 s, at once: 1 s old on average. The other never hears: 13 s."""
    times = [2.0 * k for k in range(5, 11)]
    result = logs(*(("state", 0, 1, t, t) for t in times), ("state", 1, 0, 10.0, None), begin_s=2.0)
    row = of_topic("state", result)
    assert row["age_mean_s"] == pytest.approx((1.0 + 13.0) / 2, abs=0.02)
    assert row["age_p95_s"] == pytest.approx(17.0, abs=0.02)


def test_programs_know_the_addresses_of_their_group_and_when_to_send():
    hosts = "127.0.0.1 localhost\n10.77.0.11 team-10\nfd53:57::1 team-0\n10.77.0.1 team-0\n10.77.0.2 other-0\n"
    assert node.team_addresses(hosts, "team-0") == ("10.77.0.1", "10.77.0.11")
    sent = node.schedule(0, 3)
    first = [next(sent) for _ in range(8)]
    assert [at_s for at_s, kind, _ in first if kind == node.STATE] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4, 0.5])
    assert [(at_s, to) for at_s, kind, to in first if kind == node.COMMAND] == [(0.0, 1), (0.5, 2)]
    assert node.MAP not in {kind for _, kind, _ in first}
