"""What agents set actuators of the user's own to in a tick; all others are not set anew."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray


@dataclass(frozen=True, slots=True)
class Actuations:
    """The numbers that some robots set in one tick, a row each; of two rows of a place the later counts."""

    rows: IntArray  # (k,) robot row: arena x robots + index
    place: IntArray  # (k,) among the numbers of all actuators of the body, in the order of its sheet
    value: FloatArray  # (k,)

    def __len__(self) -> int:
        return len(self.rows)

    @classmethod
    def joined(cls, parts: "list[Actuations]") -> "Actuations":
        """Those of all parts, in order."""
        parts = [part for part in parts if len(part)]
        if len(parts) < 2:
            return parts[0] if parts else NO_ACTUATIONS
        return cls(
            np.concatenate([part.rows for part in parts]),
            np.concatenate([part.place for part in parts]),
            np.concatenate([part.value for part in parts]),
        )


NO_ACTUATIONS = Actuations(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0))  # nobody acts
