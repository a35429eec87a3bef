"""The assignment of robots to a backend or a runner, with all facts that its agents get before the first tick."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, cast

import numpy as np
from msgspec import Meta, Struct

from swarmwire.comms.base.arrays import IntArray, KeyArray
from swarmwire.comms.base.errors import BadFrame, BadInput
from swarmwire.comms.robot.bodies.body import Body, body_from_mapping
from swarmwire.comms.wire.frames import typed


@dataclass(frozen=True)
class GroupAssignment:
    """Robots of one group, in all arenas, with the agent that controls them."""

    name: str
    agent: str  # "package.module:Class" or "/path/file.py:Class"
    params: dict[str, Any]  # a list has one value per row
    body: Body
    rows: IntArray  # (n,) robot row: arena x robots + index, rising
    robot_names: tuple[str, ...]  # (n,) names in messages to users
    keys: KeyArray  # (n,) keys of the agents' draws, derived one-way, so that they do not reveal the arena's seed
    act_every_ticks: int = 1  # the robots act when the tick modulo this is 0


@dataclass(frozen=True)
class Assignment:
    """All robots of a runner, or of the whole run for a backend in this process."""

    groups: tuple[GroupAssignment, ...]
    rate_hz: int
    measures: tuple[str, ...] | None  # measurements of the receiver with each packet; None: no radio

    @property
    def robot_names(self) -> tuple[str, ...]:
        """Names of the robots, group after group."""
        return tuple(name for group in self.groups for name in group.robot_names)

    @property
    def rows(self) -> IntArray:
        """Robot rows, group after group; they do not rise if there are several groups and arenas."""
        return np.concatenate([group.rows for group in self.groups])

    @property
    def robots_text(self) -> str:
        """The robots in short: "flock-3", or "flock-0 … flock-9 (10 robots)"."""
        return robots_text(self.robot_names)

    def with_agents(self, agents: Mapping[str, str]) -> "Assignment":
        """Return a copy with these agents, by group; other groups keep their agents."""
        groups = tuple(replace(group, agent=agents.get(group.name, group.agent)) for group in self.groups)
        return replace(self, groups=groups)

    def as_mapping(self) -> dict[str, Any]:
        """Return the assignment as plain values that msgpack takes."""
        return {
            "rate_hz": self.rate_hz,
            "measures": None if self.measures is None else list(self.measures),
            "groups": [
                {
                    "name": group.name,
                    "agent": group.agent,
                    "params": group.params,
                    "body": group.body.as_mapping(),
                    "rows": group.rows.tolist(),
                    "robot_names": list(group.robot_names),
                    "keys": group.keys.tolist(),
                    "act_every_ticks": group.act_every_ticks,
                }
                for group in self.groups
            ],
        }

    @classmethod
    def from_mapping(cls, mapping: dict[str, Any]) -> "Assignment":
        """Make the assignment from the result of `as_mapping`; BadFrame for other values."""
        frame = typed(_AssignmentFrame, mapping, "assignment")
        groups = tuple(map(_group, frame.groups))
        if len({group.name for group in groups}) < len(groups):
            raise BadFrame("malformed", "groups: expected each name once")
        rows = [row for group in groups for row in group.rows.tolist()]
        if len({*rows}) < len(rows):
            raise BadFrame("malformed", "rows: expected each robot in one group")
        return cls(groups, frame.rate_hz, frame.measures)


PositiveInt = Annotated[int, Meta(ge=1, lt=2**31)]


class _GroupFrame(Struct):
    """A `GroupAssignment` on the wire."""

    name: str
    agent: str
    params: dict[str, Any]
    body: dict[str, Any]
    rows: Annotated[list[Annotated[int, Meta(ge=0, le=2**63 - 1)]], Meta(min_length=1)]
    robot_names: tuple[str, ...]
    keys: list[Annotated[int, Meta(ge=0)]]
    act_every_ticks: PositiveInt


class _AssignmentFrame(Struct):
    """An `Assignment` on the wire."""

    groups: list[_GroupFrame]
    rate_hz: PositiveInt
    measures: tuple[str, ...] | None


def _group(group: _GroupFrame) -> GroupAssignment:
    rows = np.array(group.rows, np.int64)
    if (rows[1:] <= rows[:-1]).any():
        raise BadFrame("malformed", "rows: expected robots by rising numbers")
    if not len(group.robot_names) == len(group.keys) == len(rows):
        raise BadFrame("malformed", "robot_names, keys: expected one for each of the rows")
    try:
        body, keys = body_from_mapping(group.body, where="assignment"), np.array(group.keys, np.uint64)
    except (BadInput, OverflowError) as error:
        raise BadFrame("malformed", str(error)) from error
    return GroupAssignment(
        group.name, group.agent, group.params, body, rows, group.robot_names, keys, group.act_every_ticks
    )


def params_of(params: dict[str, Any], index: IntArray) -> dict[str, Any]:
    """Return the parameters of the robots `index` (k,); a list, which has a value per robot, is cut to their values."""
    return {
        name: [cast("list[Any]", value)[i] for i in index.tolist()] if isinstance(value, list) else value
        for name, value in params.items()
    }


def split(assignment: Assignment, runners: int) -> list[Assignment]:
    """Split an assignment into nearly equal parts along the robot rows, at most one part per robot."""
    rows = np.sort(np.concatenate([group.rows for group in assignment.groups]))
    return [part_of(assignment, part) for part in np.array_split(rows, min(runners, len(rows)))]


def part_of(assignment: Assignment, rows: IntArray) -> Assignment:
    """Return the part of an assignment with these robot rows."""
    groups: list[GroupAssignment] = []
    for group in assignment.groups:
        selected = np.flatnonzero(np.isin(group.rows, rows))
        if len(selected):
            names = tuple(group.robot_names[i] for i in selected)
            groups.append(
                replace(
                    group,
                    params=params_of(group.params, selected),
                    rows=group.rows[selected],
                    robot_names=names,
                    keys=group.keys[selected],
                )
            )
    return Assignment(tuple(groups), assignment.rate_hz, assignment.measures)


MAX_SPANS = 8  # spans in a text; the names of further spans are left out
MAX_DIGITS = 9  # digits of the number at the end of a robot's name


def robots_text(names: Sequence[str]) -> str:
    """Return robot names in short: each span of consecutive numbers by its first and last name.

    >>> robots_text(["flock-0", "flock-1", "flock-2", "flock-3"])
    'flock-0 … flock-3 (4 robots)'
    >>> robots_text(["flock-0", "flock-2", "flock-3", "flock-4", "lone-0"])
    'flock-0, flock-2 … flock-4, lone-0 (5 robots)'
    """
    if len(names) <= 3:
        return ", ".join(names)
    spans: list[list[str]] = []
    for name in names:
        if spans and name == _successor(spans[-1][-1]):
            spans[-1].append(name)
        else:
            spans.append([name])
    texts = [f"{span[0]} … {span[-1]}" if len(span) > 2 else ", ".join(span) for span in spans[:MAX_SPANS]]
    omitted = sum(map(len, spans[MAX_SPANS:]))
    return ", ".join([*texts, f"and {omitted} more"] if omitted else texts) + f" ({len(names)} robots)"


def _successor(name: str) -> str:
    """Return the name with the next number at its end; "" without a number."""
    stem = name.rstrip("0123456789")
    digits = name[len(stem) :]
    return f"{stem}{int(digits) + 1}" if 0 < len(digits) <= MAX_DIGITS else ""
