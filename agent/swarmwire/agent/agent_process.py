"""An agent process: the agents of some robots behind a socket to their agent host.

The first frame has these robots' part of the assignment and of the memory: a process knows no others.
"""

import pickle  # noqa: TID251 - only a process reads it, and trusts its host
import socket
import traceback
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from swarmwire.agent.agent import Agent, AgentClass, NoAgent, load_agent
from swarmwire.agent.agent_group import agent_failure, layout_of
from swarmwire.agent.executor import AgentExecutor
from swarmwire.agent.isolation import name_process
from swarmwire.agent.one_robot import OneRobotAgent
from swarmwire.agent.process_answers import write_actions
from swarmwire.agent.process_frames import (
    ASSIGN,
    FAILED,
    FIELDS,
    HEAD,
    READY,
    TICK,
    RecordField,
    RecordFields,
    content_frame,
    frame_content,
    frame_kind,
    receive,
    send,
)
from swarmwire.agent.process_ticks import read_packets, read_tick
from swarmwire.comms.base.errors import AgentFailed
from swarmwire.comms.robot.tick_io import Actions
from swarmwire.comms.wire.agent_memory import GroupMemories
from swarmwire.comms.wire.assignment import Assignment, GroupAssignment


def assign(assignment: Assignment, memory: GroupMemories | None) -> bytes:
    """Encode the first frame to a process: its part of the assignment, and the memory of earlier agents of its robots.

    None: the world keeps no memory. The frame is a pickle, since a process trusts its host, and bodies are checked
    already: a thousand processes would take 3 s to check theirs.
    """
    return content_frame(ASSIGN, pickle.dumps((assignment, memory)))


def serve(sock: socket.socket) -> None:
    """Run the agents that the host assigns until it closes the socket, or an agent fails."""
    try:
        if not (assigned := receive(sock)):
            return
        assignment, memory = pickle.loads(frame_content(assigned))
        first, *others = assignment.robot_names
        name_process(f"{first}+{len(others)}" if others else first)
        agents = agents_of(assignment, memory)
        send(sock, (content_frame(READY, None),))
        act = agents.act
        while frame := receive(sock):
            if frame_kind(frame) != FIELDS:
                send(sock, (act(frame),))
                continue
            fields: dict[str, list[list[Any]]] = frame_content(frame)
            agents.set_fields({name: tuple(RecordField(*field) for field in group) for name, group in fields.items()})
    except AgentFailed as error:
        *_, last = traceback.format_exception_only(error.__cause__)
        failure = {
            "robots": error.robots,
            "traceback": error.traceback,
            "reason": f"its agent failed: {last.strip()}",
        }
        send(sock, (content_frame(FAILED, failure),))
    except OSError:  # the host is gone
        return
    while receive(sock):  # the host closes the socket once it has read the failure
        pass


class ManyRobots:
    """The agents of a process with several robots, or with a `VectorAgent`."""

    def __init__(
        self, assignment: Assignment, memory: GroupMemories | None = None, *, keeps_memory: bool = False
    ) -> None:
        self._executor = AgentExecutor(assignment, memory)
        self._groups = tuple(group.name for group in assignment.groups)
        self._fields: Mapping[str, RecordFields] = {}
        self._measures, self._keeps_memory = assignment.measures or (), keeps_memory

    def set_fields(self, fields: Mapping[str, RecordFields]) -> None:
        """Set the fields of the records, by group, before the first tick."""
        self._fields = fields

    def act(self, frame: bytes) -> bytes:
        """Return the frame "actions" for a frame "tick" or "packets"; AgentFailed if the agent raises."""
        _, kind, *_ = HEAD.unpack_from(frame)
        if kind == TICK:
            tick, readings, received, tx_status = read_tick(frame, self._groups, self._fields, self._measures)
            actions = self._executor.act(tick, readings, received, tx_status)
            return write_actions(tick, actions, self._executor.memory(readings) if self._keeps_memory else None)
        tick, at_ns, received, tx_status = read_packets(frame, self._measures)
        self._executor.receive(received, tx_status)
        return write_actions(tick, replace(Actions.joined([]), sent=self._executor.on_receive(tick, at_ns)))


def agents_of(assignment: Assignment, memory: GroupMemories | None) -> OneRobotAgent | ManyRobots:
    """Make the agents of a process: without arrays if it has one robot, whose agent is an `Agent`.

    `memory` is that of earlier agents; memory of another layout is ignored. None: the world keeps none. AgentFailed if
    an agent cannot be made.
    """
    group, keeps_memory = assignment.groups[0], memory is not None
    kinds = {group.name: _load(group) for group in assignment.groups}
    fitting = {name: part for name, part in (memory or {}).items() if part.fits(layout_of(kinds[name]))}
    kind = kinds[group.name]
    if len(kinds) == 1 and len(group.rows) == 1 and issubclass(kind, Agent):
        return OneRobotAgent(assignment, kind, fitting, keeps_memory=keeps_memory)
    return ManyRobots(assignment, fitting, keeps_memory=keeps_memory)


def _load(group: GroupAssignment) -> AgentClass:
    try:
        return load_agent(group.agent)
    except NoAgent as error:
        raise agent_failure(list(group.robot_names), error) from error
