"""Counts of each robot and of each link: by hand, and against counters fed packet by packet."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings

from swarmwire.comms.fates import Fate
from swarmwire.metrics.network import link_counts
from swarmwire.metrics.network.link_counts import LinkCounts
from swarmwire.metrics.network.robot_counts import RobotCounts
from tests.support.metrics.radio_runs import radio_runs, rows_of
from tests.support.metrics.recorded import links
from tests.support.metrics.truths import departed, static


def test_a_robot_has_what_became_of_its_packets_and_of_those_meant_for_it():
    counts = RobotCounts(static(3, arenas=2))
    refused = links([2], [-1], 4, 0, fate=Fate.QUEUE_FULL, receivers=2, arena=1)
    counts.see(departed([2], intended=2, fate=Fate.QUEUE_FULL, arena=1), refused)
    ended = links([0, 0], [1, 2], 7, 0, fate=[Fate.HEARD, Fate.LOST], arena=1)
    counts.see(departed([0], intended=5, out_of_range=2, on_air_at_ns=10, off_air_at_ns=40, arena=1), ended)
    assert counts.packets.tolist() == [0, 0, 0, 1, 0, 1]
    assert counts.packets_on_air.tolist() == [0, 0, 0, 1, 0, 0]
    assert counts.on_air_ns.tolist() == [0, 0, 0, 30, 0, 0]
    assert counts.intended.tolist() == [0, 0, 0, 5, 0, 2]
    assert counts.in_flight.tolist() == [0, 0, 0, 1, 0, 0]  # heard, lost, two out of range, and one to come
    expected = {Fate.HEARD: 1, Fate.LOST: 1, Fate.OUT_OF_RANGE: 2}
    assert counts.as_sender[3].tolist() == [expected.get(fate, 0) for fate in Fate]
    assert counts.as_sender[5, Fate.QUEUE_FULL] == 2
    assert (counts.as_receiver[4, Fate.HEARD], counts.as_receiver[5, Fate.LOST]) == (1, 1)
    assert counts.as_receiver.sum() == 2
    assert counts.heard_bytes.tolist() == [0, 0, 0, 0, ended.size_bytes[0], 0]


def test_a_link_has_a_row_for_each_fate_that_occurred_on_it():
    counts = LinkCounts(static(3, arenas=2))
    counts.see(links([2, 0, 2], [1, 1, 1], [1, 1, 2], 0, fate=[Fate.HEARD, Fate.LOST, Fate.HEARD]))
    counts.see(links([2, 2], [1, -1], [3, 4], 0, fate=[Fate.LOST, Fate.QUEUE_FULL], arena=1))
    rows = np.column_stack(list(counts.columns().values())).tolist()
    assert rows == [[0, 0, 1, Fate.LOST, 1], [0, 2, 1, Fate.HEARD, 2], [1, 2, 1, Fate.LOST, 1]]


@settings(max_examples=25)
@given(radio_runs())
def test_robots_have_what_counters_have(run):
    of, seen = run
    counts, as_sender, as_receiver, got, packets = RobotCounts(of), Counter(), Counter(), Counter(), Counter()
    tally = np.zeros((of.arenas, len(Fate)), np.int64)
    for one in seen:
        counts.see(one.departed, one.finished)
        tally += one.tally.fates
        columns = ("arena", "sender", "receiver", "receivers", "fate", "size_bytes")
        for arena, sender, receiver, receivers, fate, size in rows_of(one.finished, *columns):
            as_sender[arena, sender, fate] += receivers
            if receiver >= 0:
                as_receiver[arena, receiver, fate] += 1
                got[arena, receiver] += size if fate == Fate.HEARD else 0
        for arena, sender, far in rows_of(one.departed, "arena", "sender", "out_of_range"):
            as_sender[arena, sender, Fate.OUT_OF_RANGE] += far
            packets[arena, sender] += 1
    robots = [divmod(row, of.robots) for row in range(of.arenas * of.robots)]
    assert counts.as_sender.tolist() == [[as_sender[*robot, fate] for fate in Fate] for robot in robots]
    assert counts.as_receiver.tolist() == [[as_receiver[*robot, fate] for fate in Fate] for robot in robots]
    assert counts.heard_bytes.tolist() == [got[robot] for robot in robots]
    assert counts.packets.tolist() == [packets[robot] for robot in robots]
    assert (counts.in_flight >= 0).all()
    np.testing.assert_array_equal(counts.as_sender.reshape(of.arenas, of.robots, -1).sum(axis=1), tally)


@pytest.mark.parametrize("waiting", [1, 20, 10**6])
@settings(max_examples=10)
@given(run=radio_runs())
def test_links_have_what_a_counter_has_however_often_they_are_added_up(waiting, run):
    of, seen = run
    counts, expected = LinkCounts(of), Counter()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(link_counts, "WAITING_ROWS", waiting)
        for one in seen:
            counts.see(one.finished)
            expected.update(row for row in rows_of(one.finished, "arena", "sender", "receiver", "fate") if row[2] >= 0)
        found = counts.columns()
    *link, packets = (column.tolist() for column in found.values())
    assert dict(zip(zip(*link, strict=True), packets, strict=True)) == expected
    assert list(zip(*link, strict=True)) == sorted(expected)
