"""Sine and cosine at once, by + - * alone: equal bit for bit on every machine, and quicker than the library. Compiled.

The angle is brought to within an eighth of a turn by taking off quarters (Cody and Waite), where polynomials are right
to the last bit or two: S. Moshier, Cephes mathematical library (1984-2000), sin.c and cos.c.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.kernels import kernel
from swarmwire.world.engines.discs.contacts import LOOK_AHEAD, ROBOT, begin_tick, find_contacts, note_touches

QUARTERS_PER_RAD = 2.0 / np.pi
QUARTER_HIGH, QUARTER_LOW = 1.5707963267341256, 6.077100506506192e-11  # pi / 2; the first has 33 bits


@kernel(from_python=True)
def sine_cosine(angle_rad):
    """The sine and the cosine of an angle up to some 1e6 rad, within 2e-16."""
    quarters = np.floor(angle_rad * QUARTERS_PER_RAD + 0.5)
    r = (angle_rad - quarters * QUARTER_HIGH) - quarters * QUARTER_LOW
    z = r * r
    sine = r + r * z * _polynomial(
        z,
        -1.66666666666666307295e-1,
        8.33333333332211858878e-3,
        -1.98412698295895385996e-4,
        2.75573136213857245213e-6,
        -2.50507477628578072866e-8,
        1.58962301576546568060e-10,
    )
    cosine = (
        1.0
        - 0.5 * z
        + z
        * z
        * _polynomial(
            z,
            4.16666666666665929218e-2,
            -1.38888888888730564116e-3,
            2.48015872888517045348e-5,
            -2.75573141792967388112e-7,
            2.08757008419747316778e-9,
            -1.13585365213876817300e-11,
        )
    )
    quarter = int(quarters) & 3
    if quarter & 1:
        sine, cosine = cosine, -sine
    return (-sine, -cosine) if quarter & 2 else (sine, cosine)


@kernel()
def _polynomial(z, a, b, c, d, e, f):
    return a + z * (b + z * (c + z * (d + z * (e + z * f))))


# --- How motors change a robot's velocity in a step, and how it then moves. Compiled.
#
# Velocity first, then place (semi-implicit Euler). What motors can do: see `engines.pymunk_drive`, a bounded change of
# velocity towards the target. The target lies along the heading in the middle of the step to come, so that the path of
# a turning robot is made of chords of its arc.


@kernel()
def drive(robot, now, target, braked, dt_s):
    """Let the motors of a robot push its velocity towards its target for a step.

    What contacts took from the turn rate in the last step is made up for in this one, so that a robot pushed off its
    centre keeps its heading as long as its torque lasts; one that is braked slows a turn down but does not undo it.

    Args:
        robot: its ROBOT.
        now: (6,) its state.
        target: (3,) forward m/s, left turn rad/s, to the left m/s.
        braked: whether its motors only resist.
        dt_s: length of a step.
    """
    robot.driven = target[0] != 0.0 or target[1] != 0.0 or target[2] != 0.0
    turn = now[5]
    taken = 0.0 if braked else robot.unhindered_radps - turn
    turn += min(max(target[1] - turn + taken, -robot.most_radps), robot.most_radps)
    now[5] = robot.unhindered_radps = turn
    look_along(robot, now, dt_s)
    cos, sin = robot.cos, robot.sin
    dx, dy = target[0] * cos - target[2] * sin - now[3], target[0] * sin + target[2] * cos - now[4]
    size2 = dx * dx + dy * dy
    if size2 > robot.most_mps * robot.most_mps:
        share = robot.most_mps / np.sqrt(size2)
        dx, dy = dx * share, dy * share
    now[3] += dx
    now[4] += dy


@kernel()
def look_along(robot, now, dt_s):
    """Set `cos` and `sin` of a robot to those of its heading in the middle of the step to come."""
    middle = now[2] + 0.5 * dt_s * now[5]
    if middle != robot.middle_rad:  # one that drives straight on is spared half of the cost of a step
        robot.middle_rad = middle
        robot.sin, robot.cos = sine_cosine(middle)


@kernel()
def move(robot, now, travel_m, dt_s):
    """Move state (6,) by one step of its velocity and add to travel (2,) what its wheels roll."""
    if now[5] != robot.unhindered_radps:
        look_along(robot, now, dt_s)
    rolled = dt_s * (now[3] * robot.cos + now[4] * robot.sin)
    apart = dt_s * now[5] * robot.half_base_m
    travel_m[0] += rolled - apart
    travel_m[1] += rolled + apart
    now[0] += dt_s * now[3]
    now[1] += dt_s * now[4]
    now[2] += dt_s * now[5]


@kernel()
def follow_targets(rows, steps, dt_s, robots, state, target, braked, travel_m):
    """Move robots that nothing is near by some steps, one robot after the other."""
    for row in rows:
        for _ in range(steps):
            drive(robots[row], state[row], target[row], braked[row], dt_s)
            move(robots[row], state[row], travel_m[row], dt_s)


# --- Impulses at contacts, one contact after the other, several times over (sequential impulses). Compiled.
#
# Contacts may be speculative: two things with a gap may approach by that gap within the step, no more, so that they
# meet and do not overlap.
#
# Where robots are driven, impulses start from those of the step before (warm start): a jam takes more sweeps than there
# are in a step, so its impulses come about over several steps. Elsewhere they start from nothing. Then every one of
# them lowers kinetic energy + sum of impulse x allowed closing speed, of which the second is never negative: what
# nobody drives can only lose energy, however far the sweeps get.
#
# E. Catto (2005), Iterative dynamics with temporal coherence, and (2006), Fast and simple physics using sequential
# impulses, Game Developers Conference.


SWEEPS = 10
FRICTION = 0.7 * 0.7  # as in the pymunk engine: the product of both sides' coefficients
STILL_MPS = 1e-9  # a speed that is wrong by less is left, so that sweeps end
SEPARATIONS = 20
STILL_M = 1e-7  # an overlap below is left


@kernel()
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


@kernel()
def _impulses(contact, excess_mps, sliding_mps):
    """What to add to a contact's impulses along the normal and along the tangent."""
    push, rub = contact.push_ns, contact.rub_ns
    if abs(excess_mps) > STILL_MPS:
        push = max(push + excess_mps * contact.mass_kg, 0.0)
    if abs(sliding_mps) > STILL_MPS:
        rub -= sliding_mps * contact.rubbing_kg
    most = FRICTION * push
    return push - contact.push_ns, min(max(rub, -most), most) - contact.rub_ns


@kernel()
def _kick(contact, robots, state, push, rub):
    """Give impulses to both sides of a contact; the tangent is the normal turned left."""
    px, py = push * contact.nx - rub * contact.ny, push * contact.ny + rub * contact.nx
    _change(robots[contact.row], state[contact.row], -px, -py, -rub)
    if contact.kind == ROBOT:
        _change(robots[contact.which], state[contact.which], px, py, -rub)


@kernel()
def _change(robot, now, px, py, rub):
    now[3] += px * robot.per_kg
    now[4] += py * robot.per_kg
    now[5] += rub * robot.radius_m * robot.per_kgm2


@kernel()
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


@kernel()
def _part(robot, contact, overlap_m):
    share_m = overlap_m * contact.mass_kg * robot.per_kg
    robot.shift_x_m += share_m * contact.nx
    robot.shift_y_m += share_m * contact.ny


@kernel()
def _shift(robots, state, row):
    state[row, 0] += robots[row].shift_x_m
    state[row, 1] += robots[row].shift_y_m
    robots[row].shift_x_m = robots[row].shift_y_m = 0.0


# --- All steps of a tick, for the robots of all arenas. Compiled.


@kernel(from_python=True)
def needed_margin_m(fastest_mps, widest_m, dt_s, steps):
    """How far robots may get in so many steps, and look ahead after them."""
    return (steps + 1) * dt_s * fastest_mps + LOOK_AHEAD * widest_m


@kernel(from_python=True)
def advance(
    step, steps, dt_s, margin_m, widest_m, half_size_m, per_arena, robots, state, travel_m, touched, braked, target,
    contacts, met, crowd, loners, circle, side_start, side, onsets,
):  # fmt: skip
    """Move all robots from this step of the tick on, to its end or until near things have to be listed anew.

    Returns:
        The step that was reached, and the greatest speed that any robot had or was asked for.
    """
    asked_mps = _fastest_mps(target)
    far_m, fastest_mps = _spread(crowd, robots, state, 0.0, asked_mps)
    far_m, fastest_mps = _spread(loners, robots, state, far_m, fastest_mps)
    if far_m + needed_margin_m(fastest_mps, widest_m, dt_s, steps - step) > margin_m:
        return step, fastest_mps
    if step == 0:
        begin_tick(contacts, robots, touched)
    first = step
    # With `not` and `>` a speed that is no number ends the tick instead of asking for new lists for ever.
    while step < steps and not far_m + needed_margin_m(fastest_mps, widest_m, dt_s, 0) > margin_m:
        for row in crowd:
            drive(robots[row], state[row], target[row], braked[row], dt_s)
        count = find_contacts(contacts, met, robots, state, fastest_mps, dt_s, half_size_m, circle, side_start, side)
        now = met[:count]
        solve(contacts, now, robots, state)
        separate(contacts, now, robots, state, dt_s)
        note_touches(contacts, now, robots, state, dt_s, touched, per_arena, onsets)
        for row in crowd:
            move(robots[row], state[row], travel_m[row], dt_s)
        far_m, fastest_mps = _spread(crowd, robots, state, 0.0, fastest_mps)
        step += 1
    # Only contacts make a robot faster than it was and was asked to be, so no loner has left its margin.
    follow_targets(loners, step - first, dt_s, robots, state, target, braked, travel_m)
    return step, fastest_mps


@kernel()
def _fastest_mps(target):
    fastest2 = 0.0
    for row in range(len(target)):
        fastest2 = max(fastest2, target[row, 0] * target[row, 0] + target[row, 2] * target[row, 2])
    return np.sqrt(fastest2)


@kernel()
def _spread(rows, robots, state, far_m, fastest_mps):
    """The greatest distance of these rows from where they were listed, and their greatest speed; no less than given."""
    far2, fastest2 = far_m * far_m, fastest_mps * fastest_mps
    for row in rows:
        dx, dy = state[row, 0] - robots[row].listed_x_m, state[row, 1] - robots[row].listed_y_m
        far2 = max(far2, dx * dx + dy * dy)
        fastest2 = max(fastest2, state[row, 3] * state[row, 3] + state[row, 4] * state[row, 4])
    return np.sqrt(far2), np.sqrt(fastest2)
