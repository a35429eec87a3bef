"""Agents that read between their steps: each packet is handed over once, and only sending is for then."""

import numpy as np
import pytest

from swarmwire.agent import Agent, Robot
from swarmwire.agent.host import AgentExecutor, _Single
from swarmwire.agent.local_backend import LocalBackend
from swarmwire.comms.errors import AgentFailed
from swarmwire.comms.packets import NO_TX_STATUSES, SentPackets, TxStatuses
from tests.support.agent.hosts import SILENCE, assignment, group, readings, received_from, spec, words
from tests.support.agent.players import Word


def numbers(sent: SentPackets) -> list[tuple[int, float]]:
    """Who sent which number."""
    told = [Word.decode(sent.payloads.row(i)).number for i in range(len(sent))]
    return list(zip(sent.sender.tolist(), told, strict=True))


def stepped(agent: str, rows: list[int], tick: int = 0, name: str = "flock") -> AgentExecutor:
    host = AgentExecutor(assignment(group(spec(agent), rows, name)))
    host.act(tick, {name: readings(tick, rows)}, SILENCE)
    return host


@pytest.mark.parametrize("agent", ["Echo", "VectorEcho"])
def test_a_packet_is_received_between_steps_or_in_the_next_and_never_in_both(agent: str) -> None:
    host = stepped(agent, [0, 1])
    host.receive(received_from(words(7), [0, 1]), NO_TX_STATUSES)
    assert numbers(host.on_receive(0, 10)) == [(0, 1.0), (1, 1.0)]
    assert numbers(host.on_receive(0, 20)) == []
    host.receive(received_from(words(7, 8), [1]), NO_TX_STATUSES)
    assert numbers(host.act(1, {"flock": readings(1, [0, 1])}, SILENCE).sent) == [(0, 1.0), (1, 201.0)]
    assert numbers(host.on_receive(1, 30)) == []


def test_packets_wait_for_the_step_of_those_that_hear_only_then() -> None:
    host = stepped("Counter", [0, 1])
    host.receive(received_from(words(7), [0]), NO_TX_STATUSES)
    assert len(host.on_receive(0, 10)) == 0
    assert host._waiting is not None
    host.act(1, {"flock": readings(1, [0, 1])}, SILENCE)
    assert not host._waiting


def test_whoever_has_not_stepped_yet_hears_in_its_first_step() -> None:
    host = AgentExecutor(assignment(group(spec("Echo"), [0, 1])))
    host.receive(received_from(words(7), [0, 1]), NO_TX_STATUSES)
    assert len(host.on_receive(0, 10)) == 0
    assert numbers(host.act(0, {"flock": readings(0, [0, 1])}, SILENCE).sent) == [(0, 100.0), (1, 100.0)]


def test_the_dead_hear_nothing_and_what_waits_for_them_is_lost() -> None:
    host = stepped("Echo", [0, 1])
    host.act(1, {"flock": readings(1, [1])}, SILENCE)
    host.receive(received_from(words(7), [0, 1]), NO_TX_STATUSES)
    assert numbers(host.on_receive(1, 10)) == [(1, 1.0)]
    host.act(2, {"flock": readings(2, [1])}, SILENCE)
    assert numbers(host.act(3, {"flock": readings(3, [0, 1])}, SILENCE).sent) == [(0, 0.0), (1, 1.0)]


def test_packets_of_a_group_that_does_not_act_now_wait_for_it() -> None:
    host = AgentExecutor(assignment(group(spec("Counter"), [0], "often"), group(spec("VectorEcho"), [1], "seldom")))
    host.receive(received_from(words(7), [0, 1, 5]), NO_TX_STATUSES)  # robot 5 is another runner's
    host.act(0, {"often": readings(0, [0])}, SILENCE)
    assert numbers(host.act(1, {"seldom": readings(1, [1])}, received_from(words(8), [1])).sent) == [(1, 200.0)]


def test_tx_status_come_between_steps_too_with_the_ids_of_packets_sent_then() -> None:
    told = list[tuple[int, int]]()

    class Insistent(Agent):
        needs = ("radio.tx_status", "compass")

        def step(self, robot: Robot) -> None:
            told.append((robot.radio.send(Word(number=1.0), to=9), -1))

        def on_receive(self, robot: Robot) -> None:
            assert robot.compass.heading_rad == float(readings(0, [3]).fields["compass.heading_rad"][0])
            assert robot.time_s == 0.02
            for tx_status in robot.radio.tx_status:
                told.append((robot.radio.send(Word(number=2.0), to=9), tx_status.id))

    host = stepped("Counter", [3])
    host._groups["flock"] = _Single(group("", [3]), Insistent)
    host.act(0, {"flock": readings(0, [3])}, SILENCE)
    for id_ in (0, 1):
        host.receive(SILENCE, TxStatuses(np.array([3]), np.array([id_]), np.array([0])))
        assert len(host.on_receive(0, 20_000_000)) == 1
    assert told == [(0, -1), (1, 0), (2, 1)]


def test_draws_between_steps_are_none_of_the_step_or_of_one_another() -> None:
    drawn = list[float]()

    class Drawing(Agent):
        def step(self, robot: Robot) -> None:
            drawn.append(robot.draw.uniform("x"))

        def on_receive(self, robot: Robot) -> None:
            drawn.append(robot.draw.uniform("x"))

    host = stepped("Counter", [3])
    host._groups["flock"] = _Single(group("", [3]), Drawing)
    host.act(0, {"flock": readings(0, [3])}, SILENCE)
    for at_ns in (10, 20):
        host.receive(received_from(words(7), [3]), NO_TX_STATUSES)
        host.on_receive(0, at_ns)
    assert len(set(drawn)) == 3


@pytest.mark.parametrize("deed", ["robot.drive(0.1, 0.0)", 'robot.note("x")', "robot.led(1.0, 0.0, 0.0)", "1 / 0"])
def test_what_is_for_the_step_fails_between_steps_with_the_robots_name(deed: str) -> None:
    class Doing(Agent):
        def step(self, robot: Robot) -> None:
            """Nothing."""

        def on_receive(self, robot: Robot) -> None:
            exec(deed, {"robot": robot})

    host = stepped("Counter", [3])
    host._groups["flock"] = _Single(group("", [3]), Doing)
    host.act(0, {"flock": readings(0, [3])}, SILENCE)
    host.receive(received_from(words(7), [3]), NO_TX_STATUSES)
    with pytest.raises(AgentFailed, match="flock-3") as caught:
        host.on_receive(0, 10)
    assert ("ZeroDivisionError" if "/" in deed else "is for step") in caught.value.traceback


def test_a_crew_in_this_process_hands_on_what_its_agents_may_not_write_to() -> None:
    backend = LocalBackend(assignment(group(spec("Echo"), [0, 1])))
    with pytest.raises(RuntimeError, match="has not been started"):
        backend.on_receive(0, 0)
    backend.start()
    backend.act(0, {"flock": readings(0, [0, 1])}, SILENCE)
    backend.receive(received_from(words(1), [0]), NO_TX_STATUSES)
    assert numbers(backend.on_receive(0, 10)) == [(0, 1.0)]
