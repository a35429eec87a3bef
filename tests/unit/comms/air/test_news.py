"""What is told of links: whose they were, of which arena; of arenas that have left, nothing."""

import numpy as np
import pytest

from swarmwire.comms.air.air import Air
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.arrays import IntArray
from swarmwire.comms.outcomes import SendResult
from swarmwire.comms.packets import BROADCAST, Payloads, Sent
from tests.support.comms.air.runs import TICK_NS, at, make_air
from tests.support.comms.air.signal.radios import with_access

ROBOTS = 3
ALIVE = np.ones(2 * ROBOTS, np.bool_)
POSE = np.tile(at((0, 0), (1, 0), (0, 1)), (2, 1))
PAYLOADS = [b"\x01\x02 of arena 0", b"\x03\x04 of arena 1, longer"]
RADIOS = {"disk": Radio(9.0, send_offset="tick"), "signals": with_access("aloha")}
ASKED: IntArray = np.array([41, 42])


def sent(radio: str) -> Air:
    """Robot 1 of arena 0 has sent to all, robot 2 of arena 1 to robot 0."""
    air = make_air(RADIOS[radio], ROBOTS, [1, 2])
    air.advance(0)
    air.hold(POSE, ALIVE)
    air.send(0, 0, Sent(np.array([1, 5]), np.array([BROADCAST, 0]), Payloads.of(PAYLOADS), ASKED))
    return air


@pytest.mark.parametrize("radio", RADIOS)
def test_a_link_is_told_with_all_that_its_packet_was(radio: str):
    told = sent(radio).advance(TICK_NS).finished
    of_links = told.arena, told.sender, told.receiver, told.to, told.sequence, told.fate
    rows = list(zip(*(column.tolist() for column in of_links), strict=True))
    assert sorted(rows) == [(0, 1, 0, -1, 0, 0), (0, 1, 2, -1, 0, 0), (1, 2, 0, 0, 0, 0)]
    assert told.payload is not None
    assert told.payloads is not None
    for arena, size, tag, payload in zip(told.arena, told.size_bytes, told.tag, told.payload, strict=True):
        assert told.payloads.row(int(payload)) == PAYLOADS[arena]
        assert (size, tag) == (len(PAYLOADS[arena]), int.from_bytes(PAYLOADS[arena][:2], "little"))
    assert (told.rssi_dbm is None) == (radio == "disk")


@pytest.mark.parametrize("over", [0, 1])
@pytest.mark.parametrize("radio", RADIOS)
def test_of_an_arena_that_left_nothing_is_told_any_more(radio: str, over: int):
    air = sent(radio)
    heard, _ = air.advance_within(TICK_NS // 2)
    assert heard.receiver.tolist() == [0, 2, 3]
    air.leave(np.arange(2) == over)
    news, left = air.advance(TICK_NS), 1 - over
    assert news.heard.receiver.tolist() == [[0, 2], [3]][left]
    assert {news.heard.payloads.row(int(row)) for row in news.heard.payload} == {PAYLOADS[left]}
    assert set(news.finished.arena.tolist()) == set(news.departed.arena.tolist()) == {left}


@pytest.mark.parametrize("over", [0, 1])
def test_nor_what_its_senders_learned(over: int):
    air = make_air(with_access("csma-802154"), ROBOTS, [1, 2])
    air.advance(0)
    air.hold(POSE, ALIVE)
    air.send(0, 0, Sent(np.array([1, 5]), np.array([0, 0]), Payloads.of(PAYLOADS), ASKED))
    _, learned = air.advance_within(TICK_NS // 2)
    assert learned.row.tolist() == [1, 5]
    air.leave(np.arange(2) == over)
    outcomes = air.advance(TICK_NS).outcomes
    assert (outcomes.row.tolist(), outcomes.id.tolist()) == ([[1, 5][1 - over]], [[41, 42][1 - over]])
    assert outcomes.result.tolist() == [int(SendResult.ACKNOWLEDGED)]
