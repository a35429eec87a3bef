"""What all robots sense and heard, cut into one part for each runner."""

import itertools

import numpy as np

from swarmwire.comms.arrays import IntArray
from swarmwire.comms.assignment import Assignment
from swarmwire.comms.packets import NO_OUTCOMES, Heard, Outcomes
from swarmwire.comms.tick_io import GroupSenses, Senses


def split_senses(senses: Senses, owner: IntArray, assignments: list[Assignment]) -> list[Senses]:
    """What the robots of each assignment sense; `owner` (rows,) names the assignment of each robot row."""
    parts: list[Senses] = [{} for _ in assignments]
    for name, group in senses.items():
        owners = owner[group.rows]
        order = np.argsort(owners, kind="stable")
        bounds = np.searchsorted(owners[order], np.arange(len(assignments) + 1))
        rows = group.rows[order]
        fields = {field: column[order] for field, column in group.fields.items()}
        spans = zip(assignments, parts, bounds[:-1].tolist(), bounds[1:].tolist(), strict=True)
        for assignment, part, first, last in spans:
            # Also a group none of whose robots acts now: their agents must forget, as they do beside others.
            if name in [group.name for group in assignment.groups]:
                own = {field: column[first:last] for field, column in fields.items()}
                part[name] = GroupSenses(rows[first:last], own)
    return parts


def acting(part: Senses) -> IntArray:
    """The robot rows of a part, group after group: the order of the answer."""
    if len(part) == 1:
        return next(iter(part.values())).rows
    return np.concatenate([np.empty(0, np.int64), *(group.rows for group in part.values())])


def split_heard(heard: Heard, owner: IntArray, slots: int) -> list[Heard]:
    """What the robots of each of `slots` parts heard, each with its payloads, once; `owner` is (rows,)."""
    if not len(heard):
        return [heard] * slots
    by_slot = np.argsort(owner[heard.receiver], kind="stable")
    slot_of = owner[heard.receiver[by_slot]]
    sorted_heard = heard.select(by_slot)
    packets = len(heard.payloads)
    wanted, place = np.unique(slot_of * packets + sorted_heard.payload, return_inverse=True)
    payloads = heard.payloads.rows(wanted % packets)
    first_row = np.searchsorted(slot_of, np.arange(slots + 1)).tolist()
    first_payload = np.searchsorted(wanted // packets, np.arange(slots + 1)).tolist()
    place = place.reshape(-1)
    return [
        Heard(
            sorted_heard.receiver[a:b],
            sorted_heard.sender[a:b],
            sorted_heard.sequence[a:b],
            sorted_heard.heard_at_ns[a:b],
            {name: column[a:b] for name, column in sorted_heard.given.items()},
            place[a:b] - p,
            payloads.span(p, q),
        )
        for a, b, p, q in zip(first_row[:-1], first_row[1:], first_payload[:-1], first_payload[1:], strict=True)
    ]


def split_outcomes(outcomes: Outcomes, owner: IntArray, slots: int) -> list[Outcomes]:
    """What the robots of each of `slots` parts learn of their packets; `owner` is (rows,)."""
    if not len(outcomes):
        return [NO_OUTCOMES] * slots
    slot_of = owner[outcomes.row]
    by_slot = np.argsort(slot_of, kind="stable")
    first = np.searchsorted(slot_of[by_slot], np.arange(slots + 1)).tolist()
    return [outcomes.select(by_slot[a:b]) for a, b in itertools.pairwise(first)]
