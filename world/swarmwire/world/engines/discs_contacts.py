"""Contacts of a step: listed things that are so near that they may meet within it. Compiled."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.world.engines.discs_fixed import gap_to_circle, gap_to_fixed
from swarmwire.world.engines.discs_near import BEFORE, NOW

# Robots look ahead for what their speed may reach in a step and this share of their radius, since others may push them.
LOOK_AHEAD = 0.05
TOUCH_M = 1e-4  # a gap up to this counts as touch, so that contacts that last do not flicker

CONTACT = np.dtype(
    [
        ("first", np.int64),  # row
        ("second", np.int64),  # row; -1: something fixed
        ("pair", np.int64),  # in the list of pairs; -1: something fixed
        ("nx", np.float64),  # unit vector from the first to the second
        ("ny", np.float64),
        ("gap_m", np.float64),  # negative: they overlap
        ("closing_mps", np.float64),  # the most that leaves no overlap after the step
        ("mass_kg", np.float64),  # what resists a change of the speed along the normal
        ("rubbing_kg", np.float64),  # and along the tangent
        ("push_ns", np.float64),  # impulses given so far: along the normal
        ("rub_ns", np.float64),  # and along the tangent
    ]
)


@njit(cache=True)
def find_contacts(robots, state, dt_s, pairs, things, half_size_m, circle, side_start, side, contacts):
    """Fill `contacts` with those of the listed things that may meet, in the order of the lists; returns how many."""
    count = 0
    for k in range(len(pairs)):
        i, j = pairs[k, 0], pairs[k, 1]
        one, other = robots[i], robots[j]
        x, y, other_x, other_y = state[i, 0], state[i, 1], state[j, 0], state[j, 1]
        dx, dy = other_x - x, other_y - y
        most_m = one.radius_m + other.radius_m + _ahead_m(one, state[i], dt_s) + _ahead_m(other, state[j], dt_s)
        if dx * dx + dy * dy <= most_m * most_m:
            gap_m, nx, ny = gap_to_circle(x, y, one.radius_m, other_x, other_y, other.radius_m)
            _begin(contacts[count], i, j, k, gap_m, nx, ny, dt_s)
            _weigh(contacts[count], one.per_kg + other.per_kg, _turning_per_kg(one) + _turning_per_kg(other))
            count += 1
    for k in range(len(things)):
        i, kind, which = things[k, 0], things[k, 1], things[k, 2]
        one, x, y = robots[i], state[i, 0], state[i, 1]
        gap_m, nx, ny = gap_to_fixed(kind, which, x, y, one.radius_m, half_size_m, circle, side_start, side)
        if gap_m <= _ahead_m(one, state[i], dt_s):
            _begin(contacts[count], i, -1, -1, gap_m, nx, ny, dt_s)
            _weigh(contacts[count], one.per_kg, _turning_per_kg(one))
            count += 1
    return count


@njit(cache=True)
def _ahead_m(robot, now, dt_s):
    return dt_s * np.sqrt(now[3] * now[3] + now[4] * now[4]) + LOOK_AHEAD * robot.radius_m


@njit(cache=True)
def _turning_per_kg(robot):
    """What a robot's turning adds to how easily its rim gives way along the tangent."""
    return robot.radius_m * robot.radius_m * robot.per_kgm2


@njit(cache=True)
def _begin(contact, first, second, pair, gap_m, nx, ny, dt_s):
    contact.first, contact.second, contact.pair = first, second, pair
    contact.nx, contact.ny, contact.gap_m = nx, ny, gap_m
    contact.closing_mps = max(gap_m, 0.0) / dt_s
    contact.push_ns = contact.rub_ns = 0.0


@njit(cache=True)
def _weigh(contact, per_kg, turning_per_kg):
    contact.mass_kg, contact.rubbing_kg = 1.0 / per_kg, 1.0 / (per_kg + turning_per_kg)


@njit(cache=True)
def note_touches(contacts, robots, pairs, touched, per_arena, onsets):
    """Note who touched what in a step, and add to `onsets` what began with it.

    Args:
        contacts: of the step, solved.
        robots: (rows,) whose bits of touching anything fixed are set.
        pairs: listed, whose bits of touch are set.
        touched: (rows,) set to 1 for who touched.
        per_arena: robots of an arena.
        onsets: (arenas, 2) robot with robot, robot with something fixed.
    """
    for k in range(len(contacts)):
        contact = contacts[k]
        if contact.push_ns <= 0.0 and contact.gap_m > TOUCH_M:
            continue
        first, second = contact.first, contact.second
        arena = first // per_arena
        touched[first] = 1.0
        if second < 0:
            onsets[arena, 1] += robots[first].against_fixed == 0
            robots[first].against_fixed |= NOW
        else:
            touched[second] = 1.0
            onsets[arena, 0] += pairs[contact.pair, 2] == 0
            pairs[contact.pair, 2] |= NOW


@njit(cache=True)
def begin_tick(robots, pairs, touched):
    """What touched in the tick that ends did so before, and nothing has touched yet."""
    for k in range(len(pairs)):
        pairs[k, 2] = BEFORE if pairs[k, 2] & NOW else 0
    for row in range(len(robots)):
        robots[row].against_fixed = BEFORE if robots[row].against_fixed & NOW else 0
        touched[row] = 0.0
