"""Trial: which robots, for how long, with what parameters."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from swarmwire.comms.bodies.body import Body, load_body


@dataclass(frozen=True)
class Trial:
    """What to try an agent with: robots whose senses and packets are made up.

    All that the body senses is drawn anew in each tick. What robots send is heard a tick later, by each of the others
    with probability 0.4, and outcomes of all kinds are told to an agent that needs them. A tenth of the robots is
    missing in each tick and starts afresh when it is back.
    """

    robots: int = 7  # of one group
    ticks: int = 12  # of a tenth of a second
    seed: int = 1  # of what they sense, hear and draw
    body: str | Body = "epuck"  # one that comes with swarmwire, or any other
    params: dict[str, Any] | None = None  # as in a scenario: a list has a value for each robot

    @cached_property
    def sheet(self) -> Body:
        """The body's data sheet."""
        return load_body(self.body) if isinstance(self.body, str) else self.body
