"""Some robots and the runner that plays them, and the states through which that goes.

`MOVES` says from which state a move leads to which; the picture in the docs is drawn from it. In real time nobody is
waited for: there a runner that is asked stays ready.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.assignment import Assignment
from swarmwire.comms.wire.agent_memory import GroupMemory

State = Literal["free", "joined", "ready", "waiting", "dead"]
Move = Literal["joins", "is ready", "is asked", "answers", "is lost", "is given up"]

MOVES: dict[State, dict[Move, State]] = {
    "free": {"joins": "joined"},  # a runner asks, and gets the slot's robots
    "joined": {"is ready": "ready", "is lost": "free", "is given up": "dead"},  # ready: its agents are built
    "ready": {"is asked": "waiting", "is lost": "free", "is given up": "dead"},
    "waiting": {"answers": "ready", "is lost": "free", "is given up": "dead"},
    "dead": {},  # the robots stand still to the end
}


@dataclass(eq=False)
class Slot:
    """Some robots, and the runner that plays them."""

    assignment: Assignment
    rows: IntArray  # (n,) that act in the tick that is open, in the order of the answer: group after group
    runner: str | None = None
    state: State = "free"
    memory: dict[str, list[GroupMemory]] = field(default_factory=dict[str, list[GroupMemory]])  # of all rows, by group
    foreign: bool = False  # whether the runner plays code of its own, of which it told nothing

    def __post_init__(self) -> None:
        self._all_rows = rows_of(self.assignment)

    @property
    def all_rows(self) -> IntArray:
        """Every robot of the slot, (n,)."""
        return self._all_rows

    def remember(self, other: "Slot", rows: IntArray) -> None:
        """What another slot remembers of these robots is remembered here, too."""
        for name, parts in other.memory.items():
            own = [part for part in (part.of(rows) for part in parts) if len(part.rows)]
            if own:
                self.memory.setdefault(name, []).extend(own)

    def may(self, move: Move) -> bool:
        """Whether the move leads anywhere from the state."""
        return move in MOVES[self.state]

    def move(self, move: Move) -> None:
        """Change the state; RuntimeError, and nothing changed, if the move leads nowhere from it."""
        if not self.may(move):
            raise RuntimeError(f"a slot that is {self.state} has no move {move!r}")
        self.state = MOVES[self.state][move]


def rows_of(assignment: Assignment) -> IntArray:
    """The robot rows of an assignment, group after group."""
    return np.concatenate([group.rows for group in assignment.groups])
