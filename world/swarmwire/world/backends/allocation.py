"""Allocations: the robots that each runner plays, with the keys of their draws.

An assignment lists robots by group. `full_assignment` builds the assignment of a run, `part_of` and `merge` divide and
join assignments. `Allocation` adds the runner of an assignment and its state; `MOVES` is the state machine, from
which the docs draw their diagram. `Allocations` are all allocations of a run: each robot is in exactly one.
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


def full_assignment(scenario: Scenario, static: Static, agents: Mapping[str, str]) -> Assignment:
    """Return the assignment of all robots of all arenas; `agents` maps each group to its agent spec."""
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


def merge(parts: list[Assignment]) -> Assignment:
    """Merge parts of one run into one assignment."""
    if len(parts) == 1:
        return parts[0]
    names = list(dict.fromkeys(group.name for part in parts for group in part.groups))
    groups = [_merge_group([group for part in parts for group in part.groups if group.name == name]) for name in names]
    return replace(parts[0], groups=tuple(groups))


def _merge_group(parts: list[GroupAssignment]) -> GroupAssignment:
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


AllocationState = Literal["free", "joined", "ready", "waiting", "dead"]
Move = Literal["joins", "is ready", "is asked", "answers", "is lost", "is given up"]

# State -> move -> next state. In real time the loop waits for no runner, which therefore stays `ready` after a frame.
MOVES: dict[AllocationState, dict[Move, AllocationState]] = {
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
    rows: IntArray  # (n,) robot rows that act in the open tick, group after group as in the answer
    runner: str | None = None
    state: AllocationState = "free"
    memory: dict[str, list[GroupMemory]] = field(
        default_factory=dict[str, list[GroupMemory]]
    )  # agents' memory by group
    foreign: bool = False  # True: the runner sent no hashes of its agents, so their code is unknown
    restarts: Counter[int] = field(default_factory=Counter[int])  # this runner's restarts of each robot row's process
    processes: int = 1  # number of processes among which the runner divides its robots

    def __post_init__(self) -> None:
        self._all_rows = self.assignment.rows

    @property
    def all_rows(self) -> IntArray:
        """Every robot row of the allocation, (n,)."""
        return self._all_rows

    def copy_memory(self, other: "Allocation", rows: IntArray) -> None:
        """Copy the memory of these robots from another allocation."""
        for name, parts in other.memory.items():
            part_rows = [part for part in (part.for_rows(rows) for part in parts) if len(part.rows)]
            if part_rows:
                self.memory.setdefault(name, []).extend(part_rows)

    def restrict(self, rows: IntArray) -> None:
        """Remove all robots except these, (m,) ascending."""
        self.assignment = part_of(self.assignment, rows)
        self.rows = self.rows[np.isin(self.rows, rows)]
        self.memory = {name: [part.for_rows(rows) for part in parts] for name, parts in self.memory.items()}
        self._all_rows = self.assignment.rows

    def allows(self, move: Move) -> bool:
        """Return True if the state allows the move."""
        return move in MOVES[self.state]

    def move(self, move: Move) -> None:
        """Change the state; raise RuntimeError and change nothing if the state does not allow the move."""
        if not self.allows(move):
            raise RuntimeError(f"an allocation that is {self.state} has no move {move!r}")
        self.state = MOVES[self.state][move]


NO_ALLOCATION = -1  # owner of a robot without an allocation

AllocationT = TypeVar("AllocationT", bound=Allocation)


class Allocations(Generic[AllocationT]):
    """All allocations of a run, in order. Each robot is in exactly one of them.

    A runner that joins gets a new allocation of exactly its robots, cut from free allocations.

    Attributes:
        owner: (robots,) int64, the index of the allocation of each robot row. It changes only when an allocation is
            cut, so a tick costs the same as with parts that were cut before the run.
        row_of: the row of each robot by its name.
        parts: number of parts into which the run was divided at first.
    """

    def __init__(self, parts: Sequence[Assignment], new_allocation: Callable[[Assignment], AllocationT]) -> None:
        """One allocation per part; `new_allocation` returns a free allocation."""
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
        return [allocation for allocation in self._allocations if allocation.allows("joins")]

    def containing(self, rows: IntArray) -> list[AllocationT]:
        """Return the allocations with any of these robots; the cost does not depend on the number of allocations."""
        return [self._allocations[index] for index in np.unique(self.owner[rows]).tolist()]

    def cut(self, rows: IntArray) -> AllocationT:
        """Return an allocation of exactly these robots, (n,) ascending, cut from the free allocations with them."""
        sources = self.containing(rows)
        if len(sources) == 1 and len(sources[0].all_rows) == len(rows):
            return sources[0]
        allocation = self._new_allocation(merge([part_of(source.assignment, rows) for source in sources]))
        for source in sources:
            allocation.copy_memory(source, rows)
            self._remove_robots(source, rows)
        self._allocations.append(allocation)
        self.owner = self._owners()
        return allocation

    def split_off(self, source: AllocationT, rows: IntArray) -> AllocationT:
        """Move some robots of `source`, (n,) ascending, to an allocation in the same state without a runner."""
        part = self._new_allocation(part_of(source.assignment, rows))
        part.state = source.state
        part.copy_memory(source, rows)
        source.restrict(source.all_rows[~np.isin(source.all_rows, rows)])
        self._allocations.append(part)
        self.owner = self._owners()
        return part

    def _remove_robots(self, source: AllocationT, rows: IntArray) -> None:
        """Replace an allocation by an allocation of its remaining robots; delete it if none remain."""
        remaining = source.all_rows[~np.isin(source.all_rows, rows)]
        index = self._allocations.index(source)
        if len(remaining):
            allocation = self._allocations[index] = self._new_allocation(part_of(source.assignment, remaining))
            allocation.copy_memory(source, remaining)
        else:
            del self._allocations[index]

    def _owners(self) -> IntArray:
        rows = [allocation.all_rows for allocation in self._allocations]
        all_rows = np.concatenate(rows)
        owner = np.full(1 + int(all_rows.max()), NO_ALLOCATION)
        owner[all_rows] = np.repeat(np.arange(len(rows)), [len(part_rows) for part_rows in rows])
        return owner


def _named(part: Assignment) -> list[tuple[str, int]]:
    return [pair for group in part.groups for pair in zip(group.robot_names, group.rows.tolist(), strict=True)]
