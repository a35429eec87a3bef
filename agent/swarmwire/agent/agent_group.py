"""The agents of one group, and their memory.

A group keeps the memory of its agents, also across a change of the rows that act.

A robot's packet ids count from its first packet, whichever process sent it, so the number of packets sent and the id of
the present agent's first packet are columns of its memory.
"""

import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, cast

import numpy as np

from swarmwire.agent.agent import Agent, AgentClass
from swarmwire.agent.inbox import Inbox, packets_of_rows
from swarmwire.agent.parameters import make_agent, parameters_of
from swarmwire.agent.robot import Robot
from swarmwire.agent.robots import Robots
from swarmwire.agent.step_context import DrawKeys, GroupContext, StepContext, StepTime
from swarmwire.agent.vector_agent import Memory, VectorAgent, freeze, memory_class
from swarmwire.comms.base.arrays import AnyArray, FloatArray, IntArray
from swarmwire.comms.base.clock import to_s
from swarmwire.comms.base.errors import AgentFailed
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, GroupReadings
from swarmwire.comms.wire.agent_memory import GroupMemory, Layout
from swarmwire.comms.wire.assignment import GroupAssignment, robots_text

DRAWS_PER_CALL = 1 << 20  # more than a step or an `on_receive` draws for one purpose
# Columns of memory that every robot has, for either kind of agent: packets sent, id of the agent's first packet, and
# whether the robot acted last.
SENT, FIRST_ID, ACTED = "host.sent", "host.first_own", "host.acted"


class AgentGroup(ABC):
    """The agents of one group, of either kind."""

    def __init__(self, assignment: GroupAssignment, needs: tuple[str, ...], *, has_on_receive: bool) -> None:
        self.assignment, self.needs = assignment, needs
        self.has_on_receive = has_on_receive  # the agents define `on_receive`
        self.active_rows: IntArray = assignment.rows  # robot rows that acted last: their memory is valid
        self._sent_counts = np.zeros(len(assignment.rows), np.int64)  # packets sent by each robot
        self._first_ids = np.zeros(len(assignment.rows), np.int64)  # id of the first packet of each present agent
        self._acting: slice | IntArray = slice(0)  # index in the group of the robots that act, from `begin` to `end`
        self._acting_sent_counts = self._sent_counts  # their sent packets, incremented by their context
        self._last_readings: GroupReadings | None = None  # readings of the last step, for `on_receive`
        self._receive_calls = 0  # number of calls since the last step

    def act(
        self,
        time: StepTime,
        readings: GroupReadings,
        received: ReceivedPackets,
        tx_status: TxStatuses = NO_TX_STATUSES,
    ) -> Actions:
        """Return the actions of the robots `readings.rows`."""
        context = self.begin(time, readings, received, tx_status)
        if context.n:  # no step without robots: an agent must not notice which others share its process
            self.step(context)
        return self.end(context)

    def begin(
        self,
        time: StepTime,
        readings: GroupReadings,
        received: ReceivedPackets,
        tx_status: TxStatuses = NO_TX_STATUSES,
    ) -> GroupContext:
        """Return the context of the robots `readings.rows` in this tick; after the agents' step call `end` with it."""
        # In most ticks all robots of the group act; then no index is needed.
        all_act = len(readings.rows) == len(self.assignment.rows)
        acting = slice(None) if all_act else np.searchsorted(self.assignment.rows, readings.rows)
        sent_counts = self._sent_counts[acting]
        if not (all_act and len(self.active_rows) == len(readings.rows)) and not np.array_equal(
            readings.rows, self.active_rows
        ):
            new_rows = np.flatnonzero(~np.isin(readings.rows, self.active_rows))
            self._first_ids[np.arange(len(self.assignment.rows))[acting][new_rows]] = sent_counts[new_rows]
            self.retain(readings.rows)
            self.active_rows = readings.rows
        self._acting, self._acting_sent_counts = acting, sent_counts
        return self._context(time, readings, Inbox(received, tx_status), acting, sent_counts)

    def end(self, context: GroupContext) -> Actions:
        """Return the actions in the context that `begin` returned last."""
        self._sent_counts[self._acting] = self._acting_sent_counts
        if self.has_on_receive:
            self._last_readings, self._receive_calls = context.readings, 0
        return context.end()

    def on_receive(self, time: StepTime, inbox: Inbox) -> SentPackets:
        """Return the packets that robots send when they read an inbox between steps, at the time `time.time_ns`."""
        readings = self._last_readings
        if readings is None:
            raise RuntimeError("robots that have not stepped do not receive between steps")
        acting = np.searchsorted(self.assignment.rows, self.active_rows)
        sent_counts = self._sent_counts[acting]
        self._receive_calls += 1
        context = self._context(time, readings, inbox, acting, sent_counts, self._receive_calls * DRAWS_PER_CALL)
        self.receive(context)
        self._sent_counts[acting] = sent_counts
        try:
            return context.end_receive()
        except RuntimeError as error:
            raise agent_failure([self.assignment.robot_names[index] for index in acting], error) from error

    @property
    def has_stepped(self) -> bool:
        """True if any robot has stepped: before that there is no `on_receive`."""
        return self._last_readings is not None

    def memory(self) -> GroupMemory:
        """Return the memory of every robot of the group."""
        group_rows = self.assignment.rows
        acted = np.isin(group_rows, self.active_rows)
        robot_columns = {SENT: self._sent_counts, FIRST_ID: self._first_ids, ACTED: acted}
        return GroupMemory(group_rows, {**robot_columns, **self.memory_columns()})

    def load_memory(self, memory: GroupMemory) -> None:
        """Continue with the memory of earlier agents of some robots of the group."""
        index = np.searchsorted(self.assignment.rows, memory.rows)
        self._sent_counts[index], self._first_ids[index] = memory.columns[SENT], memory.columns[FIRST_ID]
        acted = np.ones(len(self.assignment.rows), np.bool_)
        acted[index] = memory.columns[ACTED]
        rows = self.assignment.rows[acted]
        self.retain(rows)
        self.active_rows = rows
        if not self.load_columns(memory):
            self._first_ids[index] = self._sent_counts[index]

    @abstractmethod
    def memory_columns(self) -> dict[str, AnyArray]:
        """Return the columns of the agents' `Memory`, each with a row per robot of the group."""

    @abstractmethod
    def load_columns(self, memory: GroupMemory) -> bool:
        """Copy these columns into the agents' `Memory`; return False if the agents have none."""

    @abstractmethod
    def step(self, context: GroupContext) -> None:
        """Call `step` of the agents."""

    @abstractmethod
    def receive(self, context: GroupContext) -> None:
        """Call `on_receive` of the agents."""

    @abstractmethod
    def retain(self, rows: IntArray) -> None:
        """Keep the memory of robots that act again, drop that of others, and start new robots with defaults."""

    def _context(
        self,
        time: StepTime,
        readings: GroupReadings,
        inbox: Inbox,
        acting: slice | IntArray,
        sent_counts: IntArray,
        first_draw: int = 0,
    ) -> GroupContext:
        """Return a context of the robots `acting` of the group, whose rows are `active_rows`."""
        received = packets_of_rows(inbox.received, self.active_rows)
        tx_status = self._current_tx_status(inbox.tx_status, acting)
        draw_keys = DrawKeys(self.assignment.keys[acting], first_draw)
        return GroupContext(
            self.assignment, self.needs, time, readings, Inbox(received, tx_status), draw_keys, sent_counts
        )

    def _current_tx_status(self, tx_status: TxStatuses, acting: slice | IntArray) -> TxStatuses:
        """Return tx statuses of the robots `active_rows`, with the sender as an index in them, as a writable copy.

        Packets of an earlier agent are left out: the robot died since, or its runner was lost.
        """
        if not len(tx_status) or not len(self.active_rows):
            return NO_TX_STATUSES
        statuses = tx_status.select(np.flatnonzero(np.isin(tx_status.row, self.active_rows)))
        index = np.searchsorted(self.active_rows, statuses.row)
        first_ids, sent_counts = self._first_ids[acting][index], self._sent_counts[acting][index]
        is_current = (first_ids <= statuses.id) & (statuses.id < sent_counts)
        return TxStatuses(index, statuses.id, statuses.result).select(np.flatnonzero(is_current))


class _VectorGroup(AgentGroup):
    """One VectorAgent for all robots of the group, and its Memory."""

    def __init__(self, assignment: GroupAssignment, kind: type[VectorAgent[Any]]) -> None:
        super().__init__(assignment, kind.needs, has_on_receive=kind.on_receive is not VectorAgent.on_receive)
        self._agent = make_agent(kind, assignment.params, len(assignment.rows))
        per_robot = [name for name, parameter in parameters_of(kind).items() if parameter.per_robot]
        self._per_robot: dict[str, FloatArray | IntArray] = {name: getattr(self._agent, name) for name in per_robot}
        freeze(self._agent, self._per_robot)
        self._memory: Memory = memory_class(kind).fresh(len(assignment.rows))

    def step(self, context: GroupContext) -> None:
        self._call(self._agent.step, context)

    def receive(self, context: GroupContext) -> None:
        self._call(self._agent.on_receive, context)

    def _call(self, method: Callable[[Robots, Memory], None], context: GroupContext) -> None:
        if self._per_robot:
            acting = np.searchsorted(self.assignment.rows, context.readings.rows)
            freeze(self._agent, {name: values[acting] for name, values in self._per_robot.items()})
        try:
            method(Robots(context), self._memory)
        except (Exception, SystemExit) as error:
            acting = np.searchsorted(self.assignment.rows, context.readings.rows)
            raise agent_failure([self.assignment.robot_names[index] for index in acting], error, context) from error

    def retain(self, rows: IntArray) -> None:
        self._memory = self._memory.moved(self.active_rows, rows)

    def memory_columns(self) -> dict[str, AnyArray]:
        all_acted = len(self.active_rows) == len(self.assignment.rows)
        memory = self._memory if all_acted else self._memory.moved(self.active_rows, self.assignment.rows)
        return {memory_column(name): getattr(memory, name) for name in memory.columns}

    def load_columns(self, memory: GroupMemory) -> bool:
        _, index, source_index = np.intersect1d(self.active_rows, memory.rows, assume_unique=True, return_indices=True)
        for name in self._memory.columns:
            getattr(self._memory, name)[index] = memory.columns[memory_column(name)][source_index]
        return True


class _SingleGroup(AgentGroup):
    """An Agent for each robot of the group."""

    def __init__(self, assignment: GroupAssignment, kind: type[Agent]) -> None:
        super().__init__(assignment, kind.needs, has_on_receive=kind.on_receive is not Agent.on_receive)
        self._kind = kind
        self._agents = {int(row): make_agent(kind, assignment.params) for row in assignment.rows}

    def step(self, context: GroupContext) -> None:
        for index, row in enumerate(cast("list[int]", context.readings.rows.tolist())):
            self._call(self._agents[row].step, context, index, row)

    def receive(self, context: GroupContext) -> None:
        addressed = np.union1d(context.received.receiver, context.tx_status_rows)
        for index in cast("list[int]", addressed.tolist()):
            row = int(context.readings.rows[index])
            self._call(self._agents[row].on_receive, context, index, row)

    def _call(self, method: Callable[[Robot], None], context: GroupContext, index: int, row: int) -> None:
        try:
            method(Robot(context, index))
        except (Exception, SystemExit) as error:
            name = self.assignment.robot_names[int(np.searchsorted(self.assignment.rows, row))]
            raise agent_failure([name], error, context) from error

    def retain(self, rows: IntArray) -> None:
        agents = self._agents
        self._agents = {
            row: agents[row] if row in agents else make_agent(self._kind, self.assignment.params)
            for row in rows.tolist()
        }

    def memory_columns(self) -> dict[str, AnyArray]:
        return {}

    def load_columns(self, memory: GroupMemory) -> bool:
        return False  # an Agent keeps its memory in attributes, so a new one starts without


def agent_group(assignment: GroupAssignment, kind: AgentClass) -> AgentGroup:
    """Make the agents of a group, of this class; AgentFailed if one cannot be made."""
    try:
        return _VectorGroup(assignment, kind) if issubclass(kind, VectorAgent) else _SingleGroup(assignment, kind)
    except (Exception, SystemExit) as error:
        raise agent_failure(list(assignment.robot_names), error) from error


def layout_of(kind: AgentClass) -> Layout:
    """Return the columns of memory of a robot with this agent."""
    robot_columns = {SENT: ("<i8", ()), FIRST_ID: ("<i8", ()), ACTED: ("|b1", ())}
    if not issubclass(kind, VectorAgent):
        return robot_columns
    return {
        **robot_columns,
        **{memory_column(name): (dtype.str, shape) for name, (dtype, _, shape) in memory_class(kind).columns.items()},
    }


def memory_column(name: str) -> str:
    """Return the name in frames of a column of a Memory."""
    return f"state.{name}"


def agent_failure(robots: list[str], error: BaseException, context: StepContext | None = None) -> AgentFailed:
    """Return the failure of an agent: its time, and the traceback of the agent's own lines."""
    shown = traceback.TracebackException.from_exception(error)
    modules = [frame.f_globals.get("__name__", "") for frame, _ in traceback.walk_tb(error.__traceback__)]
    agent_frames = [index for index, name in enumerate(modules) if not _is_machinery(name)]
    if agent_frames:  # the frames before them called the agent, those after them the agent called
        shown.stack = traceback.StackSummary.from_list(shown.stack[agent_frames[0] : agent_frames[-1] + 1])
    time = f"in tick {context.tick}, at {to_s(context.time_ns):g} s\n" if context else ""
    return AgentFailed(robots_text(robots), "".join(shown.format()) + _public_names(error) + time)


def _public_names(error: BaseException) -> str:
    """Return a line with the public names of an object of swarmwire, if the agent used an attribute that it lacks."""
    if type(error) is not AttributeError or not _is_machinery(type(error.obj).__module__):
        return ""
    return f"{type(error.obj).__name__} has {', '.join(name for name in dir(error.obj) if name[0] != '_')}\n"


def _is_machinery(module: str) -> bool:
    """Return True for a module of swarmwire that is no agent."""
    return module.startswith("swarmwire.") and not module.startswith("swarmwire.agent.behaviours")
