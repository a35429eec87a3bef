"""Contacts of the discs engine: records of listed pairs, gaps, and the count of contacts that begin. Compiled.

A contact is a record for a pair of bodies that are listed as near; it lasts as long as the pair is listed. All fixed
bodies count as one in the count of contacts: a contact begins if a pair touches in this tick and did not in the last.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, IntArray
from swarmwire.comms.base.kernels import kernel
from swarmwire.world.engines.discs.records import BEFORE, BOTTOM, CIRCLE, LEFT, NOW, POLYGON, RIGHT, ROBOT

# Contacts are sought within the distance that a robot's speed covers in a step, plus this share of its radius, since
# others may push it.
LOOK_AHEAD = 0.05
TOUCH_M = 1e-4  # a gap up to this counts as touch, so that lasting contacts do not flicker
# `driven` of a robot whose target is not zero. A robot that others push has one less than they, so that impulses last
# from a driven robot to a wall through as many others; each step takes one, so that none lasts without a driven robot.
DRIVEN = 16


@kernel(from_python=True)
def fill_contacts(contacts, robots, pairs, fixed_pairs, previous):
    """Fill records (pairs + fixed_pairs,) for all listed pairs, with touch and impulses of the `previous` records.

    Args:
        contacts: CONTACT_RECORD, set.
        robots: (rows,) ROBOT_RECORD.
        pairs: (pairs, 2) lower row, higher row.
        fixed_pairs: (fixed_pairs, 3) row, kind and number of a fixed body.
        previous: CONTACT_RECORD in the order of `contacts`.
    """
    at = 0
    for k in range(len(contacts)):
        contact = contacts[k]
        if k < len(pairs):
            contact.row, contact.kind, contact.other = pairs[k, 0], ROBOT, pairs[k, 1]
            first, second = robots[contact.row], robots[contact.other]
            per_kg, turning_per_kg = first.per_kg + second.per_kg, _turning_per_kg(first) + _turning_per_kg(second)
        else:
            i = k - len(pairs)
            contact.row, contact.kind, contact.other = fixed_pairs[i, 0], fixed_pairs[i, 1], fixed_pairs[i, 2]
            per_kg, turning_per_kg = robots[contact.row].per_kg, _turning_per_kg(robots[contact.row])
        contact.normal_kg, contact.tangent_kg = 1.0 / per_kg, 1.0 / (per_kg + turning_per_kg)
        while at < len(previous) and _is_before(previous[at], contact):
            at += 1
        lasts = at < len(previous) and not _is_before(contact, previous[at])
        contact.touch = previous[at].touch if lasts else 0
        contact.normal_ns, contact.tangent_ns = (
            (previous[at].normal_ns, previous[at].tangent_ns) if lasts else (0.0, 0.0)
        )


@kernel()
def _turning_per_kg(robot):
    """Return the share of a robot's turning in the inverse effective mass of its rim along the tangent."""
    return robot.radius_m * robot.radius_m * robot.per_kgm2


@kernel()
def _is_before(first, second):
    """Return True if the first contact sorts first: robots before fixed bodies, then by row, kind and number."""
    if (first.kind == ROBOT) != (second.kind == ROBOT):
        return first.kind == ROBOT
    if first.row != second.row:
        return first.row < second.row
    if first.kind != second.kind:
        return first.kind < second.kind
    return first.other < second.other


def split_by_contact(moving: BoolArray, contacts: AnyArray) -> tuple[IntArray, IntArray]:
    """Return the `moving` (rows,) rows with a contact in `contacts` (k,) CONTACT_RECORD, and those without; rising.

    All rows of the contacts move.
    """
    has_contact = np.zeros(len(moving), np.bool_)
    has_contact[contacts["row"]] = True
    has_contact[contacts["other"][contacts["kind"] == ROBOT]] = True
    return np.flatnonzero(has_contact), np.flatnonzero(moving & ~has_contact)


@kernel()
def find_contacts(near, bodies, fixed, fastest_mps, dt_s):
    """Write the indices of the contacts that may touch in this step to `near.buffer`, in order; return their number.

    Impulses of the last step stay where one of the two robots is driven, or pushed by a driven robot (see DRIVEN).
    `fastest_mps` is the greatest speed of any robot.
    """
    count = 0
    for k in range(len(near.contacts)):
        contact = near.contacts[k]
        robot, state = bodies.robots[contact.row], bodies.state[contact.row]
        ahead_m = LOOK_AHEAD * robot.radius_m
        in_reach, driven = False, robot.driven
        if contact.kind == ROBOT:
            other, other_state = bodies.robots[contact.other], bodies.state[contact.other]
            driven |= other.driven
            ahead_m += LOOK_AHEAD * other.radius_m
            dx, dy = other_state[0] - state[0], other_state[1] - state[1]
            max_m = robot.radius_m + other.radius_m + ahead_m + 2.0 * dt_s * fastest_mps
            if dx * dx + dy * dy <= max_m * max_m:
                gap_m, nx, ny = gap_to_circle(
                    state[0], state[1], robot.radius_m, other_state[0], other_state[1], other.radius_m
                )
                in_reach = gap_m <= ahead_m + dt_s * (_speed_mps(state) + _speed_mps(other_state))
                if contact.normal_ns > 0.0:
                    robot.driven = max(robot.driven, other.driven - 1)
                    other.driven = max(other.driven, robot.driven - 1)
        else:
            gap_m, nx, ny = gap_to_fixed(contact.kind, contact.other, state[0], state[1], robot.radius_m, fixed)
            in_reach = gap_m <= ahead_m + dt_s * _speed_mps(state)
        if in_reach:
            contact.nx, contact.ny, contact.gap_m, contact.closing_mps = nx, ny, gap_m, max(gap_m, 0.0) / dt_s
            near.buffer[count] = k
            count += 1
        if not (in_reach and driven):
            contact.normal_ns = contact.tangent_ns = 0.0
    return count


@kernel()
def _speed_mps(state):
    return np.sqrt(state[3] * state[3] + state[4] * state[4])


@kernel()
def gap_to_wall(wall, x, y, radius_m, half_size_m):
    """Return the gap in m from a disc to a wall, negative if they overlap, and the unit vector towards the wall."""
    if wall == LEFT:
        return half_size_m[0] + x - radius_m, -1.0, 0.0
    if wall == RIGHT:
        return half_size_m[0] - x - radius_m, 1.0, 0.0
    if wall == BOTTOM:
        return half_size_m[1] + y - radius_m, 0.0, -1.0
    return half_size_m[1] - y - radius_m, 0.0, 1.0


@kernel()
def gap_to_circle(x, y, radius_m, circle_x, circle_y, circle_radius_m):
    """Return the gap and the unit vector from a disc to a circle. With equal centres the vector is along x."""
    dx, dy = circle_x - x, circle_y - y
    distance_m = np.sqrt(dx * dx + dy * dy)
    if distance_m == 0.0:
        return -radius_m - circle_radius_m, 1.0, 0.0
    return distance_m - radius_m - circle_radius_m, dx / distance_m, dy / distance_m


@kernel(from_python=True)
def gap_to_polygon(x, y, radius_m, polygon, side_start, side):
    """Return the gap and the unit vector from a disc to a convex polygon, at the point nearest to the disc's centre.

    The point is on the side whose line has the centre farthest outside, or, if the foot of the perpendicular lies
    beyond that side, one of the side's two corners.
    """
    first, end = side_start[polygon], side_start[polygon + 1]
    outside, nearest = -np.inf, first
    for k in range(first, end):
        distance = side[k, 2] * x + side[k, 3] * y - side[k, 4]
        if distance > outside:
            outside, nearest = distance, k
    nx, ny = side[nearest, 2], side[nearest, 3]
    if outside > 0.0:
        after = nearest + 1 if nearest + 1 < end else first
        # The side runs along (-ny, nx), its normal turned left.
        if (y - side[nearest, 1]) * nx - (x - side[nearest, 0]) * ny < 0.0:
            return gap_to_circle(x, y, radius_m, side[nearest, 0], side[nearest, 1], 0.0)
        if (y - side[after, 1]) * nx - (x - side[after, 0]) * ny > 0.0:
            return gap_to_circle(x, y, radius_m, side[after, 0], side[after, 1], 0.0)
    return outside - radius_m, -nx, -ny


@kernel()
def gap_to_fixed(kind, number, x, y, radius_m, fixed):
    """Return the gap and the unit vector from a disc to a fixed body: a circle or polygon by number, or a wall."""
    if kind == CIRCLE:
        return gap_to_circle(x, y, radius_m, fixed.circle[number, 0], fixed.circle[number, 1], fixed.circle[number, 2])
    if kind == POLYGON:
        return gap_to_polygon(x, y, radius_m, number, fixed.side_start, fixed.side)
    return gap_to_wall(kind, x, y, radius_m, fixed.half_size_m)


@kernel()
def begin_tick(contacts, robots, touched):
    """Shift the bits of touch from this tick to the last tick, and clear `touched`."""
    for k in range(len(contacts)):
        contacts[k].touch = BEFORE if contacts[k].touch & NOW else 0
    for row in range(len(robots)):
        robots[row].against_fixed = BEFORE if robots[row].against_fixed & NOW else 0
        touched[row] = 0.0


@kernel()
def mark_touches(contacts, active, bodies, dt_s, per_arena, onsets):
    """Mark the contacts that touch at the end of a step: those with an impulse, or with a gap of at most TOUCH_M.

    Args:
        contacts: listed contacts, whose bits of touch are set.
        active: indices of the contacts that may have touched in the step, after their impulses.
        bodies: velocities after the impulses, positions before the move; `touched` and bits of touch are set.
        dt_s: length of the step.
        per_arena: robots of an arena.
        onsets: (arenas, 2) added to: robot with robot, robot with something fixed.
    """
    robots, state, touched = bodies.robots, bodies.state, bodies.touched
    for k in active:
        contact = contacts[k]
        if contact.normal_ns <= 0.0 and contact.gap_m + dt_s * _parting_mps(contact, state) > TOUCH_M:
            continue
        arena = contact.row // per_arena
        touched[contact.row] = 1.0
        if contact.kind == ROBOT:
            touched[contact.other] = 1.0
            onsets[arena, 0] += contact.touch == 0
            contact.touch |= NOW
        else:
            onsets[arena, 1] += robots[contact.row].against_fixed == 0
            robots[contact.row].against_fixed |= NOW


@kernel()
def _parting_mps(contact, state):
    """Return the speed at which the gap grows."""
    parting = -(state[contact.row, 3] * contact.nx + state[contact.row, 4] * contact.ny)
    if contact.kind == ROBOT:
        parting += state[contact.other, 3] * contact.nx + state[contact.other, 4] * contact.ny
    return parting
