"""The seam within a tick: crews that keep to the wall clock send while it goes on, and hand over what is heard."""

from typing import NamedTuple, Protocol

from swarmwire.comms.outcomes import Outcomes
from swarmwire.comms.packets import Heard, Sent
from swarmwire.comms.protocols import Crew
from swarmwire.comms.senses import Actions, Senses


class Put(NamedTuple):
    """Packets that came from agents in the middle of a tick."""

    at_ns: int  # when they came, simulated time
    tick: int | None  # whose step sent them: a robot sends no sooner than in its turn; None: they go out at once
    sent: Sent


class AirTime(Protocol):
    """The air while a tick goes on, with the poses of its start."""

    def send(self, put: Put) -> None:
        """Take packets that came no sooner than those before them, and within the tick."""
        ...

    def advance(self, until_ns: int) -> tuple[Heard, Outcomes]:
        """Let time pass; what robots heard, and learned of their packets, that nobody was handed before."""
        ...


class TimedCrew(Crew, Protocol):
    """A crew whose tick takes its time: all that is heard goes through it, whether or not the robot acts."""

    def act_in_time(self, tick: int, senses: Senses, heard: Heard, outcomes: Outcomes, air: AirTime) -> Actions:
        """What every robot does in this tick, but for packets, which were put on the air.

        `heard` and `outcomes` are what came since the last tick, for robots that do not act in this one as well.
        """
        ...


class HearingCrew(Crew, Protocol):
    """A crew in this process whose agents can read between ticks."""

    def receive(self, heard: Heard, outcomes: Outcomes) -> None:
        """Keep this until the robots that it is for step, or hear."""
        ...

    def hear(self, tick: int, at_ns: int) -> Sent:
        """Let agents that read between ticks read, at a time in this tick; what they sent."""
        ...
