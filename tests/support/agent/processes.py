"""Agent processes without processes: the same frames in memory, or the same sockets to threads of this process."""

import os
import socket
import threading
from collections.abc import Sequence
from typing import cast

import numpy as np

from swarmwire.agent.agent import load_agent
from swarmwire.agent.agent_group import layout_of
from swarmwire.agent.agent_process import agents_of, serve
from swarmwire.agent.fork_server import ForkServer
from swarmwire.agent.process_answers import AnswerFrame, AnswerReader, answer_in, in_order
from swarmwire.agent.process_frames import ProcessFrame, record_fields
from swarmwire.agent.process_ticks import TickCutter
from swarmwire.comms.robot.packets import ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings
from swarmwire.comms.wire.agent_memory import GroupMemories, Layout
from swarmwire.comms.wire.assignment import Assignment, split


def layouts_of(assignment: Assignment) -> dict[str, Layout]:
    """The columns of memory of each group's agents."""
    return {group.name: layout_of(load_agent(group.agent)) for group in assignment.groups}


class Processes:
    """Robots divided between processes, whose frames stay in memory."""

    def __init__(self, assignment: Assignment, processes: int, memory: GroupMemories | None = None) -> None:
        self.assignment, self.parts = assignment, split(assignment, processes)
        self.agents = [agents_of(part, _of_part(memory, part)) for part in self.parts]
        self._cutter = TickCutter(
            [{group.name: group.rows for group in part.groups} for part in self.parts], assignment.measures or ()
        )
        self.reader = AnswerReader(self.parts, layouts_of(assignment))
        self.memory: GroupMemories | None = None
        self.answers: list[AnswerFrame] = []  # answers to the last frame
        self.rows: list[bytes] = []  # rows that acted in the last frame, for each process

    def act(self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses) -> Actions:
        fields = {name: record_fields(group) for name, group in readings.items()}
        frames = self._cutter.tick(tick, readings, received, tx_status)
        for agents, part, frame in zip(self.agents, self.parts, frames, strict=True):
            if frame.buffers:
                agents.set_fields({group.name: fields[group.name] for group in part.groups if group.name in fields})
        actions, self.memory = self.reader.read(self._answers(tick, frames))
        return in_order(actions, np.concatenate([group.rows for group in readings.values()]))

    def on_receive(self, tick: int, at_ns: int, received: ReceivedPackets, tx_status: TxStatuses) -> SentPackets:
        frames = self._cutter.packets(tick, at_ns, received, tx_status)
        actions, _ = self.reader.read(self._answers(tick, frames), is_step=False)
        return actions.sent

    def _answers(self, tick: int, frames: Sequence[ProcessFrame]) -> list[AnswerFrame]:
        self.rows = [frame.rows for frame in frames]
        self.answers = [
            answer_in(number, agents.act(b"".join(frame.buffers)), tick, frame.rows)
            for number, (agents, frame) in enumerate(zip(self.agents, frames, strict=True))
            if frame.buffers
        ]
        return self.answers


def _of_part(memory: GroupMemories | None, part: Assignment) -> GroupMemories | None:
    if memory is None:
        return None
    return {group.name: memory[group.name].for_rows(group.rows) for group in part.groups if group.name in memory}


def thread_server() -> ForkServer:
    """A `ThreadServer`, as what it stands for."""
    return cast("ForkServer", ThreadServer())


class ThreadServer:
    """A `ForkServer` that starts a thread in place of each process."""

    def __init__(self) -> None:
        self._threads: list[threading.Thread] = []
        self.processes: list[socket.socket] = []  # the threads' ends
        self._silence = os.eventfd(0)
        self.missing: list[str] = []
        self.is_gone = False

    def fileno(self) -> int:
        """A file that is never readable: threads end with their sockets."""
        return self._silence

    def reports(self) -> list[int]:
        """None: threads end with their sockets."""
        return []

    def load(self, agents: Sequence[str]) -> None:
        """Nothing: agents are imported in this process."""

    def fork(self, processes: int) -> list[socket.socket]:
        return [self._started() for _ in range(processes)]

    def _started(self) -> socket.socket:
        of_host, of_process = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)

        def play() -> None:
            with of_process:
                serve(of_process)

        thread = threading.Thread(target=play, daemon=True)
        thread.start()
        self._threads.append(thread)
        self.processes.append(of_process)
        return of_host

    def end(self, process: int, *, closed: bool = False) -> str:
        """Reason of an end; threads end by themselves once their socket is closed."""
        return f"thread {process} ended"

    def close(self) -> None:
        for thread in self._threads:
            thread.join(10.0)
        os.close(self._silence)


class Scripted(ThreadServer):
    """A server whose processes are the other ends of sockets in the test's hands."""

    def fork(self, processes: int) -> list[socket.socket]:
        pairs = [socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET) for _ in range(processes)]
        self.processes += [of_process for _, of_process in pairs]
        return [of_host for of_host, _ in pairs]


def standing(rows: list[int]) -> Actions:
    """The actions of robots that do nothing."""
    zero = np.zeros(len(rows))
    return Actions(np.array(rows, np.int64), zero != 0.0, zero, zero, zero)
