"""The seams of the loop: a backend decides for the robots, observers look on, a judge says which arenas are over."""

from typing import Any, NamedTuple, Protocol

from swarmwire.comms.arrays import BoolArray
from swarmwire.comms.packets import ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.tick_io import Actions, Readings
from swarmwire.comms.truth import PacketCounts, Static, Truth


class AgentBackend(Protocol):
    """All agents of a run as the loop sees them: in this process, or runners behind the network."""

    def start(self) -> None:
        """Return once every robot has an agent that is ready to act; RunnerLost or AgentFailed otherwise."""
        ...

    def act(self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses) -> Actions:
        """What every robot does in this tick; AgentFailed or RunnerLost ends the run."""
        ...

    def counts(self) -> dict[str, int]:
        """Faults on the way between loop and agents, by name, since the start."""
        ...

    def close(self) -> None:
        """End the agents; safe to call more than once."""
        ...


class Observer(Protocol):
    """Whatever looks at a run without taking part: metrics, recorders, progress."""

    def begin(self, static: Static) -> None:
        """The run is about to start."""
        ...

    def see(self, truth: Truth) -> None:
        """One tick is over; the arrays may be kept but not written to."""
        ...

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """The run is over; `last` counts what was in flight. Returns this observer's part of the summary."""
        ...


class StopConditions(Protocol):
    """Says when an arena has come to its end before the run has. It judges by what observers saw, as one of them."""

    def over(self) -> BoolArray | None:
        """Which arenas are over after the tick that observers saw last, (arenas,); None: none is."""
        ...


# --- The seam within a tick: backends that keep to the wall clock send while it goes on, and hand over what is
# received.


class SubtickPackets(NamedTuple):
    """Packets that came from agents in the middle of a tick."""

    at_ns: int  # when they came, simulated time
    tick: int | None  # whose step sent them: a robot sends no sooner than in its turn; None: they go out at once
    sent: SentPackets


class SubtickMedium(Protocol):
    """The medium while a tick goes on, with the poses of its start."""

    def send(self, put: SubtickPackets) -> None:
        """Take packets that came no sooner than those before them, and within the tick."""
        ...

    def advance(self, until_ns: int) -> tuple[ReceivedPackets, TxStatuses]:
        """Let time pass; what robots received, and learned of their packets, that nobody was handed before."""
        ...


class TimedBackend(AgentBackend, Protocol):
    """A backend whose tick takes its time: all that is received goes through it, whether or not the robot acts."""

    def act_in_time(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses, medium: SubtickMedium
    ) -> Actions:
        """What every robot does in this tick, but for packets, which were put on air.

        `received` and `tx_status` are what came since the last tick, for robots that do not act in this one as well.
        """
        ...


class ReceivingBackend(AgentBackend, Protocol):
    """A backend in this process whose agents can read between ticks."""

    def receive(self, received: ReceivedPackets, tx_status: TxStatuses) -> None:
        """Keep this until the robots that it is for step, or hear."""
        ...

    def on_receive(self, tick: int, at_ns: int) -> SentPackets:
        """Let agents that read between ticks read, at a time in this tick; what they sent."""
        ...
