"""The seams of the loop: a crew decides for the robots, observers look on, a judge says which arenas are over."""

from typing import Any, Protocol

from swarmwire.comms.arrays import BoolArray
from swarmwire.comms.outcomes import Outcomes
from swarmwire.comms.packets import Heard
from swarmwire.comms.senses import Actions, Senses
from swarmwire.comms.truth import Static, Tally, Truth


class Crew(Protocol):
    """All agents of a run as the loop sees them: in this process, or runners behind the network."""

    def start(self) -> None:
        """Return once every robot has an agent that is ready to act; RunnerLost or AgentFailed otherwise."""
        ...

    def act(self, tick: int, senses: Senses, heard: Heard, outcomes: Outcomes) -> Actions:
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

    def end(self, last: Tally | None) -> dict[str, Any]:
        """The run is over; `last` counts what was in flight. Returns this observer's part of the summary."""
        ...


class Judge(Protocol):
    """Says when an arena has come to its end before the run has. It judges by what observers saw, as one of them."""

    def over(self) -> BoolArray | None:
        """Which arenas are over after the tick that observers saw last, (arenas,); None: none is."""
        ...
