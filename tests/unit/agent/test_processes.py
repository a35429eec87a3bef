"""Robots in processes of their own act as in one process, bit for bit: frames that are cut, steps without arrays."""

import fcntl
import resource
import select
import socket
import threading
from collections.abc import Iterator
from contextlib import closing
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.agent.agent_process import ManyRobots, agents_of
from swarmwire.agent.executor import AgentExecutor
from swarmwire.agent.fork_server import ForkServer
from swarmwire.agent.host_processes import AgentProcesses, Lost, ProcessAnswer
from swarmwire.agent.one_robot import OneRobotAgent
from swarmwire.agent.process_answers import write_actions
from swarmwire.agent.process_frames import (
    ASSIGN,
    FIELDS,
    HEAD,
    MAX_MESSAGE,
    PACKETS,
    READY,
    TICK,
    content_frame,
    receive,
    send,
)
from swarmwire.comms.base.errors import AgentFailed
from swarmwire.comms.robot.packets import NO_TX_STATUSES, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions
from tests.support.agent.hosts import SILENCE, assignment, group, one_group, plain, readings, received_from, spec, words
from tests.support.agent.processes import Processes, Scripted, ThreadServer, layouts_of, standing

ROWS = range(6)
AGENTS = ("Chatter", "Counter", "Insisting", "VectorInsisting", "VectorCounter")


def everything(actions: Actions) -> list[Any]:
    """Actions as plain values, with their tables and the ids of transmit statuses."""
    order, noted = np.argsort(actions.sent.sender, kind="stable"), actions.notes
    notes = {(row, noted.names[int(at)]) for row, at in zip(noted.rows, noted.value, strict=True)}
    values = sorted(zip(actions.values.rows.tolist(), actions.values.value.tolist(), strict=True))
    return [plain(actions), actions.sent.tx_status_ids[order].tolist(), notes, values]


def packets_of(sent: SentPackets) -> list[tuple[int, bytes]]:
    """Sender and payload of each packet, sorted."""
    return sorted(zip(sent.sender.tolist(), map(sent.payloads.row, range(len(sent))), strict=True))


def statuses(sent: SentPackets) -> TxStatuses:
    """A status of each unicast packet."""
    at = np.flatnonzero(sent.tx_status_ids >= 0)
    table = np.array((sent.sender[at], sent.tx_status_ids[at], sent.sender[at] % 2))
    return TxStatuses(*table[:, np.lexsort((table[1], table[0]))])


@given(
    agents=st.tuples(st.sampled_from(AGENTS), st.sampled_from(AGENTS)),
    second=st.sets(st.sampled_from(ROWS), max_size=5),
    processes=st.integers(1, len(ROWS)),
    acting=st.lists(st.sets(st.sampled_from(ROWS)), min_size=1, max_size=6),
)
def test_actions_equal_those_of_one_process(
    agents: tuple[str, str], second: set[int], processes: int, acting: list[set[int]]
) -> None:
    """For any processes, agents and robots that act: the others are dead, and come back with new agents."""
    groups = {"flock": sorted({*ROWS} - second), "others": sorted(second)}
    kinds = zip(groups.items(), agents, strict=True)
    robots = assignment(*(group(spec(agent), rows, name) for (name, rows), agent in kinds if rows))
    single, many = AgentExecutor(robots), Processes(robots, processes)
    received, tx_status = SILENCE, NO_TX_STATUSES
    for tick, alive in enumerate(acting):
        sensed = {name: readings(tick, [row for row in rows if row in alive]) for name, rows in groups.items() if rows}
        expected = single.act(tick, sensed, received, tx_status)
        actions = many.act(tick, sensed, received, tx_status)
        assert actions.rows.tolist() == expected.rows.tolist()
        assert everything(actions) == everything(expected)
        received, tx_status = received_from(expected.sent, sorted(alive)), statuses(expected.sent)


@given(
    agents=st.sampled_from(("Echo", "VectorEcho", "Chatter")),
    processes=st.integers(1, len(ROWS)),
    steps=st.lists(st.tuples(st.booleans(), st.sets(st.sampled_from(ROWS), min_size=1)), min_size=1, max_size=8),
)
def test_packets_between_ticks_equal_those_of_one_process(
    agents: str, processes: int, steps: list[tuple[bool, set[int]]]
) -> None:
    robots = assignment(group(spec(agents), [*ROWS]))
    single, many = AgentExecutor(robots), Processes(robots, processes)
    for tick, (is_step, senders) in enumerate(steps):
        received = received_from(words(*sorted(senders)), [*ROWS])
        if is_step:
            sensed = {"flock": readings(tick, [*ROWS])}
            expected = single.act(tick, sensed, received)
            assert everything(many.act(tick, sensed, received, NO_TX_STATUSES)) == everything(expected)
        else:
            single.receive(received, NO_TX_STATUSES)
            expected = single.on_receive(tick, 1000 * tick)
            sent = many.on_receive(tick, 1000 * tick, received, NO_TX_STATUSES)
            assert packets_of(sent) == packets_of(expected)


def test_single_agents_run_without_arrays_and_vector_agents_with() -> None:
    kinds = {name: type(agents_of(assignment(group(spec(name), [3])), None)) for name in ("Counter", "VectorCounter")}
    assert kinds == {"Counter": OneRobotAgent, "VectorCounter": ManyRobots}


@pytest.mark.parametrize("agent", ["Counter", "VectorCounter"])
def test_memory_continues_in_the_next_process(agent: str) -> None:
    """The numbers of packets go on, and the Memory of a VectorAgent."""
    robots = assignment(group(spec(agent), [*ROWS]))
    first, single = Processes(robots, 6, {}), AgentExecutor(robots)
    single.act(0, one_group(0, [*ROWS]), SILENCE)
    first.act(0, one_group(0, [*ROWS]), SILENCE, NO_TX_STATUSES)
    memory = single.memory(["flock"])
    assert first.memory
    columns, expected = first.memory["flock"].columns, memory["flock"].columns
    assert {name: column.tolist() for name, column in columns.items()} == {
        name: column.tolist() for name, column in expected.items()
    }
    again, as_before = Processes(robots, 3, memory), AgentExecutor(robots, memory)
    actions = again.act(1, one_group(1, [*ROWS]), SILENCE, NO_TX_STATUSES)
    assert everything(actions) == everything(as_before.act(1, one_group(1, [*ROWS]), SILENCE))


def test_failure_names_the_robot_and_begins_in_the_agents_code() -> None:
    processes = Processes(assignment(group(spec("Failing"), [0])), 1)
    with pytest.raises(AgentFailed) as caught:
        processes.act(2, one_group(2, [0]), SILENCE, NO_TX_STATUSES)
    assert caught.value.robots == "flock-0"
    assert "players.py" in next(line for line in caught.value.traceback.splitlines() if "File " in line)


def test_frame_of_any_size_arrives_complete() -> None:
    """Also one of several messages."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        for size in (0, 1, 65_000, 65_535, 65_536, 200_000, 1_000_000):
            frame = content_frame(0, b"x" * size)
            sender = threading.Thread(target=send, args=(ours, [frame[:10], frame[10:]]))
            sender.start()
            assert receive(theirs) == frame
            sender.join()


HIGH_FILE = 1500  # above FD_SETSIZE, the bound of `select`


@pytest.fixture
def many_files() -> Iterator[None]:
    """This process may open more files than `select` can wait for."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and hard <= HIGH_FILE:
        pytest.skip(f"needs a hard limit above {HIGH_FILE} open files, has {hard}")
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, 2 * HIGH_FILE) if hard == -1 else hard, hard))
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


@pytest.mark.usefixtures("many_files")
def test_large_frame_is_sent_to_one_process_among_a_thousand() -> None:
    """A host has a socket per process, and so sockets whose numbers `select` cannot take."""
    low, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours = socket.socket(fileno=fcntl.fcntl(low, fcntl.F_DUPFD, HIGH_FILE))
    frame = content_frame(0, b"x" * 1_000_000)
    with low, ours, theirs:
        ours.setblocking(False)
        received: list[bytes] = []
        receiver = threading.Thread(target=lambda: received.append(receive(theirs)), daemon=True)
        receiver.start()
        send(ours, [frame])
        receiver.join(10.0)
    assert received == [frame]


def until_read(processes: AgentProcesses, count: int) -> list[ProcessAnswer | Lost]:
    """The next so many events, once all processes are ready."""
    events: list[ProcessAnswer | Lost] = []
    while len(events) < count or not processes.are_ready:
        select.select([processes], [], [], 10.0)
        events += processes.events(0)
    return events


def test_restarted_process_acts_with_the_memory_of_its_last_answer() -> None:
    server, robots = ThreadServer(), assignment(group(spec("VectorCounter"), [0, 1]))
    processes = AgentProcesses(cast("ForkServer", server), robots, 2, {}, layouts_of(robots), 0)
    until_read(processes, 0)
    commands: list[list[float]] = []
    with closing(server), closing(processes):
        for tick in range(4):
            sensed = {"flock": readings(tick, [0, 1])}
            processes.tick(tick, 0, sensed, SILENCE, NO_TX_STATUSES)
            answers = [event for event in until_read(processes, 2) if isinstance(event, ProcessAnswer)]
            if tick == 2:  # its answer is discarded
                server.processes[1].shutdown(socket.SHUT_RDWR)
                (lost,) = until_read(processes, 1)
                assert isinstance(lost, Lost)
                assert lost.ended_itself
                assert processes.restart(lost.process, 0)
                processes.tick(tick, 0, sensed, SILENCE, NO_TX_STATUSES, lost.process)
                answers = [answer for answer in answers if answer.process is not lost.process]
                answers += [event for event in until_read(processes, 1) if isinstance(event, ProcessAnswer)]
            actions, _, _ = processes.read(answers)
            commands.append(actions.linear_mps[np.argsort(actions.rows)].tolist())
    assert commands == [[step, step] for step in (1.0, 2.0, 3.0, 4.0)]


def test_restarts_of_a_process_end_after_three() -> None:
    server, robots = Scripted(), assignment(group(spec("Echo"), [0]))
    processes = AgentProcesses(cast("ForkServer", server), robots, 1, {}, layouts_of(robots), 0)
    with closing(server), closing(processes):
        restarted: list[bool] = []
        while not restarted or restarted[-1]:
            server.processes[-1].close()
            (lost,) = processes.events(0)
            assert isinstance(lost, Lost)
            restarted.append(processes.restart(lost.process, 0))
    assert restarted == [True, True, True, False]
    assert not len(processes)


def test_process_that_freezes_within_a_frame_delays_no_other() -> None:
    server, robots = Scripted(), assignment(group(spec("Echo"), [0, 1]))
    processes = AgentProcesses(cast("ForkServer", server), robots, 2, None, {}, 0)
    with closing(server), closing(processes), server.processes[0] as freezes, server.processes[1] as lives:
        frame = content_frame(READY, b"x" * 100_000)
        freezes.send(frame[:MAX_MESSAGE])
        lives.send(content_frame(READY, None))
        reading = threading.Thread(target=processes.events, args=(0,), daemon=True)
        reading.start()
        reading.join(10.0)
        assert not reading.is_alive()
        assert not processes.are_ready
        freezes.send(frame[MAX_MESSAGE:])
        processes.events(0)
        assert processes.are_ready


def test_frames_for_a_busy_process_wait_with_only_the_newest_tick() -> None:
    """Packets of tick 3 come after its step: else the agent's time would go back."""
    server, robots = Scripted(), assignment(group(spec("Echo"), [0]))
    processes = AgentProcesses(cast("ForkServer", server), robots, 1, None, {}, 0)
    received = received_from(words(1), [0])
    with closing(server), closing(processes), server.processes[0] as process:
        process.send(content_frame(READY, None))
        processes.events(0)
        for tick in (1, 2):
            processes.tick(tick, 0, {"flock": readings(tick, [0])}, SILENCE, NO_TX_STATUSES)
        processes.packets(2, 0, 0, received, NO_TX_STATUSES)
        processes.tick(3, 0, {"flock": readings(3, [0])}, SILENCE, NO_TX_STATUSES)
        processes.packets(3, 0, 0, received, NO_TX_STATUSES)
        kinds: list[tuple[int, int]] = []
        while len(kinds) < 4:
            _, kind, tick, *_ = HEAD.unpack_from(receive(process))
            if kind not in (ASSIGN, FIELDS):
                kinds.append((kind, tick))
                process.send(write_actions(tick, standing([0] if kind == TICK else [])))
                processes.events(0)
    assert kinds == [(TICK, 1), (PACKETS, 2), (TICK, 3), (PACKETS, 3)]
