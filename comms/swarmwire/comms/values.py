"""Values: the numbers that agents tell whoever looks on (`note(value=1.25)`). They change nothing in the run."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray


@dataclass(frozen=True, slots=True)
class Values:
    """The numbers that some robots told in one tick, a row each; of two rows of a robot the later counts."""

    rows: IntArray  # (k,) robot row: arena x robots + index
    value: FloatArray  # (k,) finite

    def __len__(self) -> int:
        return len(self.rows)

    @classmethod
    def joined(cls, parts: "list[Values]") -> "Values":
        """Those of all parts, in order."""
        parts = [part for part in parts if len(part)]
        if len(parts) < 2:
            return parts[0] if parts else NO_VALUES
        return cls(np.concatenate([part.rows for part in parts]), np.concatenate([part.value for part in parts]))


NO_VALUES = Values(np.empty(0, np.int64), np.empty(0))  # nobody tells any
