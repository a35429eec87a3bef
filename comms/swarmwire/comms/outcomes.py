"""What a sender's radio knows of an addressed packet once it is done with it: all but what became of it elsewhere."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import BoolArray, IntArray
from swarmwire.comms.explained import Explained


class SendResult(Explained):
    """How a radio that waits for acknowledgements is done with a packet, with its meaning."""

    ACKNOWLEDGED = 0, "the receiver's radio said that it has it"
    NO_ACKNOWLEDGEMENT = 1, "no answer to any attempt: it was not heard, or the answer was not"
    CHANNEL_BUSY = 2, "the radio found the air busy each time it listened, and gave up"
    QUEUE_FULL = 3, "the radio's queue was full: never on air"
    TOO_LARGE = 4, "above the medium's largest payload: never on air"


@dataclass(frozen=True, slots=True)
class Outcomes:
    """Packets that their senders' radios are done with, sorted by (row, id)."""

    row: IntArray  # (k,) sender: to a VectorAgent 0 to n - 1, between crew and air arena x robots + index
    id: IntArray  # (k,) that `send` returned
    result: IntArray  # (k,) SendResult

    def __len__(self) -> int:
        return len(self.row)

    @property
    def acknowledged(self) -> BoolArray:
        """Which packets arrived for certain, (k,)."""
        return self.result == SendResult.ACKNOWLEDGED

    def select(self, index: IntArray) -> "Outcomes":
        """The rows of `index` (k,), in its order."""
        return Outcomes(self.row[index], self.id[index], self.result[index])

    @classmethod
    def joined(cls, parts: "list[Outcomes]") -> "Outcomes":
        """The outcomes of all parts, sorted."""
        parts = [part for part in parts if len(part)]
        if not parts:
            return NO_OUTCOMES
        row, id_, result = (np.concatenate([getattr(part, name) for part in parts]) for name in ("row", "id", "result"))
        return cls(row, id_, result).select(np.lexsort((id_, row)))


_NOTHING = np.empty(0, np.int64)
_NOTHING.setflags(write=False)
NO_OUTCOMES = Outcomes(_NOTHING, _NOTHING, _NOTHING)  # nothing to tell
