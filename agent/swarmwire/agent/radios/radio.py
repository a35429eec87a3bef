"""What every radio of an agent on a robot is."""

from typing import Protocol

from swarmwire.comms.packets import Heard, Outcomes, Sent


class RobotRadio(Protocol):
    """The radio of one robot: `heard` and `send` are called from one thread, once per tick each.

    Attributes:
        needs: what of an agent's `needs` it meets: "radio.range", "radio.bearing", "radio.outcomes", …
        gives: the columns of `Heard.given`, in their order.
    """

    needs: frozenset[str]
    gives: tuple[str, ...]

    def open(self) -> None:
        """Take part in the network."""
        ...

    def heard(self, now_ns: int) -> tuple[Heard, Outcomes]:
        """What reached the robot since the last call, in the order that `Heard` promises.

        `receiver` and `Outcomes.row` are the robot's row. `now_ns` and `heard_at_ns` are times since the agent's start.
        """
        ...

    def send(self, sent: Sent) -> None:
        """Hand packets to the network, at once; nothing is raised for one that is lost or too large: it is counted."""
        ...

    def counts(self) -> dict[str, int]:
        """Losses and faults so far, by name."""
        ...

    def close(self) -> None:
        """Leave the network; safe to call more than once."""
        ...
