"""Impulses at contacts, one contact after the other, several times over (sequential impulses). Compiled.

E. Catto (2005), Iterative dynamics with temporal coherence, and (2006), Fast and simple physics using sequential
impulses, Game Developers Conference. Contacts may be speculative: two things with a gap may approach by that gap within
the step, no more, so that they meet and do not overlap.

Impulses start from nothing in each step. Each of them then lowers kinetic energy + impulse x allowed closing speed, of
which the second is never negative; so contacts only ever take energy, however far the sweeps get. Impulses kept from
the step before (warm starts) would lose that.
"""

# pyright: basic, reportUnknownMemberType=false

from numba import njit

SWEEPS = 10
FRICTION = 0.7 * 0.7  # as in the pymunk engine: the product of both sides' coefficients
STILL_MPS = 1e-9  # a speed that is wrong by less is left, so that sweeps end
SEPARATIONS = 10
STILL_M = 1e-7  # an overlap below is left


@njit(cache=True)
def solve(contacts, robots, state):
    """Change the velocities in `state` (rows, 6) so that contacts neither close faster than allowed nor slide."""
    for _ in range(SWEEPS):
        still = True
        for k in range(len(contacts)):
            contact = contacts[k]
            i, j = contact.first, contact.second
            vx, vy, spin = -state[i, 3], -state[i, 4], state[i, 5] * robots[i].radius_m
            if j >= 0:
                vx, vy, spin = vx + state[j, 3], vy + state[j, 4], spin + state[j, 5] * robots[j].radius_m
            excess = -(vx * contact.nx + vy * contact.ny) - contact.closing_mps
            if contact.push_ns == 0.0 and excess <= STILL_MPS:
                continue
            # Of discs, what is pushed along the normal changes nothing along the tangent: both are worked out at once.
            more, across = _impulses(contact, excess, vy * contact.nx - vx * contact.ny - spin)
            if more == 0.0 and across == 0.0:
                continue
            still = False
            contact.push_ns += more
            contact.rub_ns += across
            px, py = more * contact.nx - across * contact.ny, more * contact.ny + across * contact.nx
            _kick(robots[i], state[i], -px, -py, -across)
            if j >= 0:
                _kick(robots[j], state[j], px, py, -across)
        if still:
            break


@njit(cache=True)
def _impulses(contact, excess_mps, sliding_mps):
    """What to add to a contact's impulses along the normal and along the tangent."""
    push, rub = contact.push_ns, contact.rub_ns
    if abs(excess_mps) > STILL_MPS:
        push = max(push + excess_mps * contact.mass_kg, 0.0)
    if abs(sliding_mps) > STILL_MPS:
        rub -= sliding_mps * contact.rubbing_kg
    most = FRICTION * push
    return push - contact.push_ns, min(max(rub, -most), most) - contact.rub_ns


@njit(cache=True)
def _kick(robot, now, px, py, across):
    now[3] += px * robot.per_kg
    now[4] += py * robot.per_kg
    now[5] += across * robot.radius_m * robot.per_kgm2


@njit(cache=True)
def separate(contacts, robots, state, dt_s):
    """Shift places in `state` (rows, 6) so that nothing overlaps after the move that follows; velocities stay.

    That undoes overlap, and what the impulses left of approach.
    """
    shifted = False
    for _ in range(SEPARATIONS):
        apart = True
        for k in range(len(contacts)):
            contact = contacts[k]
            i, j = contact.first, contact.second
            x, y = -dt_s * state[i, 3] - robots[i].shift_x_m, -dt_s * state[i, 4] - robots[i].shift_y_m
            if j >= 0:
                x, y = x + dt_s * state[j, 3] + robots[j].shift_x_m, y + dt_s * state[j, 4] + robots[j].shift_y_m
            overlap_m = -(contact.gap_m + x * contact.nx + y * contact.ny)
            if overlap_m > STILL_M:
                apart = False
                _part(robots[i], contact, -overlap_m)
                if j >= 0:
                    _part(robots[j], contact, overlap_m)
        if apart:
            break
        shifted = True
    if shifted:
        _shift(contacts, robots, state)


@njit(cache=True)
def _part(robot, contact, overlap_m):
    share_m = overlap_m * contact.mass_kg * robot.per_kg
    robot.shift_x_m += share_m * contact.nx
    robot.shift_y_m += share_m * contact.ny


@njit(cache=True)
def _shift(contacts, robots, state):
    for k in range(len(contacts)):
        for row in (contacts[k].first, contacts[k].second):
            if row >= 0:
                state[row, 0] += robots[row].shift_x_m
                state[row, 1] += robots[row].shift_y_m
                robots[row].shift_x_m = robots[row].shift_y_m = 0.0
