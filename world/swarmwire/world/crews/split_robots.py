"""Which robots go to which runner, with the keys of their draws."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.assignment import Assignment, GroupAssignment, params_of
from swarmwire.comms.draws import derive_key
from swarmwire.comms.truth import Static
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
    return Assignment(groups, static.rate_hz, scenario.radio.gives.columns if scenario.radio else None)


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
    return Assignment(tuple(groups), assignment.rate_hz, assignment.gives)


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
