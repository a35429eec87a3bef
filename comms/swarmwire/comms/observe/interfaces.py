"""Interfaces of the simulation loop: agent backends, observers and stop conditions.

`AgentBackend` is the interface of every backend. `TimedBackend` adds ticks in real time, within which agents send and
receive through a `SubtickMedium`; `ReceivingBackend` adds agents in this process that read between ticks.
"""

from typing import Any, NamedTuple, Protocol

from swarmwire.comms.base.arrays import BoolArray
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.radio.records import PacketCounts, ReceptionRecords, TransmissionRecords
from swarmwire.comms.robot.packets import ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings, SparseTable


class AgentBackend(Protocol):
    """All agents of a run, in this process or in runners on the network."""

    def start(self) -> None:
        """Return when every robot has an agent that is ready to act; RunnerLost or AgentFailed otherwise."""
        ...

    def act(self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses) -> Actions:
        """Return the actions of all robots that act in this tick; AgentFailed or RunnerLost ends the run."""
        ...

    def counts(self) -> dict[str, int]:
        """Return the faults between loop and agents since the start, by name."""
        ...

    def close(self) -> None:
        """End the agents; safe to call more than once."""
        ...


class Observer:
    """A passive part of a run: a metric, a recorder, a progress display. It cannot change the run.

    Subclasses override the methods that they need.
    """

    #: True if `begin` is called before the run waits for agents that join from elsewhere.
    before_agents = False

    def begin(self, static: Static) -> None:
        """Start observing; called once before the first tick."""

    def see(self, truth: Truth) -> None:
        """Observe a tick; called after each tick. An observer may keep the arrays, but not write to them."""

    def see_last(self, departed: TransmissionRecords, finished: ReceptionRecords) -> None:
        """Observe the packets of arenas that end whose fates are in no truth.

        They became final within the last tick, or the last tick failed or was interrupted.
        """

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Stop observing; called after the last tick. Return the observer's summary entries.

        `last` counts the packets in flight.
        """
        return {}


class StopConditions(Protocol):
    """End an arena before the end of the run, by the values that observers measure; also an observer."""

    def done(self) -> BoolArray | None:
        """Return the arenas that are done after the last observed tick, (arenas,); None: no arena."""
        ...


class SubtickPackets(NamedTuple):
    """Packets that agents sent in the middle of a tick."""

    at_ns: int  # simulated time of their arrival at the medium
    tick: int | None  # tick of the step that sent them, at whose send times they go out; None: they go out at once
    sent: SentPackets


class SubtickMedium(Protocol):
    """The radio medium during a tick, with the robots' poses at the tick's start until `set_poses`."""

    def send(self, packets: SubtickPackets, /) -> None:
        """Accept packets; their times must lie within the tick and must not fall from call to call."""
        ...

    def advance(self, until_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        """Advance to `until_ns`; return the packets received and the tx statuses since the last call."""
        ...

    def set_poses(self, at_ns: int, poses: SparseTable, /) -> None:
        """Set poses of robots of live sources from `at_ns` on, in slots x, y, z, heading; see `send` for the times."""
        ...


class TimedBackend(AgentBackend, Protocol):
    """A backend with ticks in wall-clock time, which gets every received packet, also for robots that do not act.

    It sends the agents' packets during the tick, and delivers packets as they are received.
    """

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        """Return the actions of this tick without their packets, which went out through `medium`.

        `received` and `tx_status` are the results since the last tick, also of robots that do not act in this tick.
        """
        ...


class ReceivingBackend(AgentBackend, Protocol):
    """A backend in this process whose agents can read between ticks."""

    def receive(self, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Keep packets and statuses until their robots step, or until `on_receive`."""
        ...

    def on_receive(self, tick: int, at_ns: int) -> SentPackets:
        """Let the agents that read between ticks read, at a time in this tick; return the packets that they send."""
        ...
