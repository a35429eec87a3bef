"""Contacts: a record for each two things that are listed as near, kept as long as they are. Compiled."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.arrays import AnyArray, BoolArray, IntArray
from swarmwire.comms.kernels import borrowing
from swarmwire.world.engines.discs.fixed import ROBOT, gap_to_circle, gap_to_fixed

# Robots look ahead for what their speed may reach in a step and this share of their radius, since others may push them.
LOOK_AHEAD = 0.05
TOUCH_M = 1e-4  # a gap up to this counts as touch, so that contacts that last do not flicker
BEFORE, NOW = 1, 2  # bits of touch: in the tick before, in this one

CONTACT = np.dtype(
    [
        ("row", np.int64),
        ("kind", np.int64),  # of the other thing: ROBOT, or as `fixed` has it
        ("which", np.int64),  # its row, or its number among its kind
        ("touch", np.int64),  # bits; robots alone
        ("nx", np.float64),  # unit vector towards the other thing
        ("ny", np.float64),
        ("gap_m", np.float64),  # negative: they overlap
        ("closing_mps", np.float64),  # the most that leaves no overlap after the step
        ("mass_kg", np.float64),  # what resists a change of the speed along the normal
        ("rubbing_kg", np.float64),  # and along the tangent
        ("push_ns", np.float64),  # impulses of the last step: along the normal
        ("rub_ns", np.float64),  # and along the tangent
    ]
)


@borrowing(from_python=True)
def contacts_of(contacts, robots, pairs, things, old):
    """Fill records (pairs + things,) for what is listed; touch and impulses are carried over from the `old` ones."""
    at = 0
    for k in range(len(contacts)):
        contact = contacts[k]
        if k < len(pairs):
            contact.row, contact.kind, contact.which = pairs[k, 0], ROBOT, pairs[k, 1]
            one, other = robots[contact.row], robots[contact.which]
            per_kg, turning_per_kg = one.per_kg + other.per_kg, _turning_per_kg(one) + _turning_per_kg(other)
        else:
            thing = k - len(pairs)
            contact.row, contact.kind, contact.which = things[thing, 0], things[thing, 1], things[thing, 2]
            per_kg, turning_per_kg = robots[contact.row].per_kg, _turning_per_kg(robots[contact.row])
        contact.mass_kg, contact.rubbing_kg = 1.0 / per_kg, 1.0 / (per_kg + turning_per_kg)
        while at < len(old) and _is_before(old[at], contact):
            at += 1
        same = at < len(old) and not _is_before(contact, old[at])
        contact.touch = old[at].touch if same else 0
        contact.push_ns, contact.rub_ns = (old[at].push_ns, old[at].rub_ns) if same else (0.0, 0.0)


@borrowing()
def _turning_per_kg(robot):
    """What a robot's turning adds to how easily its rim gives way along the tangent."""
    return robot.radius_m * robot.radius_m * robot.per_kgm2


@borrowing()
def _is_before(one, other):
    """Whether a contact stands before another one: robots before fixed things, then by row, kind and number."""
    if (one.kind == ROBOT) != (other.kind == ROBOT):
        return one.kind == ROBOT
    if one.row != other.row:
        return one.row < other.row
    if one.kind != other.kind:
        return one.kind < other.kind
    return one.which < other.which


@njit(cache=True)
def crowd_of(moving: BoolArray, contacts: AnyArray) -> tuple[IntArray, IntArray]:
    """The rows near which something is listed in `contacts` (k,) of dtype CONTACT, and the others; both rising.

    Only rows that are `moving` (rows,), as are all that are listed.
    """
    crowded = np.zeros(len(moving), np.bool_)
    for k in range(len(contacts)):
        crowded[contacts[k].row] = True
        if contacts[k].kind == ROBOT:
            crowded[contacts[k].which] = True
    return np.flatnonzero(crowded), np.flatnonzero(moving & ~crowded)


@borrowing()
def find_contacts(contacts, met, robots, state, fastest_mps, dt_s, half_size_m, circle, side_start, side):
    """Put the places of the contacts that may meet in this step into `met`, in order; returns how many.

    Impulses of the step before are kept where one of the two robots is driven. `fastest_mps` is the greatest speed of
    any robot.
    """
    count = 0
    for k in range(len(contacts)):
        contact = contacts[k]
        one, here = robots[contact.row], state[contact.row]
        ahead_m = LOOK_AHEAD * one.radius_m
        near, driven = False, one.driven
        if contact.kind == ROBOT:
            other, there = robots[contact.which], state[contact.which]
            driven |= other.driven
            ahead_m += LOOK_AHEAD * other.radius_m
            dx, dy = there[0] - here[0], there[1] - here[1]
            most_m = one.radius_m + other.radius_m + ahead_m + 2.0 * dt_s * fastest_mps
            if dx * dx + dy * dy <= most_m * most_m:
                gap_m, nx, ny = gap_to_circle(here[0], here[1], one.radius_m, there[0], there[1], other.radius_m)
                near = gap_m <= ahead_m + dt_s * (_speed_mps(here) + _speed_mps(there))
        else:
            gap_m, nx, ny = gap_to_fixed(
                contact.kind, contact.which, here[0], here[1], one.radius_m, half_size_m, circle, side_start, side
            )
            near = gap_m <= ahead_m + dt_s * _speed_mps(here)
        if near:
            contact.nx, contact.ny, contact.gap_m, contact.closing_mps = nx, ny, gap_m, max(gap_m, 0.0) / dt_s
            met[count] = k
            count += 1
        if not (near and driven):
            contact.push_ns = contact.rub_ns = 0.0
    return count


@borrowing()
def _speed_mps(now):
    return np.sqrt(now[3] * now[3] + now[4] * now[4])
