"""The assignment of robots to a backend or a runner, with all facts that its agents get before the first tick."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from swarmwire.comms.arrays import IntArray, KeyArray
from swarmwire.comms.bodies.body import Body, body_from_mapping
from swarmwire.comms.errors import BadFrame, BadInput


@dataclass(frozen=True)
class GroupAssignment:
    """Robots of one group, over all arenas, with the agent that decides for them."""

    name: str
    agent: str  # "package.module:Class" or "/path/file.py:Class"
    params: dict[str, Any]  # a list has one value per row
    body: Body
    rows: IntArray  # (n,) robot row: arena x robots + index, rising
    robot_names: tuple[str, ...]  # (n,) for messages to users
    keys: KeyArray  # (n,) for the agents' draws; one-way derived, so that they do not reveal the arena's seed
    act_every_ticks: int = 1  # the robots act when the tick modulo this is 0


@dataclass(frozen=True)
class Assignment:
    """All robots of one runner (or of the whole run, for a backend in this process)."""

    groups: tuple[GroupAssignment, ...]
    rate_hz: int
    measures: tuple[str, ...] | None  # measurements of the radio with each packet; None: there is no radio

    @property
    def robot_names(self) -> tuple[str, ...]:
        """The robots' names, group after group."""
        return tuple(name for group in self.groups for name in group.robot_names)

    @property
    def robots_text(self) -> str:
        """The robots in a few words: "flock-3", or "flock-0 … flock-9 (10 robots)"."""
        return robots_text(list(self.robot_names))

    def with_agents(self, agents: Mapping[str, str]) -> "Assignment":
        """A copy with these agents, by group, in place of its own."""
        groups = tuple(replace(group, agent=agents.get(group.name, group.agent)) for group in self.groups)
        return replace(self, groups=groups)

    def as_mapping(self) -> dict[str, Any]:
        """The assignment as plain values that msgpack takes."""
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
        """The assignment that `as_mapping` wrote down; BadFrame for other values."""
        try:
            measures = None if mapping["measures"] is None else _texts(mapping["measures"])
            return cls(tuple(_group(group) for group in mapping["groups"]), _whole(mapping["rate_hz"]), measures)
        except (KeyError, TypeError, ValueError, OverflowError, BadInput) as error:
            raise BadFrame("malformed", f"expected robots: {' '.join(str(error).split())}") from error


def _group(values: Any) -> GroupAssignment:
    group = GroupAssignment(
        name=_text(values["name"]),
        agent=_text(values["agent"]),
        params=values["params"],
        body=body_from_mapping(values["body"], where="assignment"),
        rows=np.array(values["rows"], np.int64),
        robot_names=_texts(values["robot_names"]),
        keys=np.array(values["keys"], np.uint64),
        act_every_ticks=_whole(values["act_every_ticks"]),
    )
    rows = group.rows
    if rows.ndim != 1 or not len(rows) or rows[0] < 0 or (rows[1:] <= rows[:-1]).any():
        raise ValueError("rows: robots by rising numbers")
    if len(group.robot_names) != len(rows) or group.keys.shape != rows.shape:
        raise ValueError("robot_names, keys: one for each of the rows")
    if type(values["params"]) is not dict or not all(type(name) is str for name in group.params):
        raise ValueError("params: a map")
    return group


def _text(value: object) -> str:
    if type(value) is not str:
        raise TypeError(f"a text, not {str(value)[:40]}")
    return value


def _texts(values: Any) -> tuple[str, ...]:
    if type(values) is not list:
        raise TypeError(f"a list of texts, not {str(values)[:40]}")
    return tuple(_text(value) for value in cast("list[object]", values))


def _whole(value: object) -> int:
    if type(value) is not int or not 0 < value < 2**31:
        raise ValueError(f"a whole number above 0, not {str(value)[:40]}")
    return value


def params_of(params: dict[str, Any], index: IntArray) -> dict[str, Any]:
    """The parameters of the robots `index` (k,): from lists, which have a value per robot, only their values."""
    return {
        name: [cast("list[Any]", value)[i] for i in index.tolist()] if isinstance(value, list) else value
        for name, value in params.items()
    }


def robots_text(names: list[str]) -> str:
    """Robot names in a few words.

    >>> robots_text(["flock-0", "flock-1", "flock-2", "flock-3"])
    'flock-0 … flock-3 (4 robots)'
    """
    if len(names) <= 3:
        return ", ".join(names)
    return f"{names[0]} … {names[-1]} ({len(names)} robots)"
