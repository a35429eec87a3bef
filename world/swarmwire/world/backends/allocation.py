"""Allocations: the robots that each runner plays, with the keys of their draws.

An assignment lists robots by group. `whole` builds the assignment of a run, `split`, `part_of` and `merged` divide and
join assignments. `Allocation` adds the runner of an assignment and its state; `MOVES` holds the state machine, from
which the docs draw their diagram. `Allocations` holds all allocations of a run: each robot is in exactly one.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Generic, Literal, TypeVar

import numpy as np

from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.observe.truth import Static
from swarmwire.comms.wire.agent_memory import GroupMemory
from swarmwire.comms.wire.assignment import Assignment, GroupAssignment, params_of, part_of
from swarmwire.world.scenario.scenario import Scenario


def whole(scenario: Scenario, static: Static, agents: Mapping[str, str]) -> Assignment:
    """The assignment of all robots of all arenas; `agents` maps each group to its agent spec."""
    keys = np.array([[derive_key("robot", seed, i) for i in range(static.robots)] for seed in static.seeds], np.uint64)
    groups = tuple(
        GroupAssignment(
            name=group.name,
            agent=agents[group.name],
            params=params_of(scenario.robots[group.name].params, rows % static.robots - group.start),
            body=group.body.agent_view,
            rows=rows,
            robot_names=tuple(_name(static, int(row)) for row in rows),
            keys=keys.reshape(-1)[rows],
            act_every_ticks=group.act_every_ticks,
        )
        for group in static.groups
        for rows in [_rows(static, group.start, group.stop)]
    )
    return Assignment(groups, static.rate_hz, scenario.radio.measures.columns if scenario.radio else None)


def merged(parts: list[Assignment]) -> Assignment:
    """Merge parts of one run into one assignment."""
    if len(parts) == 1:
        return parts[0]
    names = list(dict.fromkeys(group.name for part in parts for group in part.groups))
    groups = [_merged_group([group for part in parts for group in part.groups if group.name == name]) for name in names]
    return replace(parts[0], groups=tuple(groups))


def _merged_group(parts: list[GroupAssignment]) -> GroupAssignment:
    """Merge parts of one group, in the order of the robot rows."""
    rows = np.concatenate([part.rows for part in parts])
    order = np.argsort(rows)
    names = [name for part in parts for name in part.robot_names]
    params = {
        name: [item for part in parts for item in part.params[name]] if isinstance(value, list) else value
        for name, value in parts[0].params.items()
    }
    return replace(
        parts[0],
        params=params_of(params, order),
        rows=rows[order],
        robot_names=tuple(names[int(i)] for i in order),
        keys=np.concatenate([part.keys for part in parts])[order],
    )


def _rows(static: Static, start: int, stop: int) -> IntArray:
    first = np.arange(static.arenas, dtype=np.int64) * static.robots
    return (first[:, None] + np.arange(start, stop, dtype=np.int64)).reshape(-1)


def _name(static: Static, row: int) -> str:
    arena, index = divmod(row, static.robots)
    name = static.robot_names[index]
    return name if static.arenas == 1 else f"a{arena}/{name}"


State = Literal["free", "joined", "ready", "waiting", "dead"]
Move = Literal["joins", "is ready", "is asked", "answers", "is lost", "is given up"]

# From each state, the next state by move. In real time the loop waits for no runner: there a runner stays `ready` after
# a frame was sent to it.
MOVES: dict[State, dict[Move, State]] = {
    "free": {"joins": "joined"},  # a join request was accepted
    "joined": {"is ready": "ready", "is lost": "free", "is given up": "dead"},  # ready: its agents are built
    "ready": {"is asked": "waiting", "is lost": "free", "is given up": "dead"},
    "waiting": {"answers": "ready", "is lost": "free", "is given up": "dead"},
    "dead": {},  # the robots stand still until the end of the run
}


@dataclass(eq=False)
class Allocation:
    """Robots, the runner that plays them, and the state of that runner."""

    assignment: Assignment
    rows: IntArray  # (n,) robot rows that act in the open tick, in the order of the answer: group after group
    runner: str | None = None
    state: State = "free"
    memory: dict[str, list[GroupMemory]] = field(default_factory=dict[str, list[GroupMemory]])  # of all rows, by group
    foreign: bool = False  # whether the runner sent no hashes of its agents, so that their code is unknown
    restarts: Counter[int] = field(default_factory=Counter[int])  # of the process of each robot row, by this runner
    processes: int = 1  # of the runner, between which its robots are divided

    def __post_init__(self) -> None:
        self._all_rows = self.assignment.rows

    @property
    def all_rows(self) -> IntArray:
        """Every robot row of the allocation, (n,)."""
        return self._all_rows

    def remember(self, other: "Allocation", rows: IntArray) -> None:
        """Copy the memory of these robots from another allocation."""
        for name, parts in other.memory.items():
            part_rows = [part for part in (part.for_rows(rows) for part in parts) if len(part.rows)]
            if part_rows:
                self.memory.setdefault(name, []).extend(part_rows)

    def keep(self, rows: IntArray) -> None:
        """Keep these robots alone, (m,) rising."""
        self.assignment = part_of(self.assignment, rows)
        self.rows = self.rows[np.isin(self.rows, rows)]
        self.memory = {name: [part.for_rows(rows) for part in parts] for name, parts in self.memory.items()}
        self._all_rows = self.assignment.rows

    def may(self, move: Move) -> bool:
        """Whether the state allows the move."""
        return move in MOVES[self.state]

    def move(self, move: Move) -> None:
        """Change the state; raise RuntimeError and change nothing if the state does not allow the move."""
        if not self.may(move):
            raise RuntimeError(f"an allocation that is {self.state} has no move {move!r}")
        self.state = MOVES[self.state][move]


NO_ALLOCATION = -1  # owner of a robot that is in no allocation

AllocationT = TypeVar("AllocationT", bound=Allocation)


class Allocations(Generic[AllocationT]):
    """All allocations of a run, in order. Each robot is in exactly one of them.

    A runner that joins with some robots gets a new allocation of exactly these, cut from those that are free.

    Attributes:
        owner: (robots,) int64, the index of the allocation of each robot row. It changes only when an allocation is
            cut, so a tick costs the same as with parts that were cut before the run.
        row_of: the row of each robot by its name.
        parts: how many parts the run was divided into at first.
    """

    def __init__(self, parts: Sequence[Assignment], new_allocation: Callable[[Assignment], AllocationT]) -> None:
        """One allocation per part; `new_allocation` makes a free one."""
        self._new_allocation, self.parts = new_allocation, len(parts)
        self._allocations = [new_allocation(part) for part in parts]
        self.row_of = {name: row for part in parts for name, row in _named(part)}
        self.owner = self._owners()

    def __iter__(self) -> Iterator[AllocationT]:
        return iter(self._allocations)

    def __len__(self) -> int:
        return len(self._allocations)

    @property
    def assignments(self) -> list[Assignment]:
        """The assignment of each allocation."""
        return [allocation.assignment for allocation in self._allocations]

    @property
    def free(self) -> list[AllocationT]:
        """The allocations that a runner may join."""
        return [allocation for allocation in self._allocations if allocation.may("joins")]

    def holding(self, rows: IntArray) -> list[AllocationT]:
        """The allocations that hold any of these robots; the cost does not depend on the number of allocations."""
        return [self._allocations[place] for place in np.unique(self.owner[rows]).tolist()]

    def cut(self, rows: IntArray) -> AllocationT:
        """A free allocation of exactly these robots, (n,) rising, all of which are in free allocations."""
        sources = self.holding(rows)
        if len(sources) == 1 and len(sources[0].all_rows) == len(rows):
            return sources[0]
        allocation = self._new_allocation(merged([part_of(source.assignment, rows) for source in sources]))
        for source in sources:
            allocation.remember(source, rows)
            self._leave_rest(source, rows)
        self._allocations.append(allocation)
        self.owner = self._owners()
        return allocation

    def split_off(self, source: AllocationT, rows: IntArray) -> AllocationT:
        """An allocation of these robots of `source`, (n,) rising but not all, in the same state; it has no runner."""
        part = self._new_allocation(part_of(source.assignment, rows))
        part.state = source.state
        part.remember(source, rows)
        source.keep(source.all_rows[~np.isin(source.all_rows, rows)])
        self._allocations.append(part)
        self.owner = self._owners()
        return part

    def _leave_rest(self, source: AllocationT, rows: IntArray) -> None:
        """Replace an allocation by one of its remaining robots; remove it if none remain."""
        rest = source.all_rows[~np.isin(source.all_rows, rows)]
        place = self._allocations.index(source)
        if len(rest):
            remaining = self._allocations[place] = self._new_allocation(part_of(source.assignment, rest))
            remaining.remember(source, rest)
        else:
            del self._allocations[place]

    def _owners(self) -> IntArray:
        rows = [allocation.all_rows for allocation in self._allocations]
        all_rows = np.concatenate(rows)
        owner = np.full(1 + int(all_rows.max()), NO_ALLOCATION)
        owner[all_rows] = np.repeat(np.arange(len(rows)), [len(part_rows) for part_rows in rows])
        return owner


def _named(part: Assignment) -> list[tuple[str, int]]:
    return [pair for group in part.groups for pair in zip(group.robot_names, group.rows.tolist(), strict=True)]
