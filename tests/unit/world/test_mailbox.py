"""Packets wait in the world for robots that do not act in every tick."""

import numpy as np

from swarmwire.comms.packets import Payloads, ReceivedPackets, TxStatuses
from swarmwire.world.loop import Mailbox
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.world import World
from tests.support.world.samples import changed

ALIVE = np.ones(15, np.bool_)  # of the sample: 12 of flock, then 3 of big


def world(flock: int, big: int) -> World:
    mapping = changed("robots.flock.act_every_ticks", flock)
    mapping["robots"]["big"]["act_every_ticks"] = big
    return World(scenario_from(mapping, "sample"), [1], {"flock": ("odometry",), "big": ("compass",)})


def received(*packets: tuple[int, int, int, int]) -> ReceivedPackets:
    """Receiver, sender, sequence and received_at_ns of each packet, sorted; its payload says them all."""
    table = np.array(sorted((p[0], p[3], p[1], p[2]) for p in packets), np.int64).reshape(-1, 4)
    receiver, received_at_ns, sender, sequence = (np.ascontiguousarray(column) for column in table.T)
    payloads = Payloads.of([bytes([r, s, q, t]) for r, t, s, q in table.tolist()])
    given = {"range_m": sender * 0.5}
    return ReceivedPackets(receiver, sender, sequence, received_at_ns, given, np.arange(len(table)), payloads)


def read(of: ReceivedPackets) -> list[tuple[int, ...]]:
    """What `received` was made from, as the payloads and the columns say it."""
    columns = list(zip(*(c.tolist() for c in (of.receiver, of.sender, of.sequence, of.received_at_ns)), strict=True))
    assert [tuple(of.payloads.row(p)) for p in of.payload.tolist()] == columns
    assert of.given["range_m"].tolist() == [0.5 * sender for _, sender, _, _ in columns]
    return columns


def test_all_that_waited_comes_at_once_and_in_order():
    box = Mailbox(world(1, 3).static)
    first = box.hand_over(1, received((0, 1, 0, 5), (12, 3, 0, 7), (12, 2, 0, 9)), ALIVE)
    assert read(first) == [(0, 1, 0, 5)]
    assert read(box.hand_over(2, received((12, 1, 4, 9), (13, 1, 4, 11)), ALIVE)) == []
    third = box.hand_over(3, received((0, 2, 1, 21), (12, 2, 1, 20)), ALIVE)
    by_time = [(12, 3, 0, 7), (12, 1, 4, 9), (12, 2, 0, 9), (12, 2, 1, 20)]
    assert read(third) == [(0, 2, 1, 21), *by_time, (13, 1, 4, 11)]
    assert read(box.hand_over(6, received(), ALIVE)) == []


def test_a_payload_that_several_received_is_kept_once():
    box = Mailbox(world(1, 2).static)
    shared = received((12, 1, 0, 5), (13, 1, 0, 5), (14, 1, 0, 5))
    box.hand_over(1, shared.select(np.array([0, 1, 2])), ALIVE)
    assert len(box._waiting.payloads) == 3
    one = ReceivedPackets(
        *(getattr(shared, n) for n in ("receiver", "sender", "sequence", "received_at_ns", "given")),
        np.zeros(3, np.int64),
        shared.payloads,
    )
    box = Mailbox(world(1, 2).static)
    box.hand_over(1, one, ALIVE)
    assert len(box._waiting.payloads) == 1


def test_what_waits_for_a_robot_that_dies_is_lost():
    box = Mailbox(world(1, 3).static)
    box.hand_over(1, received((12, 3, 0, 7), (13, 3, 0, 7)), ALIVE)
    box.hand_over(2, received(), np.arange(15) != 12)
    assert read(box.hand_over(3, received(), ALIVE)) == [(13, 3, 0, 7)]


def tx_status(*rows: tuple[int, int, int]) -> TxStatuses:
    return TxStatuses(*np.array(rows, np.int64).reshape(-1, 3).T)


def rows_of(told: TxStatuses) -> list[tuple[int, ...]]:
    return list(zip(told.row.tolist(), told.id.tolist(), told.result.tolist(), strict=True))


def test_tx_status_wait_for_robots_that_act_later_and_not_for_the_dead():
    box = Mailbox(world(1, 3).static)
    first = box.hand_over_tx_status(1, tx_status((0, 4, 1), (12, 0, 0), (13, 0, 2)), ALIVE)
    assert rows_of(first) == [(0, 4, 1)]
    assert rows_of(box.hand_over_tx_status(2, tx_status((12, 2, 0), (14, 1, 0)), np.arange(15) != 13)) == []
    third = box.hand_over_tx_status(3, tx_status((0, 5, 0), (12, 1, 3)), ALIVE)
    assert rows_of(third) == [(0, 5, 0), (12, 0, 0), (12, 1, 3), (12, 2, 0), (14, 1, 0)]
    assert rows_of(box.hand_over_tx_status(6, tx_status(), ALIVE)) == []


def test_only_groups_that_act_sense():
    of = world(2, 3)
    assert [sorted(of.sense(tick)) for tick in range(7)] == [
        ["big", "flock"],
        [],
        ["flock"],
        ["big"],
        ["flock"],
        [],
        ["big", "flock"],
    ]
