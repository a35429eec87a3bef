"""Impulses at contacts, one contact after the other, several times over (sequential impulses). Compiled.

E. Catto (2005), Iterative dynamics with temporal coherence, and (2006), Fast and simple physics using sequential
impulses, Game Developers Conference. Contacts may be speculative: two things with a gap may approach by that gap within
the step, no more, so that they meet and do not overlap.

Impulses start from nothing in each step. Each of them then lowers (kinetic energy + impulse x allowed closing speed), of
which the second is never negative; so contacts only ever take energy, however far the iterations get. Impulses kept
from the step before (warm starts) would lose that.
"""

# pyright: basic, reportUnknownMemberType=false

from numba import njit

SWEEPS = 10
FRICTION = 0.7 * 0.7  # as in the pymunk engine: the product of both sides' coefficients
STILL_MPS = 1e-9  # a speed that is wrong by less is left, so that sweeps end
SEPARATIONS = 10
STILL_M = 1e-7  # an overlap below is left


@njit(cache=True)
def solve(contacts, count, robots, state):
    """Change the velocities in `state` (rows, 6) so that the first `count` contacts neither close too fast nor slide."""
    for _ in range(SWEEPS):
        still = True
        for k in range(count):
            contact = contacts[k]
            i, j = contact.first, contact.second
            vx, vy, spin = -state[i, 3], -state[i, 4], state[i, 5] * robots[i].radius_m
            if j >= 0:
                vx, vy, spin = vx + state[j, 3], vy + state[j, 4], spin + state[j, 5] * robots[j].radius_m
            excess = -(vx * contact.nx + vy * contact.ny) - contact.closing_mps
            if contact.push_ns == 0.0 and excess <= STILL_MPS:
                continue
            push = max(contact.push_ns + excess * contact.mass_kg, 0.0) if abs(excess) > STILL_MPS else contact.push_ns
            sliding = vy * contact.nx - vx * contact.ny - spin
            bound = FRICTION * push
            rub = min(max(contact.rub_ns - sliding * contact.rubbing_kg, -bound), bound)
            more, across = push - contact.push_ns, rub - contact.rub_ns
            if abs(sliding) <= STILL_MPS and abs(contact.rub_ns) <= bound:
                across = 0.0
            if more == 0.0 and across == 0.0:
                continue
            still = False
            contact.push_ns, contact.rub_ns = push, contact.rub_ns + across
            px, py = more * contact.nx - across * contact.ny, more * contact.ny + across * contact.nx
            _kick(robots[i], state[i], -px, -py, -across)
            if j >= 0:
                _kick(robots[j], state[j], px, py, -across)
        if still:
            break


@njit(cache=True)
def _kick(robot, now, px, py, across):
    now[3] += px * robot.per_kg
    now[4] += py * robot.per_kg
    now[5] += across * robot.radius_m * robot.per_kgm2


@njit(cache=True)
def separate(contacts, count, robots, state, dt_s, shift_m):
    """Shift places in `state` (rows, 6) so that nothing overlaps after the step that follows; velocities stay.

    That undoes overlap and what the impulses left of approach. `shift_m` (rows, 2) is zero before and after.
    """
    for sweep in range(SEPARATIONS):
        apart = True
        for k in range(count):
            contact = contacts[k]
            i, j = contact.first, contact.second
            x, y = -dt_s * state[i, 3] - shift_m[i, 0], -dt_s * state[i, 4] - shift_m[i, 1]
            if j >= 0:
                x, y = x + dt_s * state[j, 3] + shift_m[j, 0], y + dt_s * state[j, 4] + shift_m[j, 1]
            overlap_m = -(contact.gap_m + x * contact.nx + y * contact.ny)
            if overlap_m <= STILL_M:
                continue
            apart = False
            lever = overlap_m * contact.mass_kg
            shift_m[i, 0] -= lever * robots[i].per_kg * contact.nx
            shift_m[i, 1] -= lever * robots[i].per_kg * contact.ny
            if j >= 0:
                shift_m[j, 0] += lever * robots[j].per_kg * contact.nx
                shift_m[j, 1] += lever * robots[j].per_kg * contact.ny
        if apart:
            break
    if sweep == 0:
        return
    for k in range(count):
        _shift(state, shift_m, contacts[k].first)
        if contacts[k].second >= 0:
            _shift(state, shift_m, contacts[k].second)


@njit(cache=True)
def _shift(state, shift_m, row):
    state[row, 0] += shift_m[row, 0]
    state[row, 1] += shift_m[row, 1]
    shift_m[row, 0] = shift_m[row, 1] = 0.0
