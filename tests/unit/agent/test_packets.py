"""What agents hear and learn: packets of one robot and columns of n, and what became of those that they sent."""

from typing import ClassVar

import numpy as np
import pytest

from swarmwire.agent import Agent, Packet, Robot, Robots, State, TxResult, TxStatus, VectorAgent
from swarmwire.agent.packet import Columns, Packets
from swarmwire.agent.testing import Trial, assert_equivalent, assert_rows_independent
from swarmwire.comms.errors import AgentFailed
from swarmwire.comms.messages import DICT_TAG, encode_dict
from swarmwire.comms.packets import BROADCAST, Payloads, SentPackets, TxStatuses
from tests.support.agent.hosts import host_of, received_from, step, words
from tests.support.agent.players import Insistence, Insisting, Other, VectorInsisting, Word

said = {}
DICTS = (b"", b"\xc1", b"\x81", b"\x01", b"\x93\x01\x02\x03", b"\x81\x91\x01\x01", b"\x80\x00", b"\x91" * 600)


class Alone(Agent):
    needs = ("radio.range", "radio.bearing")

    def step(self, robot):
        packets: list[Packet[Word]] = robot.radio.received(Word)
        assert all(isinstance(packet, Packet) for packet in packets)
        said["alone"] = [(packet.sender, packet.range_m, packet.message.number) for packet in packets]


class Rows(VectorAgent):
    needs = ("radio.range", "radio.bearing")

    def step(self, robots, state):
        packets: Packets[Word] = robots.radio.received(Word)
        assert isinstance(packets.message, Columns)
        columns = (packets.sender, packets.range_m, packets.message.number)
        said["rows"] = list(zip(*(column.tolist() for column in columns), strict=True))


def test_one_robot_hears_in_packets_what_n_robots_hear_in_columns():
    for kind in (Alone, Rows):
        step(host_of(kind, [5]), 0, [5], received_from(words(0, 2), [5]))
    assert said["alone"] == said["rows"]
    assert [sender for sender, _, _ in said["alone"]] == [0, 2]


def test_what_bears_the_tag_of_a_dict_and_is_none_is_not_received():
    """A runner of others may send any bytes: they must not end the run in whoever hears them."""

    class Hears(Agent):
        def step(self, robot):
            said["dicts"] = [packet.message for packet in robot.radio.received(dict)]

    tag = DICT_TAG.to_bytes(2, "little")
    payloads = Payloads.of([*(tag + data for data in DICTS), encode_dict({"x": 1})])
    sender = np.zeros(len(payloads), np.int64)
    step(host_of(Hears, [5]), 0, [5], received_from(SentPackets(sender, sender + BROADCAST, payloads), [5]))
    assert said["dicts"] == [{"x": 1}]


TRIALS = [Trial(), Trial(robots=1), Trial(robots=30, ticks=20, seed=7)]


class Keeps(Agent):
    """Sends to all, to robot 0 and to robot 1, and keeps what it is told."""

    needs = ("radio.tx_status",)
    told: ClassVar[list[list[TxStatus]]] = []
    ids: ClassVar[list[int]] = []

    def step(self, robot: Robot) -> None:
        self.told.append(robot.radio.tx_status)
        self.ids.extend(robot.radio.send(Other(number=1), to=to) for to in (None, 0, 1))


@pytest.fixture
def keeps() -> type[Keeps]:
    return type("Fresh", (Keeps,), {"told": [], "ids": []})


def tx_status(*rows: tuple[int, int, int]) -> TxStatuses:
    """Robot row, id, result."""
    return TxStatuses(*np.array(rows, np.int64).reshape(-1, 3).T)


def test_an_agent_is_told_of_its_own_packets_by_the_id_that_send_returned(keeps: type[Keeps]):
    host = host_of(keeps, [2, 5])
    sent = step(host, 0, [2, 5]).sent
    assert keeps.ids == [0, 1, 2, 0, 1, 2]
    asked = dict(
        zip(zip(sent.sender.tolist(), sent.to.tolist(), strict=True), sent.tx_status_ids.tolist(), strict=True)
    )
    assert asked == {(2, -1): -1, (2, 0): 1, (2, 1): 2, (5, -1): -1, (5, 0): 1, (5, 1): 2}
    step(host, 1, [2, 5], told=tx_status((1, 0, 0), (2, 1, 0), (2, 2, 3), (5, 2, 1), (9, 0, 0)))
    assert keeps.told[2:] == [
        [TxStatus(1, TxResult.ACKNOWLEDGED), TxStatus(2, TxResult.QUEUE_FULL)],
        [TxStatus(2, TxResult.NO_ACKNOWLEDGEMENT)],
    ]
    assert [one.acknowledged for one in keeps.told[2]] == [True, False]
    assert (step(host, 2, [2, 5]).rows.tolist(), keeps.told[4:]) == ([2, 5], [[], []])


def test_a_vector_agent_reads_the_same_as_columns():
    seen: list[TxStatuses] = []

    class Reads(VectorAgent):
        needs: ClassVar[tuple[str, ...]] = ("radio.tx_status",)

        def step(self, robots: Robots, state: State) -> None:
            seen.append(robots.radio.tx_status)
            robots.radio.send(Other, to=np.arange(robots.n) + 1, number=1.0)

    host = host_of(Reads, [2, 5, 8])
    assert step(host, 0, [2, 5, 8]).sent.tx_status_ids.tolist() == [0, 0, 0]
    step(host, 1, [2, 5, 8], told=tx_status((5, 0, 2), (8, 0, 0)))
    assert (seen[1].row.tolist(), seen[1].id.tolist(), seen[1].result.tolist()) == ([1, 2], [0, 0], [2, 0])
    assert seen[1].acknowledged.tolist() == [False, True]


def test_who_does_not_declare_it_neither_asks_nor_reads():
    class Silent(Agent):
        def step(self, robot: Robot) -> None:
            assert robot.radio.send(Other(number=1), to=0) == 0

    class Reads(Agent):
        needs = ("radio.rssi",)

        def step(self, robot: Robot) -> None:
            print(robot.radio.tx_status)

    assert step(host_of(Silent, [2]), 0, [2]).sent.tx_status_id is None
    with pytest.raises(AgentFailed, match="reads 'radio.tx_status', which its needs do not name: radio.rssi"):
        step(host_of(Reads, [2]), 0, [2])


def test_a_robot_that_starts_afresh_is_not_told_of_packets_from_before(keeps: type[Keeps]):
    host = host_of(keeps, [2, 5])
    step(host, 0, [2, 5])
    step(host, 1, [5])
    step(host, 2, [2, 5], told=tx_status((2, 1, 0), (5, 1, 0), (5, 5, 0)))
    assert [[one.id for one in told] for told in keeps.told[3:]] == [[], [1, 5]]
    assert keeps.ids[-6:-3] == [3, 4, 5]
    step(host, 3, [2, 5], told=tx_status((2, 2, 1), (2, 4, 0)))
    assert [[one.id for one in told] for told in keeps.told[5:]] == [[4], []]


def test_an_agent_that_took_over_is_not_told_of_packets_that_it_never_sent(keeps: type[Keeps]):
    step(host_of(keeps, [2]), 7, [2], told=tx_status((2, 1, 0), (2, 30, 1)))
    assert keeps.told == [[]]


@pytest.mark.parametrize("trial", TRIALS, ids=repr)
def test_both_kinds_of_agent_are_told_the_same(trial: Trial):
    assert_equivalent(Insisting, VectorInsisting, trial)
    assert_rows_independent(VectorInsisting, trial)


def test_the_trial_tells_of_every_result_and_catches_who_takes_it_otherwise():
    class Credulous(VectorInsisting):
        def step(self, robots: Robots, state: Insistence) -> None:
            super().step(robots, state)
            told = robots.radio.tx_status
            state.number[told.row[told.result == TxResult.TOO_LARGE]] += 1

    class Peeking(VectorInsisting):
        def step(self, robots: Robots, state: Insistence) -> None:
            super().step(robots, state)
            robots.drive(float(len(robots.radio.tx_status)), 0.0)

    with pytest.raises(AssertionError, match="Insisting and Credulous differ"):
        assert_equivalent(Insisting, Credulous)
    with pytest.raises(AssertionError, match="rows of Peeking are not independent"):
        assert_rows_independent(Peeking)
