"""What an Agent's radio tells of a packet that it is done with."""

from dataclasses import dataclass

from swarmwire.comms.packets import SendResult


@dataclass(frozen=True, slots=True)
class Outcome:
    """One addressed packet whose fate the sender's radio knows, as far as it can."""

    id: int  # that `send` returned
    result: SendResult

    @property
    def acknowledged(self) -> bool:
        """Whether it arrived for certain; if not, it may have arrived all the same, and its acknowledgement not."""
        return self.result == SendResult.ACKNOWLEDGED
