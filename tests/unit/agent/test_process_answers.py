"""A process that answers anything but its own robots' actions is lost, and no other."""

from collections.abc import Generator
from contextlib import closing, contextmanager
from typing import NamedTuple, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.agent.fork_server import ForkServer
from swarmwire.agent.host_processes import AgentProcesses, Lost, ProcessAnswer
from swarmwire.agent.process_answers import write_actions
from swarmwire.agent.process_frames import READY, content_frame
from swarmwire.comms.robot.packets import NO_TX_STATUSES
from swarmwire.comms.robot.tick_io import Actions
from tests.support.agent.hostile import ANSWERS
from tests.support.agent.hosts import SILENCE, assignment, group, readings, spec
from tests.support.agent.processes import Scripted, layouts_of, standing

TICK, HOSTILE, HONEST = 7, 1, 0  # a tick; robot rows, of which each has a process of this number
VALID = write_actions(TICK, standing([HOSTILE]), None)


class Outcome(NamedTuple):
    """What the host made of the answers to one tick."""

    lost: list[Lost]
    actions: Actions


@contextmanager
def waiting_processes() -> Generator[tuple[AgentProcesses, Scripted]]:
    """Two processes that are asked for a tick, without memory."""
    server, robots = Scripted(), assignment(group(spec("Echo"), [HONEST, HOSTILE]))
    processes = AgentProcesses(cast("ForkServer", server), robots, 2, None, layouts_of(robots), 0)
    with closing(server), closing(processes), server.processes[0], server.processes[1]:
        for process in server.processes:
            process.send(content_frame(READY, None))
        processes.events(0)
        processes.tick(TICK, 0, {"flock": readings(TICK, [HONEST, HOSTILE])}, SILENCE, NO_TX_STATUSES)
        yield processes, server


def outcome(messages: list[bytes]) -> Outcome:
    """The outcome of these messages of one process, beside an honest answer of the other."""
    with waiting_processes() as (processes, server):
        server.processes[HONEST].send(write_actions(TICK, standing([HONEST]), None))
        for data in messages:
            server.processes[HOSTILE].send(data)
        events = [event for _ in messages for event in processes.events(0)]
        lost = [event for event in events if isinstance(event, Lost)]
        lost_processes = [loss.process for loss in lost]
        answers = [
            event for event in events if isinstance(event, ProcessAnswer) and event.process not in lost_processes
        ]
        actions, _, more = processes.read(answers)
        return Outcome([*lost, *more], actions)


@pytest.mark.parametrize("attack", ANSWERS)
def test_attack_loses_its_process_alone(attack: str) -> None:
    lost, actions = outcome(ANSWERS[attack](TICK, HOSTILE)[:20])
    assert [loss.process.number for loss in lost] == [HOSTILE]
    assert actions.rows.tolist() == [HONEST]
    assert len(actions.sent) == len(actions.notes) == len(actions.values) == 0


def test_failure_in_the_name_of_another_robot_loses_the_sender() -> None:
    (lost,), _ = outcome(ANSWERS["the failure of another"](TICK, HOSTILE)[:1])
    assert (lost.robots, lost.reason) == ("flock-1", "its agent failed: a lie")


@given(
    st.lists(st.tuples(st.integers(0, len(VALID) - 1), st.integers(0, 255)), max_size=6),
    st.integers(0, len(VALID)),
    st.binary(max_size=60),
)
def test_mutated_answer_loses_at_most_its_own_process(
    changes: list[tuple[int, int]], length: int, added: bytes
) -> None:
    data = bytearray(VALID)
    for at, byte in changes:
        data[at] = byte
    lost, actions = outcome([bytes(data[:length]) + added or b"x"])
    assert {loss.process.number for loss in lost} <= {HOSTILE}
    assert actions.rows.tolist() == ([HONEST] if lost or HOSTILE not in actions.rows else [HONEST, HOSTILE])
    assert np.isin(actions.sent.sender, [HOSTILE]).all()
