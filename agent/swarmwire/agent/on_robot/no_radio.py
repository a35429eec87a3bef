"""The radio of a robot that has none."""

from swarmwire.comms.packets import NO_OUTCOMES, Heard, Outcomes, Sent


class NoRadio:
    """Nothing is heard; what the agent sends is counted, and goes nowhere."""

    needs: frozenset[str] = frozenset()
    gives: tuple[str, ...] = ()

    def __init__(self) -> None:
        self._unsent = 0

    def open(self) -> None:
        """There is nothing to take part in."""

    def heard(self, now_ns: int) -> tuple[Heard, Outcomes]:
        """Nothing."""
        return Heard.none(), NO_OUTCOMES

    def send(self, sent: Sent) -> None:
        """Count the packets."""
        self._unsent += len(sent)

    def counts(self) -> dict[str, int]:
        """How many packets went nowhere."""
        return {"packets_without_radio": self._unsent} if self._unsent else {}

    def close(self) -> None:
        """There is nothing to leave."""
