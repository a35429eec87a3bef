"""The agent processes of a host: each gets its part of a tick, and answers; one that is gone or silent is lost alone.

A process has at most one frame to answer, so no socket fills up. Frames for a process that is still busy wait in their
order, and a tick among them is replaced by the next; in lockstep that does not happen. `AgentProcesses` has no network:
the host carries its frames.
"""

import select
import socket
from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from swarmwire.agent.agent_process import ForkServer
from swarmwire.agent.process_frames import (
    ACTIONS,
    ANSWER_HEAD,
    FAILED,
    FIELDS,
    Buffers,
    RecordFields,
    TickCutter,
    content,
    message,
    receive_part,
    record_fields,
    send,
)
from swarmwire.comms.arrays import IntArray
from swarmwire.comms.assignment import Assignment, split
from swarmwire.comms.packets import ReceivedPackets, TxStatuses
from swarmwire.comms.tick_io import Readings


class Waiting(NamedTuple):
    """A frame that waits for its process."""

    buffers: Buffers
    is_tick: bool  # else packets between two


@dataclass(eq=False)
class AgentProcess:
    """One process as its host sees it."""

    number: int
    assignment: Assignment
    socket: socket.socket
    busy_since_ns: int | None = None  # unanswered since; None: it waits for a frame
    is_ready: bool = False
    in_step: bool = False  # whether the unanswered frame is a tick
    waiting: deque[Waiting] = field(default_factory=deque[Waiting])  # while it is busy
    fields_known: int = 0  # groups whose fields it has
    parts: list[bytes] = field(default_factory=list[bytes])  # of a frame that has not arrived whole

    @property
    def rows(self) -> IntArray:
        """Its robot rows, rising."""
        return np.sort(self.assignment.rows)


class Answer(NamedTuple):
    """A frame "actions" of a process."""

    process: AgentProcess
    tick: int
    is_step: bool  # to a tick; else to packets between two
    frame: bytes


class Lost(NamedTuple):
    """A process that is gone, or was ended: it answered nothing for too long.

    If its agent raised, also the robots that it played, and the traceback.
    """

    process: AgentProcess
    reason: str
    robots: str = ""
    traceback: str = ""


class AgentProcesses:
    """The agent processes of the robots of an assignment."""

    def __init__(self, server: ForkServer, assignment: Assignment, processes: int, memory: bytes | None) -> None:
        """Fork so many, at most one per robot. They are made ready in `events`."""
        parts = split(assignment, processes)
        sockets = server.fork(assignment, [part.rows.tolist() for part in parts], memory)
        for sock in sockets:
            sock.setblocking(False)
        self._server = server
        self._processes = {
            sock.fileno(): AgentProcess(number, part, sock)
            for number, (part, sock) in enumerate(zip(parts, sockets, strict=True))
        }
        self._by_number = list(self._processes.values())
        self._cutter = TickCutter(
            [{group.name: group.rows for group in part.groups} for part in parts], assignment.measures or ()
        )
        self._fields: dict[str, RecordFields] = {}
        self._poll = select.epoll()
        for file in self._processes:
            self._poll.register(file, select.EPOLLIN)

    def fileno(self) -> int:
        """The file that is readable once `events` has any."""
        return self._poll.fileno()

    @property
    def are_ready(self) -> bool:
        """Whether there are any, and their agents are made."""
        return bool(self._processes) and all(process.is_ready for process in self._processes.values())

    def __len__(self) -> int:
        return len(self._processes)

    def tick(
        self, tick: int, now_ns: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses
    ) -> list[AgentProcess]:
        """Send each process its part of a tick; returns those that have robots in it."""
        for name, group in readings.items():
            if name not in self._fields:
                self._fields[name] = record_fields(group)
        asked: list[AgentProcess] = []
        for process, buffers in zip(
            self._by_number, self._cutter.tick(tick, readings, received, tx_status), strict=True
        ):
            if buffers and process.socket.fileno() >= 0:
                asked.append(process)
                process.waiting = deque(frame for frame in process.waiting if not frame.is_tick)
                process.waiting.append(Waiting(buffers, is_tick=True))
                self._send_next(process, now_ns)
        return asked

    def packets(self, tick: int, at_ns: int, now_ns: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Send each process its packets and statuses between two ticks."""
        for process, buffers in zip(
            self._by_number, self._cutter.packets(tick, at_ns, received, tx_status), strict=True
        ):
            if buffers and process.socket.fileno() >= 0:
                process.waiting.append(Waiting(buffers, is_tick=False))
                self._send_next(process, now_ns)

    def events(self, now_ns: int) -> list[Answer | Lost]:
        """Read what the processes sent, and send what waited for them."""
        events: list[Answer | Lost] = []
        for file, _ in self._poll.poll(0, max(len(self._processes), 1)):
            process = self._processes[file]
            try:
                frame = receive_part(process.socket, process.parts)
            except OSError:
                frame = b""
            if frame is None:  # its process may freeze before it sends the rest: the others do not wait for it
                continue
            if not frame:
                events.append(self.lose(process, ""))
                continue
            process.busy_since_ns = None
            _, kind, tick, *_ = ANSWER_HEAD.unpack_from(frame)
            if kind == FAILED:
                self.lose(process, "")
                events.append(Lost(process, **content(frame)))
                continue
            if kind == ACTIONS:
                events.append(Answer(process, tick, process.in_step, frame))
            process.is_ready = True
            self._send_next(process, now_ns)
        return events

    def silent(self, now_ns: int, timeout_ns: int) -> list[AgentProcess]:
        """The processes that have not answered for so long."""
        return [
            process
            for process in self._processes.values()
            if process.busy_since_ns is not None and now_ns - process.busy_since_ns > timeout_ns
        ]

    def lose(self, process: AgentProcess, reason: str) -> Lost:
        """End a process; without a reason, it is the way in which it ended by itself."""
        del self._processes[process.socket.fileno()]
        self._poll.unregister(process.socket)
        process.socket.close()
        how = self._server.end(process.number)
        return Lost(process, reason or f"its process {how}")

    def close(self) -> None:
        """End all processes."""
        for process in [*self._processes.values()]:
            process.socket.close()
        self._processes.clear()
        self._poll.close()

    def _send_next(self, process: AgentProcess, now_ns: int) -> None:
        """Send the next frame, if the process waits for one."""
        if process.busy_since_ns is not None or not process.is_ready or not process.waiting:
            return
        buffers, process.in_step = process.waiting.popleft()
        process.busy_since_ns = now_ns
        try:
            if process.fields_known < len(self._fields):
                names = [group.name for group in process.assignment.groups if group.name in self._fields]
                send(process.socket, [message(FIELDS, {name: self._fields[name] for name in names})])
                process.fields_known = len(self._fields)
            send(process.socket, buffers)
        except OSError:  # it is gone or reads nothing: `events` finds the end of its socket, or `silent` finds it
            return
