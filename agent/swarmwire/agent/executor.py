"""Runs the agents of some robots, tick by tick: the same code in a local backend, in a runner and on a robot.

`AgentExecutor` holds the agents of an assignment, one `AgentGroup` per group, and passes each group its readings,
packets and tx statuses. Packets that arrive between ticks wait in an `Inbox` until the robots step, or until agents
that define `on_receive` read them.
"""

from collections.abc import Iterable

import numpy as np

from swarmwire.agent.agent import load_agent
from swarmwire.agent.agent_group import agent_group
from swarmwire.agent.inbox import NO_ROWS, Inbox
from swarmwire.agent.step_context import StepTime
from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings
from swarmwire.comms.wire.agent_memory import GroupMemories
from swarmwire.comms.wire.assignment import Assignment, GroupAssignment


class AgentExecutor:
    """The agents of all robots of an assignment."""

    def __init__(self, assignment: Assignment, memory: GroupMemories | None = None) -> None:
        """Make the agents.

        `memory` holds the memory of earlier agents; robots without one start with defaults.
        """
        self._rate_hz = assignment.rate_hz
        self._agent_groups = {group.name: agent_group(group, load_agent(group.agent)) for group in assignment.groups}
        self._waiting: Inbox | None = None  # arrived between ticks; None: empty
        for name, group_memory in (memory or {}).items():
            self._agent_groups[name].load_memory(group_memory)

    def receive(self, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Keep an inbox between ticks until the robots step or read it; drop the part of other robots."""
        rows = np.concatenate([NO_ROWS, *(agents.assignment.rows for agents in self._agent_groups.values())])
        inbox = Inbox(received, tx_status).select(np.sort(rows))
        if inbox:
            self._waiting = self._waiting.followed_by(inbox) if self._waiting else inbox

    def on_receive(self, tick: int, at_ns: int) -> SentPackets:
        """Call `on_receive` of agents that define it, at a time in this tick; return their packets. Raises as `act`."""
        sent: list[SentPackets] = []
        for agents in self._agent_groups.values():
            if self._waiting and agents.has_on_receive:
                inbox, self._waiting = self._waiting.split(agents.active_rows if agents.has_stepped else NO_ROWS)
                if inbox:
                    sent.append(agents.on_receive(self._time(tick, agents.assignment)._replace(time_ns=at_ns), inbox))
        return SentPackets.joined(sent)

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """Return the robots' actions in this tick; AgentFailed with robot and traceback if an agent raises."""
        if self._waiting:
            # All robots of these groups: packets that wait for their dead robots are dropped here.
            group_rows = [NO_ROWS, *(self._agent_groups[name].assignment.rows for name in readings)]
            inbox, self._waiting = self._waiting.split(np.sort(np.concatenate(group_rows)))
            received, tx_status = Inbox(received, tx_status).followed_by(inbox) if inbox else (received, tx_status)
        parts = ((self._agent_groups[name], group_readings) for name, group_readings in readings.items())
        return Actions.joined(
            [
                agents.act(self._time(tick, agents.assignment), group_readings, received, tx_status)
                for agents, group_readings in parts
            ]
        )

    def memory(self, names: Iterable[str]) -> GroupMemories:
        """Return the memory of the robots of these groups."""
        return {name: self._agent_groups[name].memory() for name in names}

    def _time(self, tick: int, assignment: GroupAssignment) -> StepTime:
        """Return the tick, its start and the period of the group's robots."""
        time_ns = tick_start_ns(tick, self._rate_hz)
        return StepTime(tick, time_ns, tick_start_ns(tick + assignment.act_every_ticks, self._rate_hz) - time_ns)
