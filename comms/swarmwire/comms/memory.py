"""What the agents of robots remember, as it is kept for whoever plays these robots next."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import AnyArray, IntArray

Layout = Mapping[str, tuple[str, tuple[int, ...]]]  # of each column: dtype, as in frames, and shape without the rows


@dataclass(frozen=True, slots=True)
class GroupMemory:
    """What is remembered of some robots of one group."""

    rows: IntArray  # (n,) robot row, rising
    columns: Mapping[str, AnyArray]  # (n,) or (n, width)

    def of(self, rows: IntArray) -> "GroupMemory":
        """What is remembered of these robots alone, as far as it is."""
        mine = np.isin(self.rows, rows)
        return GroupMemory(self.rows[mine], {name: column[mine] for name, column in self.columns.items()})

    @classmethod
    def joined(cls, parts: "list[GroupMemory]") -> "GroupMemory":
        """What is remembered of the robots of all parts, which are of one layout."""
        rows = np.concatenate([part.rows for part in parts])
        order = np.argsort(rows)
        names = parts[0].columns
        return cls(rows[order], {name: np.concatenate([part.columns[name] for part in parts])[order] for name in names})


Memory = dict[str, GroupMemory]  # by group
