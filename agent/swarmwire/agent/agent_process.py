"""Agent processes: the robots of one process behind a socket to their agent host, and the server that forks them.

The fork server is forked from the host before that opens its network session, so it has no threads; it imports the
agents' code once, for all processes. An agent process gets one socket to its host and no network. It ends with its host
and with the fork server, for any agent.
"""

import ctypes
import gc
import os
import resource
import signal
import socket
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from swarmwire.agent.agent import Agent, AgentClass, NoAgent, load_agent
from swarmwire.agent.host import AgentExecutor, failed, layout_of
from swarmwire.agent.one_robot import OneRobotAgent
from swarmwire.agent.process_frames import (
    FAILED,
    FIELDS,
    HEAD,
    READY,
    TICK,
    RecordField,
    RecordFields,
    content,
    frame_kind,
    message,
    read_packets,
    read_tick,
    receive,
    send,
    write_actions,
)
from swarmwire.comms.assignment import Assignment, GroupAssignment, part_of
from swarmwire.comms.errors import AgentFailed, BadFrame, BadInput
from swarmwire.comms.tick_io import Actions
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.agent_memory import Memory, decode_memory, encode_memory
from swarmwire.comms.wire.frames import Frame

LOAD, FORK, KILL = range(3)  # requests of a host to its fork server
PR_SET_PDEATHSIG = 1  # of prctl: the signal that a process gets when its parent ends


class ForkServer:
    """The process that forks agent processes, as its host sees it."""

    def __init__(self) -> None:
        """Fork it from this process, which must have no other thread."""
        self._socket, of_server = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        host = os.getpid()
        self.pid = os.fork()
        if self.pid == 0:
            self._socket.close()
            _end_with_parent(host)
            _exit_after(lambda: _serve_forks(of_server))
        of_server.close()

    def load(self, agents: Sequence[str]) -> None:
        """Import agents, whose processes then share the code; a missing one fails in its process."""
        send(self._socket, (message(LOAD, list(agents)),))

    def fork(
        self, assignment: Assignment, rows: Sequence[Sequence[int]], memory: bytes | None = None
    ) -> list[socket.socket]:
        """Fork a process for each of these lists of robot rows; returns the sockets to them.

        `memory` is a frame with that of earlier agents; None: the world keeps none. BadInput if this process may not
        open so many files.
        """
        request = {"assignment": assignment.as_mapping(), "rows": [list(of) for of in rows], "memory": memory}
        send(self._socket, (message(FORK, request),))
        sockets: list[socket.socket] = []
        for _ in rows:
            _, files, _, _ = socket.recv_fds(self._socket, 1, 1)
            if not files:  # the system drops what this process has no room for
                limit, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
                expected = f"expected fewer than {len(rows)} processes, or a limit above {limit} open files (ulimit -n)"
                raise BadInput("--processes", "", expected)
            sockets.append(socket.socket(fileno=files[0]))
        return sockets

    def end(self, process: int) -> str:
        """Kill a process, the n-th that was forked; returns how it ended: by itself, if it had ended before."""
        send(self._socket, (message(KILL, process),))
        return content(receive(self._socket))

    def close(self) -> None:
        """End the server and all its processes."""
        self._socket.close()
        os.waitpid(self.pid, 0)


def _serve_forks(control: socket.socket) -> None:
    """Carry out the host's requests until it is gone; then kill all processes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the host
    pids: list[int] = []
    statuses: dict[int, int] = {}
    try:
        while frame := receive(control):
            request = content(frame)
            kind = frame_kind(frame)
            if kind == LOAD:
                for agent in request:
                    with suppress(NoAgent):
                        load_agent(agent)
            elif kind == FORK:
                whole = Assignment.from_mapping(request["assignment"])
                gc.collect()
                gc.freeze()  # the collector would write to, and so copy, every shared page
                memory = request["memory"]
                pids += [_fork(control, part_of(whole, np.array(rows)), memory) for rows in request["rows"]]
            elif kind == KILL:
                process = int(request)
                if process not in statuses:
                    with suppress(ProcessLookupError):
                        os.kill(pids[process], signal.SIGKILL)
                    statuses[process] = os.waitpid(pids[process], 0)[1]
                send(control, (message(KILL, _in_words(statuses[process])),))
    finally:
        left = [pid for process, pid in enumerate(pids) if process not in statuses]
        for pid in left:
            os.kill(pid, signal.SIGKILL)
        for pid in left:
            os.waitpid(pid, 0)


def _fork(control: socket.socket, assignment: Assignment, memory: bytes | None) -> int:
    of_host, of_process = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    server = os.getpid()
    pid = os.fork()
    if pid == 0:
        control.close()
        of_host.close()
        _end_with_parent(server)
        with suppress(OSError):  # without memory, the system is to end this process and not the world
            Path("/proc/self/oom_score_adj").write_text("500")
        _exit_after(lambda: serve(of_process, lambda: agents_of(assignment, memory)))
    of_process.close()
    socket.send_fds(control, [b"s"], [of_host.fileno()])
    of_host.close()
    return pid


def _in_words(status: int) -> str:
    code = os.waitstatus_to_exitcode(status)
    return f"ended with exit code {code}" if code >= 0 else f"was ended by {signal.Signals(-code).name}"


def _end_with_parent(parent: int) -> None:
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it ended before; not 1: in a container, the host itself may be process 1
        os._exit(1)


def _exit_after(work: Callable[[], None]) -> NoReturn:
    code = 1
    try:
        work()
        code = 0
    except BaseException:  # noqa: BLE001 - the last frame of this process: show any error and end
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        os._exit(code)


def serve(sock: socket.socket, make: Callable[[], "OneRobotAgent | ManyRobots"]) -> None:
    """Play the robots of one process until the host closes the socket, or an agent fails."""
    try:
        agents = make()
        send(sock, (message(READY, None),))
        act = agents.act
        while frame := receive(sock):
            if frame_kind(frame) != FIELDS:
                send(sock, (act(frame),))
                continue
            fields: dict[str, list[list[Any]]] = content(frame)
            agents.set_fields({name: tuple(RecordField(*of) for of in group) for name, group in fields.items()})
    except AgentFailed as error:
        *_, last = traceback.format_exception_only(error.__cause__)
        failure = {"robots": error.robots, "traceback": error.traceback, "reason": f"its agent failed: {last.strip()}"}
        send(sock, (message(FAILED, failure),))
    except OSError:  # the host is gone
        return
    while receive(sock):  # the host closes the socket once it has read the failure
        pass


class ManyRobots:
    """The agents of a process with several robots, or with a `VectorAgent`."""

    def __init__(self, assignment: Assignment, memory: Memory | None = None, *, keeps_memory: bool = False) -> None:
        self._executor = AgentExecutor(assignment, memory)
        self._groups = tuple(group.name for group in assignment.groups)
        self._fields: Mapping[str, RecordFields] = {}
        self._measures, self._keeps_memory = assignment.measures or (), keeps_memory

    def set_fields(self, fields: Mapping[str, RecordFields]) -> None:
        """Set the fields of the records, by group: before the first tick."""
        self._fields = fields

    def act(self, frame: bytes) -> bytes:
        """The frame "actions" for a frame "tick" or "packets"; AgentFailed if the agent raises."""
        _, kind, *_ = HEAD.unpack_from(frame)
        if kind == TICK:
            tick, readings, received, tx_status = read_tick(frame, self._groups, self._fields, self._measures)
            actions = self._executor.act(tick, readings, received, tx_status)
            rest: dict[str, Any] = {}
            if self._keeps_memory:
                rest["memory"] = encode_memory(self._executor.memory(readings))
            return write_actions(tick, actions, rest)
        tick, at_ns, received, tx_status = read_packets(frame, self._measures)
        self._executor.receive(received, tx_status)
        return write_actions(tick, replace(Actions.joined([]), sent=self._executor.on_receive(tick, at_ns)), {})


def agents_of(assignment: Assignment, memory: bytes | None) -> OneRobotAgent | ManyRobots:
    """The agents of a process: without arrays if it has one robot, whose agent is an `Agent`.

    `memory` is a frame with that of earlier agents, of which each group gets what fits; None: the world keeps none.
    AgentFailed if an agent cannot be made.
    """
    group, keeps_memory = assignment.groups[0], memory is not None
    kinds = [_load(group) for group in assignment.groups]
    remembered = None if memory is None else memory_of(assignment, frames.decode(memory))
    if len(kinds) == 1 and len(group.rows) == 1 and issubclass(kinds[0], Agent):
        return OneRobotAgent(assignment, kinds[0], remembered, keeps_memory=keeps_memory)
    return ManyRobots(assignment, remembered, keeps_memory=keeps_memory)


def _load(group: GroupAssignment) -> AgentClass:
    try:
        return load_agent(group.agent)
    except NoAgent as error:
        raise failed(list(group.robot_names), error) from error


def memory_of(assignment: Assignment, frame: Frame) -> Memory:
    """The part of a frame of memory that is of these robots, and fits their agents."""
    memory: Memory = {}
    for group in assignment.groups:
        with suppress(BadFrame, NoAgent):  # without memory it starts with defaults; a missing agent fails later
            decoded = decode_memory(frame, {group.name: layout_of(load_agent(group.agent))})
            parts = {name: of_group.of(group.rows) for name, of_group in decoded.items()}
            memory |= {name: part for name, part in parts.items() if len(part.rows)}
    return memory
