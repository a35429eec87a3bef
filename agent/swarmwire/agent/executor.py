"""Runs the agents of some robots, tick by tick: the same code in a local backend, in a runner and on a robot.

`AgentExecutor` holds the agents of an assignment, one `AgentGroup` per group, and passes each group its readings,
packets and tx statuses. Packets that arrive between ticks wait in an `Inbox` until the robots step, or until agents
that define `on_receive` read them. A group keeps what its agents remember, also across a change of the rows that act.

A robot's packet ids count from its first packet, whichever process sent it, so `host.sent` and `host.first_own` are
columns of its memory.
"""

import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, cast

import numpy as np

from swarmwire.agent.agent import Agent, AgentClass, load_agent
from swarmwire.agent.parameters import make, parameters_of
from swarmwire.agent.robot import Robot
from swarmwire.agent.robots import Robots
from swarmwire.agent.step_context import GroupContext, StepContext
from swarmwire.agent.vector_agent import Memory, VectorAgent, freeze, memory_class
from swarmwire.comms.base.arrays import AnyArray, FloatArray, IntArray
from swarmwire.comms.base.clock import tick_start_ns, to_s
from swarmwire.comms.base.errors import AgentFailed
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, GroupReadings, Readings
from swarmwire.comms.wire.agent_memory import GroupMemories, GroupMemory, Layout
from swarmwire.comms.wire.assignment import Assignment, GroupAssignment, robots_text

NOT_OWN = -1
NO_ROWS = np.empty(0, np.int64)
DRAWS_PER_CALL = 1 << 20  # more than a step or an `on_receive` draws for one purpose
# Columns of memory that belong to the host, for robots of either kind of agent.
SENT, FIRST_OWN, ACTED = "host.sent", "host.first_own", "host.acted"


class Inbox(NamedTuple):
    """Received packets and tx statuses, in the order of their tables; false if both are empty."""

    received: ReceivedPackets
    tx_status: TxStatuses

    def __bool__(self) -> bool:
        return bool(len(self.received) or len(self.tx_status))

    def followed_by(self, other: "Inbox") -> "Inbox":
        """Both inboxes in one."""
        return Inbox(
            ReceivedPackets.joined([self.received, other.received]),
            TxStatuses.joined([self.tx_status, other.tx_status]),
        )

    def of(self, rows: IntArray) -> "Inbox":
        """The part for these robot rows, (n,), rising."""
        return self.parted(rows)[0]

    def parted(self, rows: IntArray) -> "tuple[Inbox, Inbox]":
        """The part for these robot rows, (n,), and the rest."""
        packets, statuses = np.isin(self.received.receiver, rows), np.isin(self.tx_status.row, rows)
        if packets.all() and statuses.all():
            return self, Inbox(self.received.select(NO_ROWS), self.tx_status.select(NO_ROWS))
        ours, theirs = (
            Inbox(self.received.select(np.flatnonzero(p)).compacted(), self.tx_status.select(np.flatnonzero(s)))
            for p, s in ((packets, statuses), (~packets, ~statuses))
        )
        return ours, theirs


class AgentExecutor:
    """The agents of all robots of an assignment."""

    def __init__(self, assignment: Assignment, memory: GroupMemories | None = None) -> None:
        """`memory` is that of earlier agents of some of these robots; the others start with defaults."""
        self._rate_hz = assignment.rate_hz
        self._groups = {group.name: agent_group(group, load_agent(group.agent)) for group in assignment.groups}
        self._waiting: Inbox | None = None  # that arrived between ticks; None: empty
        for name, group_memory in (memory or {}).items():
            self._groups[name].recall(group_memory)

    def receive(self, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Keep an inbox between ticks until the robots step or read it; drop the part of other robots."""
        rows = np.concatenate([NO_ROWS, *(agents.group.rows for agents in self._groups.values())])
        new = Inbox(received, tx_status).of(np.sort(rows))
        if new:
            self._waiting = self._waiting.followed_by(new) if self._waiting else new

    def on_receive(self, tick: int, at_ns: int) -> SentPackets:
        """Call `on_receive` of agents that define it, at a time in this tick: their packets. Errors as `act`."""
        sent: list[SentPackets] = []
        for agents in self._groups.values():
            if self._waiting and agents.receives:
                inbox, self._waiting = self._waiting.parted(agents.rows if agents.has_stepped else NO_ROWS)
                if inbox:
                    sent.append(agents.on_receive((tick, at_ns, self._time(tick, agents.group)[2]), inbox))
        return SentPackets.joined(sent)

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """The robots' actions in this tick; AgentFailed with the robot and the agent's traceback if one raises."""
        if self._waiting:
            acting_rows = [self._groups[name].group.rows for name in readings]
            # Also the packets that wait for dead robots of these groups: they are lost with them.
            inbox, self._waiting = self._waiting.parted(np.sort(np.concatenate(acting_rows)))
            received, tx_status = Inbox(received, tx_status).followed_by(inbox) if inbox else (received, tx_status)
        acting = ((self._groups[name], group) for name, group in readings.items())
        return Actions.joined(
            [agents.act(self._time(tick, agents.group), group, received, tx_status) for agents, group in acting]
        )

    def memory(self, names: Iterable[str]) -> GroupMemories:
        """The memory of the robots of these groups."""
        return {name: self._groups[name].memory() for name in names}

    def _time(self, tick: int, group: GroupAssignment) -> tuple[int, int, int]:
        """The tick, its start and the period of the group's robots, both in ns."""
        time_ns = tick_start_ns(tick, self._rate_hz)
        return tick, time_ns, tick_start_ns(tick + group.act_every_ticks, self._rate_hz) - time_ns


class AgentGroup(ABC):
    """The agents of one group, of either kind."""

    def __init__(self, group: GroupAssignment, needs: tuple[str, ...], *, receives: bool) -> None:
        self.group, self.needs = group, needs
        self.receives = receives  # whether the agents define `on_receive`
        self.rows: IntArray = group.rows  # that acted last: their memory is memory
        self._sent_before = np.zeros(len(group.rows), np.int64)
        self._first_own = np.zeros(len(group.rows), np.int64)  # id of the first packet that this agent sent
        self._place: slice | IntArray = slice(0)  # in the group of the robots that act, from `begin` to `end`
        self._counting = self._sent_before  # of these robots, counted on by their context
        self._readings: GroupReadings | None = None  # of the last step, for `on_receive`
        self._receive_calls = 0  # since the last step

    def act(
        self,
        time: tuple[int, int, int],
        readings: GroupReadings,
        received: ReceivedPackets,
        tx_status: TxStatuses = NO_TX_STATUSES,
    ) -> Actions:
        """The actions of the robots `readings.rows`; `time` is the tick, its start and the robots' period in ns."""
        context = self.begin(time, readings, received, tx_status)
        if context.n:  # no step without robots: an agent must not notice which others share its process
            self.step(context)
        return self.end(context)

    def begin(
        self,
        time: tuple[int, int, int],
        readings: GroupReadings,
        received: ReceivedPackets,
        tx_status: TxStatuses = NO_TX_STATUSES,
    ) -> GroupContext:
        """What the robots `readings.rows` see in this tick; as `act`, which is this, the agents' step, then `end`."""
        # As many rows as the group has are all of its rows, as in most ticks.
        all_act = len(readings.rows) == len(self.group.rows)
        place = slice(None) if all_act else np.searchsorted(self.group.rows, readings.rows)
        sent_before = self._sent_before[place]
        if not (all_act and len(self.rows) == len(readings.rows)) and not np.array_equal(readings.rows, self.rows):
            new_rows = np.flatnonzero(~np.isin(readings.rows, self.rows))
            self._first_own[np.arange(len(self.group.rows))[place][new_rows]] = sent_before[new_rows]
            self.keep(readings.rows)
            self.rows = readings.rows
        self._place, self._counting = place, sent_before
        return GroupContext(
            self.group,
            self.needs,
            time,
            readings,
            _of_rows(received, readings.rows),
            self._own_tx_status(tx_status, readings.rows, place),
            self.group.keys[place],
            sent_before,
        )

    def end(self, context: GroupContext) -> Actions:
        """The actions in the context that `begin` returned last."""
        self._sent_before[self._place] = self._counting
        if self.receives:
            self._readings, self._receive_calls = context.readings, 0
        return context.end()

    def on_receive(self, time: tuple[int, int, int], inbox: Inbox) -> SentPackets:
        """The packets that robots send when they read an inbox between steps; `time` as for `act`, but of now."""
        readings = self._readings
        if readings is None:
            raise RuntimeError("robots that have not stepped do not receive between steps")
        place = np.searchsorted(self.group.rows, self.rows)
        sent_before = self._sent_before[place]
        self._receive_calls += 1
        context = GroupContext(
            self.group,
            self.needs,
            time,
            readings,
            _of_rows(inbox.received, self.rows),
            self._own_tx_status(inbox.tx_status, self.rows, place),
            self.group.keys[place],
            sent_before,
            self._receive_calls * DRAWS_PER_CALL,
        )
        self.receive(context)
        self._sent_before[place] = sent_before
        try:
            return context.end_receive()
        except RuntimeError as error:
            raise failed([self.group.robot_names[at] for at in place], error) from error

    @property
    def has_stepped(self) -> bool:
        """Whether any robot has stepped: before that there is no `on_receive`."""
        return self._readings is not None

    def memory(self) -> GroupMemory:
        """The memory of every robot of the group."""
        group_rows = self.group.rows
        acted = np.isin(group_rows, self.rows)
        host_columns = {SENT: self._sent_before, FIRST_OWN: self._first_own, ACTED: acted}
        return GroupMemory(group_rows, {**host_columns, **self.columns()})

    def recall(self, memory: GroupMemory) -> None:
        """Continue with the memory of earlier agents of some robots of the group."""
        at = np.searchsorted(self.group.rows, memory.rows)
        self._sent_before[at], self._first_own[at] = memory.columns[SENT], memory.columns[FIRST_OWN]
        acted = np.ones(len(self.group.rows), np.bool_)
        acted[at] = memory.columns[ACTED]
        rows = self.group.rows[acted]
        self.keep(rows)
        self.rows = rows
        if not self.fill(memory):
            self._first_own[at] = self._sent_before[at]

    @abstractmethod
    def columns(self) -> dict[str, AnyArray]:
        """The agents' own memory of every robot of the group."""

    @abstractmethod
    def fill(self, memory: GroupMemory) -> bool:
        """Take over the memory of the robots that it is of, whose rows are memory; whether agents have any."""

    def _own_tx_status(self, tx_status: TxStatuses, rows: IntArray, place: slice | IntArray) -> TxStatuses:
        """Tx statuses of the robots `rows`, with the sender as a place in `rows`; a copy, which agents may write to.

        Packets of an earlier agent are left out: the robot died since, or its runner was lost.
        """
        if not len(tx_status) or not len(rows):
            return NO_TX_STATUSES
        mine = tx_status.select(np.flatnonzero(np.isin(tx_status.row, rows)))
        at = np.searchsorted(rows, mine.row)
        sent_here = (self._first_own[place][at] <= mine.id) & (mine.id < self._sent_before[place][at])
        return TxStatuses(at, mine.id, mine.result).select(np.flatnonzero(sent_here))

    @abstractmethod
    def step(self, context: GroupContext) -> None:
        """Call `step` of the agents."""

    @abstractmethod
    def receive(self, context: GroupContext) -> None:
        """Call `on_receive` of the agents."""

    @abstractmethod
    def keep(self, rows: IntArray) -> None:
        """Keep the memory of robots that act again, drop that of others, and start new robots with defaults."""


class _Vector(AgentGroup):
    """One VectorAgent for all robots of the group, and the Memory that it works on."""

    def __init__(self, group: GroupAssignment, kind: type[VectorAgent[Any]]) -> None:
        super().__init__(group, kind.needs, receives=kind.on_receive is not VectorAgent.on_receive)
        self._agent = make(kind, group.params, len(group.rows))
        per_robot = [name for name, parameter in parameters_of(kind).items() if parameter.per_robot]
        self._per_robot: dict[str, FloatArray | IntArray] = {name: getattr(self._agent, name) for name in per_robot}
        freeze(self._agent, self._per_robot)
        self._memory: Memory = memory_class(kind).fresh(len(group.rows))

    def step(self, context: GroupContext) -> None:
        self._call(self._agent.step, context)

    def receive(self, context: GroupContext) -> None:
        self._call(self._agent.on_receive, context)

    def _call(self, method: Callable[[Robots, Memory], None], context: GroupContext) -> None:
        if self._per_robot:
            place = np.searchsorted(self.group.rows, context.readings.rows)
            freeze(self._agent, {name: values[place] for name, values in self._per_robot.items()})
        try:
            method(Robots(context), self._memory)
        except (Exception, SystemExit) as error:
            place = np.searchsorted(self.group.rows, context.readings.rows)
            raise failed([self.group.robot_names[at] for at in place], error, context) from error

    def keep(self, rows: IntArray) -> None:
        self._memory = self._memory.moved(self.rows, rows)

    def columns(self) -> dict[str, AnyArray]:
        whole = (
            self._memory if len(self.rows) == len(self.group.rows) else self._memory.moved(self.rows, self.group.rows)
        )
        return {of_state(name): getattr(whole, name) for name in whole.columns}

    def fill(self, memory: GroupMemory) -> bool:
        _, here, there = np.intersect1d(self.rows, memory.rows, assume_unique=True, return_indices=True)
        for name in self._memory.columns:
            getattr(self._memory, name)[here] = memory.columns[of_state(name)][there]
        return True


class _Single(AgentGroup):
    """An Agent for each robot of the group."""

    def __init__(self, group: GroupAssignment, kind: type[Agent]) -> None:
        super().__init__(group, kind.needs, receives=kind.on_receive is not Agent.on_receive)
        self._kind = kind
        self._agents = {int(row): make(kind, group.params) for row in group.rows}

    def step(self, context: GroupContext) -> None:
        for at, row in enumerate(cast("list[int]", context.readings.rows.tolist())):
            self._call(self._agents[row].step, context, at, row)

    def receive(self, context: GroupContext) -> None:
        addressed = np.union1d(context.received.receiver, context.tx_status_rows)
        for at in cast("list[int]", addressed.tolist()):
            row = int(context.readings.rows[at])
            self._call(self._agents[row].on_receive, context, at, row)

    def _call(self, method: Callable[[Robot], None], context: GroupContext, at: int, row: int) -> None:
        try:
            method(Robot(context, at))
        except (Exception, SystemExit) as error:
            name = self.group.robot_names[int(np.searchsorted(self.group.rows, row))]
            raise failed([name], error, context) from error

    def keep(self, rows: IntArray) -> None:
        known = self._agents
        self._agents = {
            row: known[row] if row in known else make(self._kind, self.group.params) for row in rows.tolist()
        }

    def columns(self) -> dict[str, AnyArray]:
        return {}

    def fill(self, memory: GroupMemory) -> bool:
        return False  # an Agent keeps its memory in attributes of its own: a new one starts without


def layout_of(kind: AgentClass) -> Layout:
    """The columns of memory of a robot of this agent."""
    host_columns = {SENT: ("<i8", ()), FIRST_OWN: ("<i8", ()), ACTED: ("|b1", ())}
    if not issubclass(kind, VectorAgent):
        return host_columns
    return {
        **host_columns,
        **{of_state(name): (dtype.str, shape) for name, (dtype, _, shape) in memory_class(kind).columns.items()},
    }


def of_state(name: str) -> str:
    """The column of memory in which a column of a Memory is memory."""
    return f"state.{name}"


def agent_group(group: GroupAssignment, kind: AgentClass) -> AgentGroup:
    """The agents of a group, of this class; AgentFailed if one cannot be made."""
    try:
        return _Vector(group, kind) if issubclass(kind, VectorAgent) else _Single(group, kind)
    except (Exception, SystemExit) as error:
        raise failed(list(group.robot_names), error) from error


def failed(robots: list[str], error: BaseException, context: StepContext | None = None) -> AgentFailed:
    """The failure of an agent: its time, and the traceback of the agent's own lines."""
    shown = traceback.TracebackException.from_exception(error)
    modules = [frame.f_globals.get("__name__", "") for frame, _ in traceback.walk_tb(error.__traceback__)]
    agents = [place for place, name in enumerate(modules) if not _is_machinery(name)]
    if agents:  # what called the agent, and what it called, is no line of the agent's
        shown.stack = traceback.StackSummary.from_list(shown.stack[agents[0] : agents[-1] + 1])
    when = f"in tick {context.tick}, at {to_s(context.time_ns):g} s\n" if context else ""
    return AgentFailed(robots_text(robots), "".join(shown.format()) + _public_names(error) + when)


def _public_names(error: BaseException) -> str:
    """The line that names what an object of swarmwire has, if the agent used an attribute that it lacks."""
    if type(error) is not AttributeError or not _is_machinery(type(error.obj).__module__):
        return ""
    return f"{type(error.obj).__name__} has {', '.join(name for name in dir(error.obj) if name[0] != '_')}\n"


def _is_machinery(module: str) -> bool:
    """Whether it is a module of swarmwire's, but of no agent."""
    return module.startswith("swarmwire.") and not module.startswith("swarmwire.agent.behaviours")


def _of_rows(received: ReceivedPackets, rows: IntArray) -> ReceivedPackets:
    """The packets that the robots `rows` received, with the receiver as a place in `rows`."""
    if not len(received):
        return received
    first, last = (int(rows[0]), int(rows[-1])) if len(rows) else (0, -1)
    lowest, highest = int(received.receiver[0]), int(received.receiver[-1])  # receivers rise, as rows do
    if last - first + 1 == len(rows) and first <= lowest and highest <= last:  # one span, which holds all receivers
        place = received.receiver - first if len(rows) > 1 else np.zeros(len(received), np.int64)
    else:
        places = np.full(max(highest, last) + 1, NOT_OWN)
        places[rows] = np.arange(len(rows))
        place = places.take(received.receiver)
        mine = np.flatnonzero(place != NOT_OWN)
        received, place = received.select(mine), place.take(mine)
    return ReceivedPackets(
        place,
        received.sender_index,
        received.sequence,
        received.received_at_ns,
        received.measured,
        received.payload,
        received.payloads,
    )
