"""Impulses at contacts, one contact after the other, several times over (sequential impulses). Compiled.

Contacts may be speculative: two things with a gap may approach by that gap within the step, no more, so that they meet
and do not overlap.

Where robots are driven, impulses start from those of the step before (warm start): a jam takes more sweeps than there
are in a step, so its impulses come about over several steps. Elsewhere they start from nothing. Then every one of them
lowers kinetic energy + sum of impulse x allowed closing speed, of which the second is never negative: what nobody
drives can only lose energy, however far the sweeps get.

E. Catto (2005), Iterative dynamics with temporal coherence, and (2006), Fast and simple physics using sequential
impulses, Game Developers Conference.
"""

# pyright: basic, reportUnknownMemberType=false

from swarmwire.comms.kernels import borrowing
from swarmwire.world.engines.discs.fixed import ROBOT

SWEEPS = 10
FRICTION = 0.7 * 0.7  # as in the pymunk engine: the product of both sides' coefficients
STILL_MPS = 1e-9  # a speed that is wrong by less is left, so that sweeps end
SEPARATIONS = 20
STILL_M = 1e-7  # an overlap below is left


@borrowing()
def solve(contacts, met, robots, state):
    """Change the velocities in `state` (rows, 6) so that contacts neither close faster than allowed nor slide.

    `met` are the places of the contacts that count in this step.
    """
    for k in met:
        contact = contacts[k]
        if contact.push_ns > 0.0:
            _kick(contact, robots, state, contact.push_ns, contact.rub_ns)
    for _ in range(SWEEPS):
        still = True
        for k in met:
            contact = contacts[k]
            i, j = contact.row, contact.which
            vx, vy, spin = -state[i, 3], -state[i, 4], state[i, 5] * robots[i].radius_m
            if contact.kind == ROBOT:
                vx, vy, spin = vx + state[j, 3], vy + state[j, 4], spin + state[j, 5] * robots[j].radius_m
            excess = -(vx * contact.nx + vy * contact.ny) - contact.closing_mps
            if contact.push_ns == 0.0 and excess <= STILL_MPS:
                continue
            # Of discs, what is pushed along the normal changes nothing along the tangent: both are worked out at once.
            push, rub = _impulses(contact, excess, vy * contact.nx - vx * contact.ny - spin)
            if push != 0.0 or rub != 0.0:
                contact.push_ns += push
                contact.rub_ns += rub
                _kick(contact, robots, state, push, rub)
                still = False
        if still:
            break


@borrowing()
def _impulses(contact, excess_mps, sliding_mps):
    """What to add to a contact's impulses along the normal and along the tangent."""
    push, rub = contact.push_ns, contact.rub_ns
    if abs(excess_mps) > STILL_MPS:
        push = max(push + excess_mps * contact.mass_kg, 0.0)
    if abs(sliding_mps) > STILL_MPS:
        rub -= sliding_mps * contact.rubbing_kg
    most = FRICTION * push
    return push - contact.push_ns, min(max(rub, -most), most) - contact.rub_ns


@borrowing()
def _kick(contact, robots, state, push, rub):
    """Give impulses to both sides of a contact; the tangent is the normal turned left."""
    px, py = push * contact.nx - rub * contact.ny, push * contact.ny + rub * contact.nx
    _change(robots[contact.row], state[contact.row], -px, -py, -rub)
    if contact.kind == ROBOT:
        _change(robots[contact.which], state[contact.which], px, py, -rub)


@borrowing()
def _change(robot, now, px, py, rub):
    now[3] += px * robot.per_kg
    now[4] += py * robot.per_kg
    now[5] += rub * robot.radius_m * robot.per_kgm2


@borrowing()
def separate(contacts, met, robots, state, dt_s):
    """Shift places in `state` (rows, 6) so that nothing overlaps after the move that follows; velocities stay.

    That undoes overlap, and what the impulses left of approach.
    """
    shifted = False
    for _ in range(SEPARATIONS):
        apart = True
        for k in met:
            contact = contacts[k]
            i, j = contact.row, contact.which
            x, y = -dt_s * state[i, 3] - robots[i].shift_x_m, -dt_s * state[i, 4] - robots[i].shift_y_m
            if contact.kind == ROBOT:
                x, y = x + dt_s * state[j, 3] + robots[j].shift_x_m, y + dt_s * state[j, 4] + robots[j].shift_y_m
            overlap_m = -(contact.gap_m + x * contact.nx + y * contact.ny)
            if overlap_m > STILL_M:
                apart = False
                _part(robots[i], contact, -overlap_m)
                if contact.kind == ROBOT:
                    _part(robots[j], contact, overlap_m)
        if apart:
            break
        shifted = True
    if shifted:
        for k in met:
            _shift(robots, state, contacts[k].row)
            if contacts[k].kind == ROBOT:
                _shift(robots, state, contacts[k].which)


@borrowing()
def _part(robot, contact, overlap_m):
    share_m = overlap_m * contact.mass_kg * robot.per_kg
    robot.shift_x_m += share_m * contact.nx
    robot.shift_y_m += share_m * contact.ny


@borrowing()
def _shift(robots, state, row):
    state[row, 0] += robots[row].shift_x_m
    state[row, 1] += robots[row].shift_y_m
    robots[row].shift_x_m = robots[row].shift_y_m = 0.0
