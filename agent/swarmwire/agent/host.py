"""What robots are told of the radio: packets received, and tx statuses of their own."""

import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, cast

import numpy as np

from swarmwire.agent.agent import Agent, AgentClass, load_agent
from swarmwire.agent.parameters import make, parameters_of
from swarmwire.agent.robot import Robot
from swarmwire.agent.robots import Robots
from swarmwire.agent.step_context import StepContext
from swarmwire.agent.vector_agent import State, VectorAgent, freeze, state_of
from swarmwire.comms.arrays import AnyArray, FloatArray, IntArray
from swarmwire.comms.assignment import Assignment, GroupAssignment, robots_text
from swarmwire.comms.clock import tick_start_ns, to_s
from swarmwire.comms.errors import AgentFailed
from swarmwire.comms.packets import NO_TX_STATUSES, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.tick_io import Actions, GroupReadings, Readings
from swarmwire.comms.wire.agent_memory import GroupMemory, Layout, Memory


class Inbox(NamedTuple):
    """Packets received and tx statuses, in the orders that these promise; true if there is any."""

    received: ReceivedPackets
    tx_status: TxStatuses

    def __bool__(self) -> bool:
        return bool(len(self.received) or len(self.tx_status))

    def followed_by(self, other: "Inbox") -> "Inbox":
        """Both together."""
        return Inbox(
            ReceivedPackets.joined([self.received, other.received]),
            TxStatuses.joined([self.tx_status, other.tx_status]),
        )

    def of(self, rows: IntArray) -> "Inbox":
        """What is for these robot rows, (n,), rising."""
        return self.parted(rows)[0]

    def parted(self, rows: IntArray) -> "tuple[Inbox, Inbox]":
        """What is for these robot rows, (n,), and what is for others."""
        received, told = np.isin(self.received.receiver, rows), np.isin(self.tx_status.row, rows)
        if received.all() and told.all():
            return self, Inbox(self.received.select(NONE), self.tx_status.select(NONE))
        ours, theirs = (
            Inbox(self.received.select(np.flatnonzero(h)).compacted(), self.tx_status.select(np.flatnonzero(o)))
            for h, o in ((received, told), (~received, ~told))
        )
        return ours, theirs


NONE = np.empty(0, np.int64)


# --- The host runs the agents of some robots, tick by tick: the same code in a local backend and in every runner.


NOT_OWN = -1
NOBODY = np.empty(0, np.int64)
DRAWS_APART = 1 << 20  # calls for a purpose that a step, or a hearing, does not reach
# Columns of memory that are the host's own, for robots of either kind of agent.
SENT, FIRST_OWN, ACTED = "host.sent", "host.first_own", "host.acted"


class AgentExecutor:
    """The agents of all robots of an assignment."""

    def __init__(self, assignment: Assignment, memory: Memory | None = None) -> None:
        """`memory` is what earlier agents of some of these robots remembered; others start afresh."""
        self._rate_hz = assignment.rate_hz
        self._groups = {group.name: agent_group(group, load_agent(group.agent)) for group in assignment.groups}
        self._waiting: Inbox | None = None  # that came between ticks; None: nothing
        for name, kept in (memory or {}).items():
            self._groups[name].recall(kept)

    def receive(self, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Keep what came between ticks until the robots that it is for step, or hear; what is for others is lost."""
        rows = np.concatenate([agents.group.rows for agents in self._groups.values()])
        came = Inbox(received, tx_status).of(np.sort(rows))
        if came:
            self._waiting = self._waiting.followed_by(came) if self._waiting else came

    def on_receive(self, tick: int, at_ns: int) -> SentPackets:
        """Let agents that read between ticks read, at a time in this tick: what they sent. AgentFailed as for `act`."""
        sent: list[SentPackets] = []
        for agents in self._groups.values():
            if self._waiting and agents.receives:
                its, self._waiting = self._waiting.parted(agents.rows if agents.has_stepped else NOBODY)
                if its:
                    sent.append(agents.on_receive((tick, at_ns, self._time(tick, agents.group)[2]), its))
        return SentPackets.joined(sent)

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """What the robots do in this tick; AgentFailed with the robot and the agent's traceback if one raises."""
        if self._waiting:
            acting_rows = [self._groups[name].group.rows for name in readings]
            # Also what waits for the dead of these groups: it is lost with them.
            its, self._waiting = self._waiting.parted(np.sort(np.concatenate(acting_rows)))
            received, tx_status = Inbox(received, tx_status).followed_by(its) if its else (received, tx_status)
        acting = ((self._groups[name], group) for name, group in readings.items())
        return Actions.joined(
            [agents.act(self._time(tick, agents.group), group, received, tx_status) for agents, group in acting]
        )

    def memory(self, names: Iterable[str]) -> Memory:
        """What is remembered of the robots of these groups."""
        return {name: self._groups[name].memory() for name in names}

    def _time(self, tick: int, group: GroupAssignment) -> tuple[int, int, int]:
        time_ns = tick_start_ns(tick, self._rate_hz)
        return tick, time_ns, tick_start_ns(tick + group.act_every_ticks, self._rate_hz) - time_ns


class AgentGroup(ABC):
    """The agents of one group: what both kinds share."""

    def __init__(self, group: GroupAssignment, needs: tuple[str, ...], *, receives: bool) -> None:
        self.group, self.needs = group, needs
        self.receives = receives  # between steps, too
        self.rows: IntArray = group.rows  # that acted last: state is kept for these
        self._sent_before = np.zeros(len(group.rows), np.int64)
        self._first_own = np.zeros(len(group.rows), np.int64)  # id of the first packet that the agent itself sent
        self._readings: GroupReadings | None = None  # of the last step, for agents that read between steps
        self._hearings = 0  # since it

    def act(
        self,
        time: tuple[int, int, int],
        readings: GroupReadings,
        received: ReceivedPackets,
        tx_status: TxStatuses = NO_TX_STATUSES,
    ) -> Actions:
        """What the robots `sensors.rows` do; `time` is the tick, its start and the robots' period in ns."""
        # As many rows as the group has are all of them; most ticks are so.
        everyone = len(readings.rows) == len(self.group.rows)
        place = slice(None) if everyone else np.searchsorted(self.group.rows, readings.rows)
        sent_before = self._sent_before[place]
        if not (everyone and len(self.rows) == len(readings.rows)) and not np.array_equal(readings.rows, self.rows):
            fresh = np.flatnonzero(~np.isin(readings.rows, self.rows))
            self._first_own[np.arange(len(self.group.rows))[place][fresh]] = sent_before[fresh]
            self.keep(readings.rows)
            self.rows = readings.rows
        turn = StepContext(
            self.group,
            self.needs,
            time,
            readings,
            _own(received, readings.rows),
            self._own_tx_status(tx_status, readings.rows, place),
            self.group.keys[place],
            sent_before,
        )
        if turn.n:  # no step for nobody: an agent must not tell whether others share its process
            self.step(turn)
        self._sent_before[place] = sent_before
        if self.receives:
            self._readings, self._hearings = readings, 0
        return turn.end()

    def on_receive(self, time: tuple[int, int, int], told: Inbox) -> SentPackets:
        """What robots send that read, between steps, what they were `told`; `time` is as for `act`, but now."""
        readings = self._readings
        if readings is None:
            raise RuntimeError("whoever has not stepped does not hear between steps")
        place = np.searchsorted(self.group.rows, self.rows)
        sent_before = self._sent_before[place]
        self._hearings += 1
        turn = StepContext(
            self.group,
            self.needs,
            time,
            readings,
            _own(told.received, self.rows),
            self._own_tx_status(told.tx_status, self.rows, place),
            self.group.keys[place],
            sent_before,
            self._hearings * DRAWS_APART,
        )
        self.listen(turn)
        self._sent_before[place] = sent_before
        try:
            return turn.end_hearing()
        except RuntimeError as error:
            raise _failed([self.group.robot_names[at] for at in place], error) from error

    @property
    def has_stepped(self) -> bool:
        """Whether any robot has: who has not does not hear."""
        return self._readings is not None

    def memory(self) -> GroupMemory:
        """What is remembered of every robot of the group."""
        group_rows = self.group.rows
        acted = np.isin(group_rows, self.rows)
        own = {SENT: self._sent_before, FIRST_OWN: self._first_own, ACTED: acted}
        return GroupMemory(group_rows, {**own, **self.columns()})

    def recall(self, kept: GroupMemory) -> None:
        """Go on from what earlier agents of some robots of the group remembered."""
        at = np.searchsorted(self.group.rows, kept.rows)
        self._sent_before[at], self._first_own[at] = kept.columns[SENT], kept.columns[FIRST_OWN]
        acted = np.ones(len(self.group.rows), np.bool_)
        acted[at] = kept.columns[ACTED]
        rows = self.group.rows[acted]
        self.keep(rows)
        self.rows = rows
        if not self.fill(kept):
            self._first_own[at] = self._sent_before[at]

    @abstractmethod
    def columns(self) -> dict[str, AnyArray]:
        """The agents' own memory of every robot of the group."""

    @abstractmethod
    def fill(self, kept: GroupMemory) -> bool:
        """Take over the memory of the robots that it is of, whose rows are kept; whether agents have any."""

    def _own_tx_status(self, tx_status: TxStatuses, rows: IntArray, place: slice | IntArray) -> TxStatuses:
        """Tx statuses of the robots `rows`, with the sender as a place in `rows`; a copy, which agents may write to.

        Without those of packets that an agent before this one sent: the robot died since, or its runner was lost.
        """
        if not len(tx_status) or not len(rows):
            return NO_TX_STATUSES
        mine = tx_status.select(np.flatnonzero(np.isin(tx_status.row, rows)))
        at = np.searchsorted(rows, mine.row)
        own = (self._first_own[place][at] <= mine.id) & (mine.id < self._sent_before[place][at])
        return TxStatuses(at, mine.id, mine.result).select(np.flatnonzero(own))

    @abstractmethod
    def step(self, turn: StepContext) -> None:
        """Let the agents act."""

    @abstractmethod
    def listen(self, turn: StepContext) -> None:
        """Let the agents read between steps."""

    @abstractmethod
    def keep(self, rows: IntArray) -> None:
        """Keep the memory of robots that act again, drop that of others, give new ones a fresh one."""


class _Vector(AgentGroup):
    """One VectorAgent for all robots of the group, and the State that it works on."""

    def __init__(self, group: GroupAssignment, kind: type[VectorAgent[Any]]) -> None:
        super().__init__(group, kind.needs, receives=kind.on_receive is not VectorAgent.on_receive)
        self._agent = make(kind, group.params, len(group.rows))
        per_robot = [name for name, parameter in parameters_of(kind).items() if parameter.per_robot]
        self._per_robot: dict[str, FloatArray | IntArray] = {name: getattr(self._agent, name) for name in per_robot}
        freeze(self._agent, self._per_robot)
        self._state: State = state_of(kind).fresh(len(group.rows))

    def step(self, turn: StepContext) -> None:
        self._call(self._agent.step, turn)

    def listen(self, turn: StepContext) -> None:
        self._call(self._agent.on_receive, turn)

    def _call(self, method: Callable[[Robots, State], None], turn: StepContext) -> None:
        if self._per_robot:
            place = np.searchsorted(self.group.rows, turn.readings.rows)
            freeze(self._agent, {name: values[place] for name, values in self._per_robot.items()})
        try:
            method(Robots(turn), self._state)
        except (Exception, SystemExit) as error:
            place = np.searchsorted(self.group.rows, turn.readings.rows)
            raise _failed([self.group.robot_names[at] for at in place], error, turn) from error

    def keep(self, rows: IntArray) -> None:
        self._state = self._state.moved(self.rows, rows)

    def columns(self) -> dict[str, AnyArray]:
        whole = self._state if len(self.rows) == len(self.group.rows) else self._state.moved(self.rows, self.group.rows)
        return {of_state(name): getattr(whole, name) for name in whole.columns}

    def fill(self, kept: GroupMemory) -> bool:
        _, here, there = np.intersect1d(self.rows, kept.rows, assume_unique=True, return_indices=True)
        for name in self._state.columns:
            getattr(self._state, name)[here] = kept.columns[of_state(name)][there]
        return True


class _Single(AgentGroup):
    """An Agent for each robot of the group."""

    def __init__(self, group: GroupAssignment, kind: type[Agent]) -> None:
        super().__init__(group, kind.needs, receives=kind.on_receive is not Agent.on_receive)
        self._kind = kind
        self._agents = {int(row): make(kind, group.params) for row in group.rows}

    def step(self, turn: StepContext) -> None:
        for at, row in enumerate(cast("list[int]", turn.readings.rows.tolist())):
            self._call(self._agents[row].step, turn, at, row)

    def listen(self, turn: StepContext) -> None:
        told = np.union1d(turn.received.receiver, turn.tx_status_rows)
        for at in cast("list[int]", told.tolist()):
            row = int(turn.readings.rows[at])
            self._call(self._agents[row].on_receive, turn, at, row)

    def _call(self, method: Callable[[Robot], None], turn: StepContext, at: int, row: int) -> None:
        try:
            method(Robot(turn, at))
        except (Exception, SystemExit) as error:
            name = self.group.robot_names[int(np.searchsorted(self.group.rows, row))]
            raise _failed([name], error, turn) from error

    def keep(self, rows: IntArray) -> None:
        known = self._agents
        self._agents = {
            row: known[row] if row in known else make(self._kind, self.group.params) for row in rows.tolist()
        }

    def columns(self) -> dict[str, AnyArray]:
        return {}

    def fill(self, kept: GroupMemory) -> bool:
        return False  # what an Agent remembers is its own affair: another starts afresh


def layout_of(kind: AgentClass) -> Layout:
    """The columns of what is remembered of a robot of this agent."""
    own = {SENT: ("<i8", ()), FIRST_OWN: ("<i8", ()), ACTED: ("|b1", ())}
    if not issubclass(kind, VectorAgent):
        return own
    return {**own, **{of_state(name): (dtype.str, shape) for name, (dtype, _, shape) in state_of(kind).columns.items()}}


def of_state(name: str) -> str:
    """The column of memory in which a column of a State is kept."""
    return f"state.{name}"


def agent_group(group: GroupAssignment, kind: AgentClass) -> AgentGroup:
    """The agents of a group, of this class; AgentFailed if one cannot be made."""
    try:
        return _Vector(group, kind) if issubclass(kind, VectorAgent) else _Single(group, kind)
    except (Exception, SystemExit) as error:
        raise _failed(list(group.robot_names), error) from error


def _failed(robots: list[str], error: BaseException, turn: StepContext | None = None) -> AgentFailed:
    """The failure of an agent, told from its own first line on, and when it was."""
    own = error.__traceback__
    while own is not None and own.tb_frame.f_globals["__name__"] in (__name__, make.__module__):
        own = own.tb_next
    when = f"in tick {turn.tick}, at {to_s(turn.time_ns):g} s\n" if turn else ""
    return AgentFailed(robots_text(robots), "".join(traceback.format_exception(type(error), error, own)) + when)


def _own(received: ReceivedPackets, rows: IntArray) -> ReceivedPackets:
    """What the robots `rows` received, with the receiver as a place in `rows`."""
    if not len(received):
        return received
    first, last = (int(rows[0]), int(rows[-1])) if len(rows) else (0, -1)
    lowest, highest = int(received.receiver[0]), int(received.receiver[-1])  # receivers rise, as rows do
    if last - first + 1 == len(rows) and first <= lowest and highest <= last:  # one span, and nobody beside it received
        place = received.receiver - first if len(rows) > 1 else np.zeros(len(received), np.int64)
    else:
        places = np.full(max(highest, last) + 1, NOT_OWN)
        places[rows] = np.arange(len(rows))
        place = places.take(received.receiver)
        mine = np.flatnonzero(place != NOT_OWN)
        received, place = received.select(mine), place.take(mine)
    return ReceivedPackets(
        place,
        received.sender,
        received.sequence,
        received.received_at_ns,
        received.given,
        received.payload,
        received.payloads,
    )
