"""What both kinds of handle tell of the tick and the body."""

from swarmwire.agent.turn import Turn
from swarmwire.comms.bodies.body import Body
from swarmwire.comms.clock import to_s


class Handle:
    """A view of one tick of one group."""

    __slots__ = ("_turn",)

    def __init__(self, turn: Turn) -> None:
        self._turn = turn

    @property
    def time_s(self) -> float:
        """Time since the start of the run, at this tick."""
        return to_s(self._turn.time_ns)

    @property
    def period_s(self) -> float:
        """Time between two steps."""
        return to_s(self._turn.period_ns)

    @property
    def body(self) -> Body:
        """Geometry and limits of the body."""
        return self._turn.group.body
