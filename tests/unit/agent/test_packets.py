from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.agent import Agent, Robot, Robots, TxResult, TxStatus
from swarmwire.agent.agent_group import _SingleGroup
from swarmwire.agent.executor import AgentExecutor
from swarmwire.agent.local_backend import LocalBackend
from swarmwire.agent.radios.zenoh_radio import HEADER_BYTES, PacketHeader
from swarmwire.agent.testing import Trial, assert_equivalent, assert_rows_independent
from swarmwire.comms.base.errors import AgentFailed, BadFrame
from swarmwire.comms.robot.packets import NO_TX_STATUSES, SentPackets, TxStatuses
from tests.support.agent.hosts import SILENCE, agents_for, assignment, group, readings, received_from, spec, step, words
from tests.support.agent.one_step import agent_doing, vector_agent_doing
from tests.support.agent.players import Insistence, Insisting, Other, VectorInsisting, Word

TRIALS = [Trial(), Trial(robots=1), Trial(robots=30, ticks=20, seed=7)]
headers = st.builds(
    PacketHeader, st.integers(-1, 2**15 - 1), st.integers(0, 2**32 - 1), st.integers(-(2**63), 2**63 - 1)
)


class Keeps(Agent):
    """Sends to all, to robot 0 and to robot 1, and keeps what it is told."""

    needs = ("radio.tx_status",)
    statuses: ClassVar[list[list[TxStatus]]] = []
    ids: ClassVar[list[int]] = []

    def step(self, robot: Robot) -> None:
        self.statuses.append(robot.radio.tx_status)
        self.ids.extend(robot.radio.send(Other(number=1), to=to) for to in (None, 0, 1))


@pytest.fixture
def keeps() -> type[Keeps]:
    return type("Fresh", (Keeps,), {"statuses": [], "ids": []})


def tx_status(*rows: tuple[int, int, int]) -> TxStatuses:
    """Robot row, id, result."""
    return TxStatuses(*np.array(rows, np.int64).reshape(-1, 3).T)


def test_tx_status_has_the_id_that_send_returned(keeps: type[Keeps]):
    agents = agents_for(keeps, [2, 5])
    sent = step(agents, 0, [2, 5]).sent
    assert keeps.ids == [0, 1, 2, 0, 1, 2]
    ids_by_link = dict(
        zip(zip(sent.sender.tolist(), sent.to.tolist(), strict=True), sent.tx_status_ids.tolist(), strict=True)
    )
    assert ids_by_link == {(2, -1): -1, (2, 0): 1, (2, 1): 2, (5, -1): -1, (5, 0): 1, (5, 1): 2}
    step(agents, 1, [2, 5], tx_statuses=tx_status((1, 0, 0), (2, 1, 0), (2, 2, 3), (5, 2, 1), (9, 0, 0)))
    assert keeps.statuses[2:] == [
        [TxStatus(1, TxResult.ACKNOWLEDGED), TxStatus(2, TxResult.QUEUE_FULL)],
        [TxStatus(2, TxResult.NO_ACKNOWLEDGEMENT)],
    ]
    assert [status.acknowledged for status in keeps.statuses[2]] == [True, False]
    assert (step(agents, 2, [2, 5]).rows.tolist(), keeps.statuses[4:]) == ([2, 5], [[], []])


def test_tx_status_of_a_vector_agent_is_in_columns():
    statuses: list[TxStatuses] = []

    def read(robots: Robots) -> None:
        statuses.append(robots.radio.tx_status)
        robots.radio.send(Other, to=np.arange(robots.n) + 1, number=1.0)

    agents = agents_for(vector_agent_doing(read, "radio.tx_status"), [2, 5, 8])
    assert step(agents, 0, [2, 5, 8]).sent.tx_status_ids.tolist() == [0, 0, 0]
    step(agents, 1, [2, 5, 8], tx_statuses=tx_status((5, 0, 2), (8, 0, 0)))
    assert (statuses[1].row.tolist(), statuses[1].id.tolist(), statuses[1].result.tolist()) == ([1, 2], [0, 0], [2, 0])
    assert statuses[1].acknowledged.tolist() == [False, True]


def test_tx_status_without_a_declaration_is_neither_requested_nor_readable():
    silent = agents_for(agent_doing(lambda robot: robot.radio.send(Other(number=1), to=0)), [2])
    assert step(silent, 0, [2]).sent.tx_status_id is None
    reads = agents_for(agent_doing(lambda robot: robot.radio.tx_status, "radio.rssi"), [2])
    with pytest.raises(AgentFailed, match=r"reads 'radio.tx_status', which its needs do not list \(radio.rssi"):
        step(reads, 0, [2])


def test_tx_status_of_earlier_packets_is_dropped_after_a_restart(keeps: type[Keeps]):
    agents = agents_for(keeps, [2, 5])
    step(agents, 0, [2, 5])
    step(agents, 1, [5])
    step(agents, 2, [2, 5], tx_statuses=tx_status((2, 1, 0), (5, 1, 0), (5, 5, 0)))
    assert [[status.id for status in statuses] for statuses in keeps.statuses[3:]] == [[], [1, 5]]
    assert keeps.ids[-6:-3] == [3, 4, 5]
    step(agents, 3, [2, 5], tx_statuses=tx_status((2, 2, 1), (2, 4, 0)))
    assert [[status.id for status in statuses] for statuses in keeps.statuses[5:]] == [[4], []]
    keeps.statuses.clear()
    step(agents_for(keeps, [2]), 7, [2], tx_statuses=tx_status((2, 1, 0), (2, 30, 1)))  # of its predecessor
    assert keeps.statuses == [[]]


@pytest.mark.parametrize("trial", TRIALS, ids=repr)
def test_tx_status_is_equal_for_agent_and_vector_agent(trial: Trial):
    assert_equivalent(Insisting, VectorInsisting, trial)
    assert_rows_independent(VectorInsisting, trial)


def test_trial_has_every_tx_result_and_catches_differences():
    class Credulous(VectorInsisting):
        def step(self, robots: Robots, memory: Insistence) -> None:
            super().step(robots, memory)
            statuses = robots.radio.tx_status
            memory.number[statuses.row[statuses.result == TxResult.TOO_LARGE]] += 1

    class Peeking(VectorInsisting):
        def step(self, robots: Robots, memory: Insistence) -> None:
            super().step(robots, memory)
            robots.drive(float(len(robots.radio.tx_status)), 0.0)

    with pytest.raises(AssertionError, match="Insisting and Credulous differ"):
        assert_equivalent(Insisting, Credulous)
    with pytest.raises(AssertionError, match="rows of Peeking are not independent"):
        assert_rows_independent(Peeking)


def numbers(sent: SentPackets) -> list[tuple[int, float]]:
    """Who sent which number."""
    values = [Word.decode(sent.payloads.row(i)).number for i in range(len(sent))]
    return list(zip(sent.sender.tolist(), values, strict=True))


def stepped(agent: str | type[Agent], rows: list[int], tick: int = 0, name: str = "flock") -> AgentExecutor:
    """The executor of these agents after their first step."""
    loaded = spec("Counter") if isinstance(agent, type) else spec(agent)
    executor = AgentExecutor(assignment(group(loaded, rows, name)))
    if isinstance(agent, type):
        executor._agent_groups[name] = _SingleGroup(group("", rows), agent)
    executor.act(tick, {name: readings(tick, rows)}, SILENCE)
    return executor


@pytest.mark.parametrize("agent", ["Echo", "VectorEcho"])
def test_packet_is_received_between_steps_or_in_the_next_step_never_both(agent: str) -> None:
    agents = stepped(agent, [0, 1])
    agents.receive(received_from(words(7), [0, 1]), NO_TX_STATUSES)
    assert numbers(agents.on_receive(0, 10)) == [(0, 1.0), (1, 1.0)]
    assert numbers(agents.on_receive(0, 20)) == []
    agents.receive(received_from(words(7, 8), [1]), NO_TX_STATUSES)
    assert numbers(agents.act(1, {"flock": readings(1, [0, 1])}, SILENCE).sent) == [(0, 1.0), (1, 201.0)]
    assert numbers(agents.on_receive(1, 30)) == []


def test_packets_wait_for_the_first_step_and_for_that_of_agents_without_on_receive() -> None:
    agents = stepped("Counter", [0, 1])
    agents.receive(received_from(words(7), [0]), NO_TX_STATUSES)
    assert len(agents.on_receive(0, 10)) == 0
    assert agents._waiting is not None
    agents.act(1, {"flock": readings(1, [0, 1])}, SILENCE)
    assert not agents._waiting
    agents = AgentExecutor(assignment(group(spec("Echo"), [0, 1])))
    agents.receive(received_from(words(7), [0, 1]), NO_TX_STATUSES)
    assert len(agents.on_receive(0, 10)) == 0
    assert numbers(agents.act(0, {"flock": readings(0, [0, 1])}, SILENCE).sent) == [(0, 100.0), (1, 100.0)]


def test_packets_waiting_for_a_dead_robot_are_lost() -> None:
    agents = stepped("Echo", [0, 1])
    agents.act(1, {"flock": readings(1, [1])}, SILENCE)
    agents.receive(received_from(words(7), [0, 1]), NO_TX_STATUSES)
    assert numbers(agents.on_receive(1, 10)) == [(1, 1.0)]
    agents.act(2, {"flock": readings(2, [1])}, SILENCE)
    assert numbers(agents.act(3, {"flock": readings(3, [0, 1])}, SILENCE).sent) == [(0, 0.0), (1, 1.0)]


def test_packets_wait_for_a_group_that_does_not_act() -> None:
    agents = AgentExecutor(assignment(group(spec("Counter"), [0], "often"), group(spec("VectorEcho"), [1], "seldom")))
    agents.receive(received_from(words(7), [0, 1, 5]), NO_TX_STATUSES)  # robot 5 is another runner's
    agents.act(0, {"often": readings(0, [0])}, SILENCE)
    assert numbers(agents.act(1, {"seldom": readings(1, [1])}, received_from(words(8), [1])).sent) == [(1, 200.0)]


def test_tx_status_arrives_between_steps_with_the_ids_of_that_time() -> None:
    id_pairs = list[tuple[int, int]]()

    class Insistent(Agent):
        needs = ("radio.tx_status", "compass")

        def step(self, robot: Robot) -> None:
            id_pairs.append((robot.radio.send(Word(number=1.0), to=9), -1))

        def on_receive(self, robot: Robot) -> None:
            assert robot.compass.heading_rad == float(readings(0, [3]).fields["compass.heading_rad"][0])
            assert robot.time_s == 0.02
            for tx_status in robot.radio.tx_status:
                id_pairs.append((robot.radio.send(Word(number=2.0), to=9), tx_status.id))

    executor = stepped(Insistent, [3])
    for id_ in (0, 1):
        executor.receive(SILENCE, TxStatuses(np.array([3]), np.array([id_]), np.array([0])))
        assert len(executor.on_receive(0, 20_000_000)) == 1
    assert id_pairs == [(0, -1), (1, 0), (2, 1)]


def test_draws_between_steps_are_independent() -> None:
    drawn = list[float]()

    class Drawing(Agent):
        def step(self, robot: Robot) -> None:
            drawn.append(robot.draw.uniform("x"))

        def on_receive(self, robot: Robot) -> None:
            drawn.append(robot.draw.uniform("x"))

    executor = stepped(Drawing, [3])
    for at_ns in (10, 20):
        executor.receive(received_from(words(7), [3]), NO_TX_STATUSES)
        executor.on_receive(0, at_ns)
    assert len(set(drawn)) == 3


@pytest.mark.parametrize("deed", ["robot.drive(0.1, 0.0)", 'robot.note("x")', "robot.led(1.0, 0.0, 0.0)", "1 / 0"])
def test_step_only_calls_fail_between_steps_with_the_robots_name(deed: str) -> None:
    class Doing(Agent):
        def step(self, robot: Robot) -> None:
            """Nothing."""

        def on_receive(self, robot: Robot) -> None:
            exec(deed, {"robot": robot})

    executor = stepped(Doing, [3])
    executor.receive(received_from(words(7), [3]), NO_TX_STATUSES)
    with pytest.raises(AgentFailed, match="flock-3") as caught:
        executor.on_receive(0, 10)
    assert ("ZeroDivisionError" if "/" in deed else "is for step") in caught.value.traceback


def test_local_backend_acts_and_forwards_packets_between_start_and_close() -> None:
    backend = LocalBackend(assignment(group(spec("Echo"), [0, 1])))

    def assert_closed() -> None:
        for use in (lambda: backend.on_receive(0, 0), lambda: backend.act(0, sensed, SILENCE)):
            with pytest.raises(RuntimeError, match="has not been started"):
                use()

    sensed = {"flock": readings(0, [0, 1])}
    assert_closed()
    backend.start()
    assert len(backend.act(0, sensed, SILENCE).sent) == 2
    backend.receive(received_from(words(1), [0]), NO_TX_STATUSES)
    assert numbers(backend.on_receive(0, 10)) == [(0, 1.0)]
    assert backend.counts() == {}
    backend.close()
    backend.close()
    assert_closed()


@given(headers, st.binary(max_size=20))
def test_packet_header_round_trips_with_any_message(header, message):
    assert PacketHeader.decode(header.encode() + message) == header
    assert len(header.encode()) == HEADER_BYTES
    assert PacketHeader.decode(header._replace(sequence=2**32).encode()).sequence == 0


@given(st.binary(max_size=40))
def test_packet_header_of_any_bytes_decodes_or_is_malformed(data):
    try:
        header = PacketHeader.decode(data)
    except BadFrame as error:
        assert error.fault == "malformed"  # noqa: PT017 - most bytes are none
    else:
        assert header.encode() == data[:HEADER_BYTES]
