"""Which robots go to which runner, with the keys of their draws."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Generic, Literal, TypeVar

import numpy as np

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.assignment import Assignment, GroupAssignment, params_of
from swarmwire.comms.draws import derive_key
from swarmwire.comms.truth import Static
from swarmwire.comms.wire.agent_memory import GroupMemory
from swarmwire.world.scenario.scenario import Scenario


def whole(scenario: Scenario, static: Static, agents: Mapping[str, str]) -> Assignment:
    """All robots of all arenas; `agents` gives each group's agent spec."""
    keys = np.array([[derive_key("robot", seed, i) for i in range(static.robots)] for seed in static.seeds], np.uint64)
    groups = tuple(
        GroupAssignment(
            name=group.name,
            agent=agents[group.name],
            params=params_of(scenario.robots[group.name].params, rows % static.robots - group.start),
            body=group.body.told,
            rows=rows,
            robot_names=tuple(_name(static, int(row)) for row in rows),
            keys=keys.reshape(-1)[rows],
            act_every_ticks=group.act_every_ticks,
        )
        for group in static.groups
        for rows in [_rows(static, group.start, group.stop)]
    )
    return Assignment(groups, static.rate_hz, scenario.radio.measures.columns if scenario.radio else None)


def split(assignment: Assignment, runners: int) -> list[Assignment]:
    """The robots in as many nearly equal parts, at most one part per robot, along the robot rows."""
    rows = np.sort(np.concatenate([group.rows for group in assignment.groups]))
    return [part_of(assignment, part) for part in np.array_split(rows, min(runners, len(rows)))]


def part_of(assignment: Assignment, rows: IntArray) -> Assignment:
    """The assignment's robots that are among these rows."""
    groups: list[GroupAssignment] = []
    for group in assignment.groups:
        at = np.flatnonzero(np.isin(group.rows, rows))
        if len(at):
            names = tuple(group.robot_names[i] for i in at)
            groups.append(
                replace(
                    group,
                    params=params_of(group.params, at),
                    rows=group.rows[at],
                    robot_names=names,
                    keys=group.keys[at],
                )
            )
    return Assignment(tuple(groups), assignment.rate_hz, assignment.measures)


def merged(parts: list[Assignment]) -> Assignment:
    """The robots of all parts of one run, in one assignment."""
    if len(parts) == 1:
        return parts[0]
    names = list(dict.fromkeys(group.name for part in parts for group in part.groups))
    groups = [_one([group for part in parts for group in part.groups if group.name == name]) for name in names]
    return replace(parts[0], groups=tuple(groups))


def _one(parts: list[GroupAssignment]) -> GroupAssignment:
    """The robots of all parts of one group."""
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
        robot_names=tuple(names[int(at)] for at in order),
        keys=np.concatenate([part.keys for part in parts])[order],
    )


def _rows(static: Static, start: int, stop: int) -> IntArray:
    first = np.arange(static.arenas, dtype=np.int64) * static.robots
    return (first[:, None] + np.arange(start, stop, dtype=np.int64)).reshape(-1)


def _name(static: Static, row: int) -> str:
    arena, index = divmod(row, static.robots)
    name = static.robot_names[index]
    return name if static.arenas == 1 else f"a{arena}/{name}"


# --- Some robots and the runner that plays them, and the states through which that goes.
#
# `MOVES` says from which state a move leads to which; the picture in the docs is drawn from it. In real time nobody is
# waited for: there a runner that is asked stays ready.


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
class Allocation:
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

    def remember(self, other: "Allocation", rows: IntArray) -> None:
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


# --- All slots of a run: each robot is in one of them, and a runner that asks for some gets a slot of exactly these.


NOBODY = -1  # owner of a robot that no slot holds

S = TypeVar("S", bound=Allocation)


class Allocations(Generic[S]):
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
