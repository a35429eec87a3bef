"""All slots of a run: each robot is in one of them, and a runner that asks for some gets a slot of exactly these."""

from collections.abc import Callable, Iterator, Sequence
from typing import Generic, TypeVar

import numpy as np

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.assignment import Assignment
from swarmwire.world.crews.slot import Slot
from swarmwire.world.crews.split_robots import merged, part_of

NOBODY = -1  # owner of a robot that no slot holds

S = TypeVar("S", bound=Slot)


class Slots(Generic[S]):
    """The slots in their order.

    Attributes:
        owner: (robots,) int64, the place of each robot row's slot. It changes only when slots are cut, so that a tick
            costs the same as with parts that were cut before the run.
        row_of: the row of each robot by its name.
    """

    def __init__(self, parts: Sequence[Assignment], slot_of: Callable[[Assignment], S]) -> None:
        """A slot of each part; `slot_of` makes one that is free."""
        self._slot_of = slot_of
        self._slots = [slot_of(part) for part in parts]
        self.row_of = {name: row for part in parts for name, row in _named(part)}
        self.owner = self._owners()

    def __iter__(self) -> Iterator[S]:
        return iter(self._slots)

    def __len__(self) -> int:
        return len(self._slots)

    @property
    def assignments(self) -> list[Assignment]:
        """The robots of each slot."""
        return [slot.assignment for slot in self._slots]

    @property
    def free(self) -> list[S]:
        """Those whose robots a runner may have."""
        return [slot for slot in self._slots if slot.may("joins")]

    def holding(self, rows: IntArray) -> list[S]:
        """The slots that hold any of these robots; it takes no longer where there are a thousand slots."""
        return [self._slots[place] for place in np.unique(self.owner[rows]).tolist()]

    def cut(self, rows: IntArray) -> S:
        """A free slot of exactly these robots, (n,) rising, all of which are in slots that are free."""
        olds = self.holding(rows)
        if len(olds) == 1 and len(olds[0].all_rows) == len(rows):
            return olds[0]
        slot = self._slot_of(merged([part_of(old.assignment, rows) for old in olds]))
        for old in olds:
            slot.remember(old, rows)
            self._leave_rest(old, rows)
        self._slots.append(slot)
        self.owner = self._owners()
        return slot

    def _leave_rest(self, old: S, rows: IntArray) -> None:
        """In the place of a slot, one of its robots that are not taken; none if all are."""
        rest = old.all_rows[~np.isin(old.all_rows, rows)]
        place = self._slots.index(old)
        if len(rest):
            kept = self._slots[place] = self._slot_of(part_of(old.assignment, rest))
            kept.remember(old, rest)
        else:
            del self._slots[place]

    def _owners(self) -> IntArray:
        rows = [slot.all_rows for slot in self._slots]
        every = np.concatenate(rows)
        owner = np.full(1 + int(every.max()), NOBODY)
        owner[every] = np.repeat(np.arange(len(rows)), [len(own) for own in rows])
        return owner


def _named(part: Assignment) -> list[tuple[str, int]]:
    return [pair for group in part.groups for pair in zip(group.robot_names, group.rows.tolist(), strict=True)]
