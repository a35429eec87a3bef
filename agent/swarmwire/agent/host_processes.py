"""The agent processes of a host: each gets its part of a tick, and answers; a process at fault is lost alone.

A process has at most one frame to answer, so no socket fills up. Frames for a process that is still busy wait in their
order, and a tick among them is replaced by the next; in lockstep that does not happen. A process that is gone, or sends
a frame that is not requested or does not decode, is ended. A process that ended by itself may be restarted.
`AgentProcesses` has no network: the host carries its frames.
"""

import select
import socket
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from swarmwire.agent.agent_process import assign
from swarmwire.agent.fork_server import ForkServer
from swarmwire.agent.process_answers import AnswerFrame, AnswerReader, answer_in, failure_in, size_limits
from swarmwire.agent.process_frames import (
    FAILED,
    FIELDS,
    READY,
    ProcessFrame,
    RecordFields,
    content_frame,
    frame_kind,
    receive_part,
    record_fields,
    send,
)
from swarmwire.agent.process_ticks import TickCutter
from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.errors import BadFrame, BadInput
from swarmwire.comms.robot.packets import ReceivedPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings
from swarmwire.comms.wire.agent_memory import GroupMemories, Layout
from swarmwire.comms.wire.assignment import Assignment, split
from swarmwire.comms.wire.limits import MAX_RESTARTS

READY_TIMEOUT_NS = 45_000_000_000  # until a process has made its agents; the world waits 60 s for its host
REFUSED = "its answer is refused: "  # text before the fault


class Request(NamedTuple):
    """A frame that a process has to answer."""

    frame: ProcessFrame
    tick: int
    is_tick: bool  # False: packets between ticks


@dataclass(eq=False)
class AgentProcess:
    """One process, seen by its host."""

    number: int
    fork: int  # number at the fork server, another after each restart
    assignment: Assignment
    socket: socket.socket
    max_bytes: int  # limit of an answer
    busy_since_ns: int | None  # since then it makes its agents or answers a frame; None: it waits for a frame
    is_ready: bool = False
    unanswered: Request | None = None
    waiting: deque[Request] = field(default_factory=deque[Request])  # while it is busy
    fields_sent: int = 0  # number of groups whose fields were sent to it
    parts: list[bytes] = field(default_factory=list[bytes])  # messages of a frame that is incomplete
    restarts: int = 0

    @property
    def rows(self) -> IntArray:
        """Robot rows of the process, rising."""
        return np.sort(self.assignment.rows)


class ProcessAnswer(NamedTuple):
    """A frame "actions" of a process."""

    process: AgentProcess
    tick: int
    is_step: bool  # answer to a tick; False: to packets between ticks
    frame: AnswerFrame


class Lost(NamedTuple):
    """A process that is gone, or was ended since it was silent or sent a wrong frame.

    If its agent raised, also the robots of that agent, and the traceback.
    """

    process: AgentProcess
    reason: str
    robots: str = ""
    traceback: str = ""
    ended_itself: bool = False  # killed or exited, and not ended by its host


class AgentProcesses:
    """The agent processes of the robots of an assignment."""

    def __init__(
        self,
        server: ForkServer,
        assignment: Assignment,
        processes: int,
        memory: GroupMemories | None,
        layouts: Mapping[str, Layout],
        now_ns: int,
    ) -> None:
        """Fork the processes, at most one per robot; `events` makes them ready.

        `memory` is that of earlier agents, with the columns of `layouts`; None: the world keeps none.
        """
        parts = split(assignment, processes)
        sockets = server.fork(len(parts))
        limits = size_limits(parts)
        for sock in sockets:
            sock.setblocking(False)
        self._server = server
        self._by_number = [
            AgentProcess(number, number, part, sock, limit, now_ns)
            for number, (part, sock, limit) in enumerate(zip(parts, sockets, limits, strict=True))
        ]
        self._by_fork = dict(enumerate(self._by_number))
        self._forks = len(parts)
        self._memory: GroupMemories = dict(memory or {})  # memory after the last answers, if the world keeps any
        self._processes = {process.socket.fileno(): process for process in self._by_number}  # without lost ones
        self._cutter = TickCutter(
            [{group.name: group.rows for group in part.groups} for part in parts], assignment.measures or ()
        )
        self._reader = AnswerReader(parts, layouts)
        self._fields: dict[str, RecordFields] = {}
        self._poll = select.epoll()
        for file in (*self._processes, server.fileno()):
            self._poll.register(file, select.EPOLLIN)
        for process in self._by_number:
            self._send(process, [assign(process.assignment, _memory_of(memory, process.assignment))])

    def fileno(self) -> int:
        """Return the file that is readable once there are events."""
        return self._poll.fileno()

    @property
    def are_ready(self) -> bool:
        """True if there are processes, and all have made their agents."""
        return bool(self._processes) and all(process.is_ready for process in self._processes.values())

    def __len__(self) -> int:
        return len(self._processes)

    def tick(
        self,
        tick: int,
        now_ns: int,
        readings: Readings,
        received: ReceivedPackets,
        tx_status: TxStatuses,
        restarted: AgentProcess | None = None,
    ) -> list[AgentProcess]:
        """Send each process, or only a restarted one, its part of a tick; return those with robots in it."""
        for name, group in readings.items():
            if name not in self._fields:
                self._fields[name] = record_fields(group)
        addressed: list[AgentProcess] = []
        for process, frame in zip(self._by_number, self._cutter.tick(tick, readings, received, tx_status), strict=True):
            if frame.buffers and process.socket.fileno() >= 0 and restarted in (None, process):
                addressed.append(process)
                process.waiting = deque(request for request in process.waiting if not request.is_tick)
                process.waiting.append(Request(frame, tick, is_tick=True))
                self._send_next(process, now_ns)
        return addressed

    def packets(self, tick: int, at_ns: int, now_ns: int, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Send each process its packets and statuses between two ticks."""
        for process, frame in zip(self._by_number, self._cutter.packets(tick, at_ns, received, tx_status), strict=True):
            if frame.buffers and process.socket.fileno() >= 0:
                process.waiting.append(Request(frame, tick, is_tick=False))
                self._send_next(process, now_ns)

    def events(self, now_ns: int) -> list[ProcessAnswer | Lost]:
        """Read frames of the processes, and send frames that waited for them."""
        files = [file for file, _ in self._poll.poll(0, len(self._processes) + 1)]
        processes = [self._processes[file] for file in files if file in self._processes]
        events = [event for process in processes if (event := self._read(process, now_ns))]
        # Reports come after the sockets: a process may have answered before it ended. A program that it started may
        # hold its socket open, so that the server's report is the only sign.
        for number in self._server.reports():
            process = self._by_fork.get(number)
            while process and process.socket.fileno() >= 0:
                events.append(self._read(process, now_ns) or self.lose(process, ""))
        if self._server.is_gone and self._server.fileno() in files:
            self._poll.unregister(self._server)
        return events

    def read(self, answers: Sequence[ProcessAnswer]) -> tuple[Actions, GroupMemories | None, list[Lost]]:
        """Return the joined actions and memory of answers of one kind, and processes lost by faults in theirs."""
        lost: list[Lost] = []
        while True:
            frames, is_step = [answer.frame for answer in answers], all(answer.is_step for answer in answers)
            try:
                actions, memory = self._reader.read(frames, is_step=is_step)
                self._remember(memory or {})
                return actions, memory, lost
            except BadFrame:
                faults = self._reader.faults(frames, is_step=is_step)
            for number, fault in faults.items():
                process = self._by_number[number]
                if process.socket.fileno() >= 0:
                    lost.append(self.lose(process, REFUSED + fault))
            answers = [answer for answer in answers if answer.process.number not in faults]

    def silent(self, now_ns: int, timeout_ns: int) -> list[AgentProcess]:
        """Return the processes that have not answered, or not made their agents, for this time."""
        return [
            process
            for process in self._processes.values()
            if process.busy_since_ns is not None
            and now_ns - process.busy_since_ns
            > (timeout_ns if process.is_ready or process.restarts else READY_TIMEOUT_NS)
        ]

    def lose(self, process: AgentProcess, reason: str) -> Lost:
        """End a process; without a reason the process ended by itself, and the server reports how."""
        del self._processes[process.socket.fileno()]
        self._poll.unregister(process.socket)
        process.socket.close()
        end = self._server.end(process.fork, closed=not reason)
        del self._by_fork[process.fork]
        return Lost(process, reason or f"its process {end}", ended_itself=not reason)

    def restart(self, process: AgentProcess, now_ns: int) -> bool:
        """Restart a lost process, with its agents' memory after their last answers; return True if it was possible.

        It is impossible after `MAX_RESTARTS` restarts, and without the fork server.
        """
        if process.restarts >= MAX_RESTARTS:
            return False
        fork, self._forks = (
            self._forks,
            self._forks + 1,
        )  # the server also counts a process whose socket does not arrive
        try:
            (process.socket,) = self._server.fork(1)
        except (OSError, BadInput):
            return False
        process.socket.setblocking(False)
        process.fork, process.restarts = fork, process.restarts + 1
        process.is_ready, process.busy_since_ns, process.unanswered, process.fields_sent = False, now_ns, None, 0
        process.waiting.clear()
        process.parts.clear()
        self._by_fork[process.fork] = self._processes[process.socket.fileno()] = process
        self._poll.register(process.socket, select.EPOLLIN)
        self._send(process, [assign(process.assignment, _memory_of(self._memory, process.assignment))])
        return True

    def close(self) -> None:
        """End all processes."""
        for process in [*self._processes.values()]:
            process.socket.close()
        self._processes.clear()
        self._poll.close()

    def _read(self, process: AgentProcess, now_ns: int) -> ProcessAnswer | Lost | None:
        """Read from a process; None: nothing, an incomplete frame, or the frame that it is ready."""
        try:
            frame = receive_part(process.socket, process.parts, process.max_bytes)
        except BlockingIOError:
            return None
        except OSError:
            frame = b""
        except BadFrame as fault:
            return self.lose(process, REFUSED + str(fault))
        if frame == b"":
            return self.lose(process, "")
        try:
            return self._event(process, frame, now_ns)
        except BadFrame as fault:
            return self.lose(process, REFUSED + str(fault))

    def _event(self, process: AgentProcess, frame: bytes | None, now_ns: int) -> ProcessAnswer | Lost | None:
        """Return the event of a frame; None for an incomplete frame and for READY. BadFrame for a wrong frame."""
        request = process.unanswered
        if request is None and process.is_ready:
            raise BadFrame("unexpected_kind", "a frame without a request")
        if frame is None:  # the process may freeze before it sends all: the others do not wait for it
            return None
        kind = frame_kind(frame)
        if kind == FAILED:
            failure = failure_in(frame)
            self.lose(process, failure.reason)
            names = process.assignment.robot_names
            robots = failure.robots if failure.robots in names else process.assignment.robots_text
            return Lost(process, failure.reason, robots, failure.traceback)
        answer = None
        if request is None:
            if kind != READY:
                raise BadFrame("unexpected_kind", f"kind {kind} before it was ready")
            process.is_ready = True
        else:
            parsed = answer_in(process.number, frame, request.tick, request.frame.rows)
            answer = ProcessAnswer(process, request.tick, request.is_tick, parsed)
        # A restarted process makes its agents and answers within one time-out: its world allows the host no more.
        since_ns = process.busy_since_ns if process.restarts and answer is None else None
        process.busy_since_ns = process.unanswered = None
        self._send_next(process, now_ns if since_ns is None else since_ns)
        return answer

    def _remember(self, memory: GroupMemories) -> None:
        """Keep the agents' memory after these answers, for processes that are restarted."""
        for name, newest in memory.items():
            self._memory[name] = self._memory[name].updated(newest) if name in self._memory else newest

    def _send_next(self, process: AgentProcess, now_ns: int) -> None:
        """Send the next frame, if the process waits for one."""
        if process.busy_since_ns is not None or not process.waiting:
            return
        process.unanswered = process.waiting.popleft()
        process.busy_since_ns = now_ns
        if process.fields_sent < len(self._fields):
            names = [group.name for group in process.assignment.groups if group.name in self._fields]
            self._send(process, [content_frame(FIELDS, {name: self._fields[name] for name in names})])
            process.fields_sent = len(self._fields)
        self._send(process, process.unanswered.frame.buffers)

    def _send(self, process: AgentProcess, buffers: list[bytes | memoryview]) -> None:
        try:
            send(process.socket, buffers)
        except OSError:  # a closed socket is found by `events`, a process that reads nothing by `silent`
            return


def _memory_of(memory: GroupMemories | None, assignment: Assignment) -> GroupMemories | None:
    """Return the memory of the robots of an assignment."""
    if not memory:
        return memory
    parts = {group.name: memory[group.name].for_rows(group.rows) for group in assignment.groups if group.name in memory}
    return {name: part for name, part in parts.items() if len(part.rows)}
