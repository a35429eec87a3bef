"""The physics steps of the discs engine: motors, contact impulses, motion. Compiled.

`advance` runs the steps of a tick for the robots of all arenas. Each step is velocity first, then place (semi-implicit
Euler): motors (`drive`), impulses at contacts (`solve`), overlaps (`separate`), motion (`move`).
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.kernels import kernel
from swarmwire.world.engines.discs.contacts import DRIVEN, LOOK_AHEAD, ROBOT, begin_tick, find_contacts, note_touches

QUARTERS_PER_RAD = 2.0 / np.pi
QUARTER_HIGH, QUARTER_LOW = 1.5707963267341256, 6.077100506506192e-11  # pi / 2; the first has 33 bits

SWEEPS = 10
FRICTION = 0.7 * 0.7  # as in the pymunk engine: the product of both sides' coefficients
TOLERANCE_MPS = 1e-9  # a smaller error of a speed is not corrected, so that sweeps end
SEPARATION_SWEEPS = 20
TOLERANCE_M = 1e-7  # a smaller overlap is not corrected
HOLDING_SWEEPS = 40
HELD_M = 5e-4  # overlap that may remain where robots are held


@kernel(from_python=True)
def sine_cosine(angle_rad):
    """The sine and the cosine of an angle up to some 1e6 rad, within 2e-16.

    It uses + - * alone, so it is equal bit for bit on every machine, and faster than the library. The angle is reduced
    to an eighth of a turn by subtracting quarters (Cody and Waite), where the polynomials are exact to the last bit or
    two: S. Moshier, Cephes mathematical library (1984-2000), sin.c and cos.c.
    """
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


@kernel()
def drive(robot, now, target, braked, dt_s):
    """Change the velocity of a robot towards its target by the motors' bounded force, for one step.

    The bounds are those of `engines.pymunk_engine.apply_impulse`. The target lies along the heading in the middle of
    the step to come, so that the path of a turning robot is made of chords of its arc. The motors compensate the turn
    rate that contacts took in the last step, so that a robot pushed off its centre keeps its heading as long as its
    torque lasts; a braked robot slows a turn down but does not undo it.

    Args:
        robot: its ROBOT.
        now: (6,) its state.
        target: (3,) forward m/s, left turn rad/s, to the left m/s.
        braked: whether its motors only resist.
        dt_s: length of a step.
    """
    if target[0] != 0.0 or target[1] != 0.0 or target[2] != 0.0:
        robot.driven = DRIVEN
    else:
        robot.driven = robot.driven - 1 if 0 < robot.driven < DRIVEN else 0
    turn = now[5]
    lost_turn = 0.0 if braked else robot.unhindered_radps - turn
    turn += min(max(target[1] - turn + lost_turn, -robot.max_step_radps), robot.max_step_radps)
    now[5] = robot.unhindered_radps = turn
    look_along(robot, now, dt_s)
    cos, sin = robot.cos, robot.sin
    dx, dy = target[0] * cos - target[2] * sin - now[3], target[0] * sin + target[2] * cos - now[4]
    size2 = dx * dx + dy * dy
    if size2 > robot.max_step_mps * robot.max_step_mps:
        share = robot.max_step_mps / np.sqrt(size2)
        dx, dy = dx * share, dy * share
    now[3] += dx
    now[4] += dy


@kernel()
def look_along(robot, now, dt_s):
    """Set `cos` and `sin` of a robot to those of its heading in the middle of the step to come."""
    middle = now[2] + 0.5 * dt_s * now[5]
    if middle != robot.middle_rad:  # saves half of the cost of a step for a robot that drives straight on
        robot.middle_rad = middle
        robot.sin, robot.cos = sine_cosine(middle)


@kernel()
def move(robot, now, travel_m, dt_s):
    """Move state (6,) by one step of its velocity, and add the travel of its wheels to travel (2,)."""
    if now[5] != robot.unhindered_radps:
        look_along(robot, now, dt_s)
    rolled = dt_s * (now[3] * robot.cos + now[4] * robot.sin)
    wheel_way = dt_s * now[5] * robot.half_base_m
    travel_m[0] += rolled - wheel_way
    travel_m[1] += rolled + wheel_way
    now[0] += dt_s * now[3]
    now[1] += dt_s * now[4]
    now[2] += dt_s * now[5]


@kernel()
def follow_targets(rows, steps, dt_s, robots, state, target, braked, travel_m):
    """Move robots without contacts by some steps, one robot after the other."""
    for row in rows:
        for _ in range(steps):
            drive(robots[row], state[row], target[row], braked[row], dt_s)
            move(robots[row], state[row], travel_m[row], dt_s)


@kernel()
def solve(contacts, met, robots, state):
    """Change the velocities in `state` (rows, 6) so that contacts neither close faster than allowed nor slide.

    Impulses act on one contact after the other, in several sweeps (sequential impulses). `met` (k,) holds the indices
    of the contacts that count in this step.

    Contacts may be speculative: two things with a gap may approach by that gap within the step, no more, so that they
    meet and do not overlap.

    At robots that are driven, and at those that they push, impulses start from those of the step before (warm start):
    a jam takes more sweeps than a step has, so its impulses build up over several steps. Elsewhere they start from
    zero. Then each impulse lowers kinetic energy + sum of impulse x allowed closing speed, of which the second is never
    negative: robots that are neither driven nor pushed by driven ones can only lose energy, whether or not the sweeps
    converge.

    E. Catto (2005), Iterative dynamics with temporal coherence, and (2006), Fast and simple physics using sequential
    impulses, Game Developers Conference.
    """
    for k in met:
        contact = contacts[k]
        if contact.push_ns > 0.0:
            _apply_impulses(contact, robots, state, contact.push_ns, contact.rub_ns)
    for _ in range(SWEEPS):
        converged = True
        for k in met:
            contact = contacts[k]
            i, j = contact.row, contact.which
            vx, vy, spin = -state[i, 3], -state[i, 4], state[i, 5] * robots[i].radius_m
            if contact.kind == ROBOT:
                vx, vy, spin = vx + state[j, 3], vy + state[j, 4], spin + state[j, 5] * robots[j].radius_m
            excess = -(vx * contact.nx + vy * contact.ny) - contact.closing_mps
            if contact.push_ns == 0.0 and excess <= TOLERANCE_MPS:
                continue
            # For discs, an impulse along the normal changes nothing along the tangent: both are computed at once.
            push, rub = _impulses(contact, excess, vy * contact.nx - vx * contact.ny - spin)
            if push != 0.0 or rub != 0.0:
                contact.push_ns += push
                contact.rub_ns += rub
                _apply_impulses(contact, robots, state, push, rub)
                converged = False
        if converged:
            break


@kernel()
def _impulses(contact, excess_mps, sliding_mps):
    """The changes of a contact's impulses along the normal and along the tangent."""
    push, rub = contact.push_ns, contact.rub_ns
    if abs(excess_mps) > TOLERANCE_MPS:
        push = max(push + excess_mps * contact.mass_kg, 0.0)
    if abs(sliding_mps) > TOLERANCE_MPS:
        rub -= sliding_mps * contact.rubbing_kg
    max_rub = FRICTION * push
    return push - contact.push_ns, min(max(rub, -max_rub), max_rub) - contact.rub_ns


@kernel()
def _apply_impulses(contact, robots, state, push, rub):
    """Apply impulses to both sides of a contact; the tangent is the normal turned left."""
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
    """Shift places in `state` (rows, 6) so that nothing overlaps after the move that follows.

    This removes overlap, and the approach that the impulses left. First the lighter of two robots gives way, and
    velocities stay. That takes more sweeps than a step has where something holds the lighter one, such as a wall: then
    `_hold` removes what is left beyond HELD_M, from both alike.
    """
    shifted = False
    for sweep in range(SEPARATION_SWEEPS + HOLDING_SWEEPS):
        holding = sweep >= SEPARATION_SWEEPS
        separated = True
        for k in met:
            contact = contacts[k]
            overlap_m = _overlap_m(contact, robots, state, dt_s)
            if overlap_m <= (HELD_M if holding else TOLERANCE_M):
                continue
            separated = False
            if holding:
                _hold(contact, robots, state, overlap_m - HELD_M, dt_s)
            else:
                _give_way(contact, robots, overlap_m)
        if separated:
            break
        shifted = True
    if shifted:
        for k in met:
            _apply_shift(robots, state, contacts[k].row)
            if contacts[k].kind == ROBOT:
                _apply_shift(robots, state, contacts[k].which)


@kernel()
def _overlap_m(contact, robots, state, dt_s):
    """The overlap after the shifts and the move; negative: a gap."""
    i, j = contact.row, contact.which
    x, y = -dt_s * state[i, 3] - robots[i].shift_x_m, -dt_s * state[i, 4] - robots[i].shift_y_m
    if contact.kind == ROBOT:
        x, y = x + dt_s * state[j, 3] + robots[j].shift_x_m, y + dt_s * state[j, 4] + robots[j].shift_y_m
    return -(contact.gap_m + x * contact.nx + y * contact.ny)


@kernel()
def _give_way(contact, robots, overlap_m):
    """Shift both sides apart, the lighter one farther, as an impulse would."""
    one, other = robots[contact.row], robots[contact.which]
    _add_shift(one, -contact.nx, -contact.ny, overlap_m * contact.mass_kg * one.per_kg)
    if contact.kind == ROBOT:
        _add_shift(other, contact.nx, contact.ny, overlap_m * contact.mass_kg * other.per_kg)


@kernel()
def _hold(contact, robots, state, overlap_m, dt_s):
    """Set both sides back by as much, however heavy they are, so that few sweeps reach from a wall to all it holds."""
    if contact.kind == ROBOT:
        overlap_m *= 0.5
        _set_back(robots[contact.which], state[contact.which], contact.nx, contact.ny, overlap_m, dt_s)
    _set_back(robots[contact.row], state[contact.row], -contact.nx, -contact.ny, overlap_m, dt_s)


@kernel()
def _set_back(robot, now, nx, ny, shift_m, dt_s):
    """Take the speed against a shift along (nx, ny) from a robot, and shift it by the rest: it can only lose energy."""
    lost_mps = min(max(-(now[3] * nx + now[4] * ny), 0.0), shift_m / dt_s)
    now[3] += lost_mps * nx
    now[4] += lost_mps * ny
    _add_shift(robot, nx, ny, shift_m - dt_s * lost_mps)


@kernel()
def _add_shift(robot, nx, ny, shift_m):
    robot.shift_x_m += shift_m * nx
    robot.shift_y_m += shift_m * ny


@kernel()
def _apply_shift(robots, state, row):
    state[row, 0] += robots[row].shift_x_m
    state[row, 1] += robots[row].shift_y_m
    robots[row].shift_x_m = robots[row].shift_y_m = 0.0


@kernel(from_python=True)
def needed_margin_m(fastest_mps, max_radius_m, dt_s, steps):
    """The greatest displacement of robots in this number of steps, plus the look-ahead after them."""
    return (steps + 1) * dt_s * fastest_mps + LOOK_AHEAD * max_radius_m


@kernel(from_python=True)
def advance(
    step, steps, dt_s, margin_m, max_radius_m, half_size_m, per_arena, robots, state, travel_m, touched, braked, target,
    contacts, met, contacting, isolated, circle, side_start, side, onsets,
):  # fmt: skip
    """Move all robots from this step of the tick on, to its end or until near things have to be listed again.

    Returns:
        The step that was reached, and the greatest speed of any robot or target.
    """
    target_mps = _fastest_mps(target)
    displacement_m, fastest_mps = _max_displacement(contacting, robots, state, 0.0, target_mps)
    displacement_m, fastest_mps = _max_displacement(isolated, robots, state, displacement_m, fastest_mps)
    if displacement_m + needed_margin_m(fastest_mps, max_radius_m, dt_s, steps - step) > margin_m:
        return step, fastest_mps
    if step == 0:
        begin_tick(contacts, robots, touched)
    first = step
    # With `not` and `>` a speed that is not a number ends the tick instead of listing again for ever.
    while step < steps and not displacement_m + needed_margin_m(fastest_mps, max_radius_m, dt_s, 0) > margin_m:
        for row in contacting:
            drive(robots[row], state[row], target[row], braked[row], dt_s)
        count = find_contacts(contacts, met, robots, state, fastest_mps, dt_s, half_size_m, circle, side_start, side)
        now = met[:count]
        solve(contacts, now, robots, state)
        separate(contacts, now, robots, state, dt_s)
        note_touches(contacts, now, robots, state, dt_s, touched, per_arena, onsets)
        for row in contacting:
            move(robots[row], state[row], travel_m[row], dt_s)
        displacement_m, fastest_mps = _max_displacement(contacting, robots, state, 0.0, fastest_mps)
        step += 1
    # Only contacts make a robot faster than both its speed and its target, so no isolated robot has left its margin.
    follow_targets(isolated, step - first, dt_s, robots, state, target, braked, travel_m)
    return step, fastest_mps


@kernel()
def _fastest_mps(target):
    fastest2 = 0.0
    for row in range(len(target)):
        fastest2 = max(fastest2, target[row, 0] * target[row, 0] + target[row, 2] * target[row, 2])
    return np.sqrt(fastest2)


@kernel()
def _max_displacement(rows, robots, state, displacement_m, fastest_mps):
    """The greatest displacement of these rows since they were listed, and their greatest speed; at least the inputs."""
    displacement2, fastest2 = displacement_m * displacement_m, fastest_mps * fastest_mps
    for row in rows:
        dx, dy = state[row, 0] - robots[row].listed_x_m, state[row, 1] - robots[row].listed_y_m
        displacement2 = max(displacement2, dx * dx + dy * dy)
        fastest2 = max(fastest2, state[row, 3] * state[row, 3] + state[row, 4] * state[row, 4])
    return np.sqrt(displacement2), np.sqrt(fastest2)
