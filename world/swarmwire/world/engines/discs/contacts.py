"""Contacts of the discs engine: records of listed pairs, gaps, and the count of contacts that begin. Compiled.

A contact is a record for a pair of things that are listed as near; it lasts as long as the pair is listed. All fixed
things count as one thing in the count of contacts: a contact begins if a pair touches in this tick and did not in the
one before.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, IntArray
from swarmwire.comms.base.kernels import kernel, njit

# Contacts are sought within the distance that a robot's speed covers in a step, plus this share of its radius, since
# others may push it.
LOOK_AHEAD = 0.05
TOUCH_M = 1e-4  # a gap up to this counts as touch, so that lasting contacts do not flicker
# `driven` of a robot whose target is not zero. A robot that others push has one less than they, so that impulses last
# from a driven robot to a wall through as many others; each step takes one, so that none lasts without a driven robot.
DRIVEN = 16
BEFORE, NOW = 1, 2  # bits of touch: in the tick before, in this one
ROBOT, LEFT, RIGHT, BOTTOM, TOP, CIRCLE, POLYGON = range(7)  # kinds of things that a disc may meet

CONTACT = np.dtype(
    [
        ("row", np.int64),
        ("kind", np.int64),  # of the other thing: ROBOT, a wall, CIRCLE or POLYGON
        ("which", np.int64),  # its row, or its number among its kind
        ("touch", np.int64),  # bits; robots alone
        ("nx", np.float64),  # unit vector towards the other thing
        ("ny", np.float64),
        ("gap_m", np.float64),  # negative: they overlap
        ("closing_mps", np.float64),  # the greatest speed that leaves no overlap after the step
        ("mass_kg", np.float64),  # effective mass along the normal
        ("rubbing_kg", np.float64),  # and along the tangent
        ("push_ns", np.float64),  # impulses of the last step: along the normal
        ("rub_ns", np.float64),  # and along the tangent
    ]
)


@kernel(from_python=True)
def contacts_of(contacts, robots, pairs, things, old):
    """Fill records (pairs + things,) for all listed pairs; touch and impulses are carried over from the `old` ones."""
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
        is_old = at < len(old) and not _is_before(contact, old[at])
        contact.touch = old[at].touch if is_old else 0
        contact.push_ns, contact.rub_ns = (old[at].push_ns, old[at].rub_ns) if is_old else (0.0, 0.0)


@kernel()
def _turning_per_kg(robot):
    """The share of a robot's turning in the inverse effective mass of its rim along the tangent."""
    return robot.radius_m * robot.radius_m * robot.per_kgm2


@kernel()
def _is_before(one, other):
    """Whether a contact is before another one in order: robots before fixed things, then by row, kind and number."""
    if (one.kind == ROBOT) != (other.kind == ROBOT):
        return one.kind == ROBOT
    if one.row != other.row:
        return one.row < other.row
    if one.kind != other.kind:
        return one.kind < other.kind
    return one.which < other.which


@njit()
def contact_islands(moving: BoolArray, contacts: AnyArray) -> tuple[IntArray, IntArray]:
    """The rows with a listed contact in `contacts` (k,) of dtype CONTACT, and the rows without; both rising.

    Only rows that are `moving` (rows,), as all listed rows are.
    """
    has_contact = np.zeros(len(moving), np.bool_)
    for k in range(len(contacts)):
        has_contact[contacts[k].row] = True
        if contacts[k].kind == ROBOT:
            has_contact[contacts[k].which] = True
    return np.flatnonzero(has_contact), np.flatnonzero(moving & ~has_contact)


@kernel()
def find_contacts(contacts, met, robots, state, fastest_mps, dt_s, half_size_m, circle, side_start, side):
    """Put the indices of the contacts that may meet in this step into `met`, in order; returns their number.

    Impulses of the step before are kept where one of the two robots is driven, or pushed by a driven one (see DRIVEN).
    `fastest_mps` is the greatest speed of any robot.
    """
    count = 0
    for k in range(len(contacts)):
        contact = contacts[k]
        one, here = robots[contact.row], state[contact.row]
        ahead_m = LOOK_AHEAD * one.radius_m
        in_reach, driven = False, one.driven
        if contact.kind == ROBOT:
            other, there = robots[contact.which], state[contact.which]
            driven |= other.driven
            ahead_m += LOOK_AHEAD * other.radius_m
            dx, dy = there[0] - here[0], there[1] - here[1]
            max_m = one.radius_m + other.radius_m + ahead_m + 2.0 * dt_s * fastest_mps
            if dx * dx + dy * dy <= max_m * max_m:
                gap_m, nx, ny = gap_to_circle(here[0], here[1], one.radius_m, there[0], there[1], other.radius_m)
                in_reach = gap_m <= ahead_m + dt_s * (_speed_mps(here) + _speed_mps(there))
                if contact.push_ns > 0.0:
                    one.driven = max(one.driven, other.driven - 1)
                    other.driven = max(other.driven, one.driven - 1)
        else:
            gap_m, nx, ny = gap_to_fixed(
                contact.kind, contact.which, here[0], here[1], one.radius_m, half_size_m, circle, side_start, side
            )
            in_reach = gap_m <= ahead_m + dt_s * _speed_mps(here)
        if in_reach:
            contact.nx, contact.ny, contact.gap_m, contact.closing_mps = nx, ny, gap_m, max(gap_m, 0.0) / dt_s
            met[count] = k
            count += 1
        if not (in_reach and driven):
            contact.push_ns = contact.rub_ns = 0.0
    return count


@kernel()
def _speed_mps(now):
    return np.sqrt(now[3] * now[3] + now[4] * now[4])


@kernel()
def gap_to_wall(wall, x, y, radius_m, half_size_m):
    """Gap in m from a disc to a wall of the arena, negative if they overlap, and the unit vector towards the wall."""
    if wall == LEFT:
        return half_size_m[0] + x - radius_m, -1.0, 0.0
    if wall == RIGHT:
        return half_size_m[0] - x - radius_m, 1.0, 0.0
    if wall == BOTTOM:
        return half_size_m[1] + y - radius_m, 0.0, -1.0
    return half_size_m[1] - y - radius_m, 0.0, 1.0


@kernel()
def gap_to_circle(x, y, radius_m, circle_x, circle_y, circle_radius_m):
    """As `gap_to_wall`, to a circle. With equal centres the normal is along x."""
    dx, dy = circle_x - x, circle_y - y
    distance_m = np.sqrt(dx * dx + dy * dy)
    if distance_m == 0.0:
        return -radius_m - circle_radius_m, 1.0, 0.0
    return distance_m - radius_m - circle_radius_m, dx / distance_m, dy / distance_m


@kernel(from_python=True)
def gap_to_polygon(x, y, radius_m, polygon, side_start, side):
    """As `gap_to_wall`, to the side or corner of a convex polygon that is nearest to the disc's centre.

    That is on the side whose line has the centre farthest outside, or, where its foot lies beyond that side, one of
    the side's two corners.
    """
    first, end = side_start[polygon], side_start[polygon + 1]
    outside, nearest = -np.inf, first
    for k in range(first, end):
        here = side[k, 2] * x + side[k, 3] * y - side[k, 4]
        if here > outside:
            outside, nearest = here, k
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
def gap_to_fixed(kind, which, x, y, radius_m, half_size_m, circle, side_start, side):
    """As `gap_to_wall`, to any fixed thing: circle or polygon number `which`, or a wall."""
    if kind == CIRCLE:
        return gap_to_circle(x, y, radius_m, circle[which, 0], circle[which, 1], circle[which, 2])
    if kind == POLYGON:
        return gap_to_polygon(x, y, radius_m, which, side_start, side)
    return gap_to_wall(kind, x, y, radius_m, half_size_m)


@kernel()
def begin_tick(contacts, robots, touched):
    """Shift the bits of touch from this tick to the tick before, and clear `touched`."""
    for k in range(len(contacts)):
        contacts[k].touch = BEFORE if contacts[k].touch & NOW else 0
    for row in range(len(robots)):
        robots[row].against_fixed = BEFORE if robots[row].against_fixed & NOW else 0
        touched[row] = 0.0


@kernel()
def note_touches(contacts, met, robots, state, dt_s, touched, per_arena, onsets):
    """Mark the contacts that touch at the end of a step: those with an impulse, or with a gap of at most TOUCH_M.

    Args:
        contacts: listed, whose bits of touch are set.
        met: indices of the contacts that may have met in the step, after their impulses.
        robots: (rows,) whose bits of touching anything fixed are set.
        state: (rows, 6) after the impulses, before the move.
        dt_s: length of the step.
        touched: (rows,) set to 1 for robots that touch.
        per_arena: robots of an arena.
        onsets: (arenas, 2) added to: robot with robot, robot with something fixed.
    """
    for k in met:
        contact = contacts[k]
        if contact.push_ns <= 0.0 and contact.gap_m + dt_s * _parting_mps(contact, state) > TOUCH_M:
            continue
        arena = contact.row // per_arena
        touched[contact.row] = 1.0
        if contact.kind == ROBOT:
            touched[contact.which] = 1.0
            onsets[arena, 0] += contact.touch == 0
            contact.touch |= NOW
        else:
            onsets[arena, 1] += robots[contact.row].against_fixed == 0
            robots[contact.row].against_fixed |= NOW


@kernel()
def _parting_mps(contact, state):
    """The speed at which the gap grows."""
    parting = -(state[contact.row, 3] * contact.nx + state[contact.row, 4] * contact.ny)
    if contact.kind == ROBOT:
        parting += state[contact.which, 3] * contact.nx + state[contact.which, 4] * contact.ny
    return parting
