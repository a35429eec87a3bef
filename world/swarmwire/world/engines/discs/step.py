"""The physics steps of the discs engine: motors, contact impulses, motion. Compiled.

`advance` runs the steps of a tick for the robots of all arenas. Each step is velocity first, then position
(semi-implicit Euler): motors (`drive`), impulses at contacts (`solve`), overlaps (`separate`), motion (`move`).
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.kernels import kernel
from swarmwire.world.engines.discs.contacts import DRIVEN, LOOK_AHEAD, begin_tick, find_contacts, mark_touches
from swarmwire.world.engines.discs.records import ROBOT

QUARTERS_PER_RAD = 2.0 / np.pi
QUARTER_HIGH, QUARTER_LOW = 1.5707963267341256, 6.077100506506192e-11  # pi / 2; the first has 33 bits

SWEEPS = 10
FRICTION = 0.7 * 0.7  # the product of both sides' coefficients, equal to the pymunk engine's
TOLERANCE_MPS = 1e-9  # a smaller error of a speed is not corrected, so that sweeps end
MASS_SWEEPS = 20
TOLERANCE_M = 1e-7  # a smaller overlap is not corrected
EQUAL_SWEEPS = 40
RESIDUAL_M = 5e-4  # overlap that EQUAL_SWEEPS leave


@kernel(from_python=True)
def sine_cosine(angle_rad):
    """Return the sine and the cosine of an angle up to some 1e6 rad, within 2e-16.

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
def drive(robot, state, target, braked, dt_s):
    """Change the velocity of a robot towards its target by the motors' bounded force, for one step.

    The bounds are those of `engines.pymunk_engine.set_forces`. The target lies along the heading in the middle of
    the next step, so that the path of a turning robot consists of chords of its arc. The motors compensate the change
    of the turn rate by contacts in the last step, so that a robot pushed off its centre keeps its heading as long as
    its torque lasts; a braked robot slows a turn down but does not undo it.

    Args:
        robot: its ROBOT_RECORD.
        state: (6,) its state.
        target: (3,) forward m/s, left turn rad/s, to the left m/s.
        braked: True if its motors only resist.
        dt_s: length of a step.
    """
    if target[0] != 0.0 or target[1] != 0.0 or target[2] != 0.0:
        robot.driven = DRIVEN
    else:
        robot.driven = robot.driven - 1 if 0 < robot.driven < DRIVEN else 0
    turn = state[5]
    lost_turn = 0.0 if braked else robot.unhindered_radps - turn
    turn += min(max(target[1] - turn + lost_turn, -robot.max_step_radps), robot.max_step_radps)
    state[5] = robot.unhindered_radps = turn
    update_direction(robot, state, dt_s)
    cos, sin = robot.cos, robot.sin
    dx, dy = target[0] * cos - target[2] * sin - state[3], target[0] * sin + target[2] * cos - state[4]
    size2 = dx * dx + dy * dy
    if size2 > robot.max_step_mps * robot.max_step_mps:
        share = robot.max_step_mps / np.sqrt(size2)
        dx, dy = dx * share, dy * share
    state[3] += dx
    state[4] += dy


@kernel()
def update_direction(robot, state, dt_s):
    """Set `cos` and `sin` of a robot to those of its heading in the middle of the next step."""
    middle = state[2] + 0.5 * dt_s * state[5]
    if middle != robot.middle_rad:  # saves half of the cost of a step for a robot that drives straight on
        robot.middle_rad = middle
        robot.sin, robot.cos = sine_cosine(middle)


@kernel()
def move(robot, state, travel_m, dt_s):
    """Move a state (6,) by one step of its velocity, and add the travel of its wheels to `travel_m` (2,)."""
    if state[5] != robot.unhindered_radps:
        update_direction(robot, state, dt_s)
    rolled = dt_s * (state[3] * robot.cos + state[4] * robot.sin)
    turned = dt_s * state[5] * robot.half_base_m
    travel_m[0] += rolled - turned
    travel_m[1] += rolled + turned
    state[0] += dt_s * state[3]
    state[1] += dt_s * state[4]
    state[2] += dt_s * state[5]


@kernel()
def follow_targets(rows, steps, dt_s, bodies, target):
    """Move robots without contacts by some steps, one robot after the other."""
    for row in rows:
        robot, state = bodies.robots[row], bodies.state[row]
        for _ in range(steps):
            drive(robot, state, target[row], bodies.braked[row], dt_s)
            move(robot, state, bodies.travel_m[row], dt_s)


@kernel()
def solve(contacts, active, robots, state):
    """Change the velocities in `state` (rows, 6) so that contacts neither close faster than allowed nor slide.

    Impulses act on one contact after the other, in several sweeps (sequential impulses). `active` (k,) holds the
    indices of the contacts that count in this step.

    Contacts may be speculative: two bodies with a gap may approach by that gap within the step, no more, so that they
    meet and do not overlap.

    At driven robots, and at those that they push, impulses start from those of the last step (warm start): a jam takes
    more sweeps than a step has, so its impulses build up over several steps. Elsewhere they start from zero. Then each
    impulse lowers kinetic energy + sum of impulse x allowed closing speed, of which the second is never negative:
    robots that are neither driven nor pushed by driven robots can only lose energy, even if the sweeps do not converge.

    E. Catto (2005), Iterative dynamics with temporal coherence, and (2006), Fast and simple physics using sequential
    impulses, Game Developers Conference.
    """
    for k in active:
        contact = contacts[k]
        if contact.normal_ns > 0.0:
            _apply_impulses(contact, robots, state, contact.normal_ns, contact.tangent_ns)
    for _ in range(SWEEPS):
        converged = True
        for k in active:
            contact = contacts[k]
            i, j = contact.row, contact.other
            vx, vy, spin = -state[i, 3], -state[i, 4], state[i, 5] * robots[i].radius_m
            if contact.kind == ROBOT:
                vx, vy, spin = vx + state[j, 3], vy + state[j, 4], spin + state[j, 5] * robots[j].radius_m
            excess = -(vx * contact.nx + vy * contact.ny) - contact.closing_mps
            if contact.normal_ns == 0.0 and excess <= TOLERANCE_MPS:
                continue
            # For discs, an impulse along the normal changes nothing along the tangent: both are computed at once.
            normal_ns, tangent_ns = _impulses(contact, excess, vy * contact.nx - vx * contact.ny - spin)
            if normal_ns != 0.0 or tangent_ns != 0.0:
                contact.normal_ns += normal_ns
                contact.tangent_ns += tangent_ns
                _apply_impulses(contact, robots, state, normal_ns, tangent_ns)
                converged = False
        if converged:
            break


@kernel()
def _impulses(contact, excess_mps, sliding_mps):
    """Return the changes of a contact's impulses along the normal and along the tangent."""
    normal_ns, tangent_ns = contact.normal_ns, contact.tangent_ns
    if abs(excess_mps) > TOLERANCE_MPS:
        normal_ns = max(normal_ns + excess_mps * contact.normal_kg, 0.0)
    if abs(sliding_mps) > TOLERANCE_MPS:
        tangent_ns -= sliding_mps * contact.tangent_kg
    max_ns = FRICTION * normal_ns
    return normal_ns - contact.normal_ns, min(max(tangent_ns, -max_ns), max_ns) - contact.tangent_ns


@kernel()
def _apply_impulses(contact, robots, state, normal_ns, tangent_ns):
    """Apply impulses to both sides of a contact; the tangent is the normal turned left."""
    px = normal_ns * contact.nx - tangent_ns * contact.ny
    py = normal_ns * contact.ny + tangent_ns * contact.nx
    _apply_impulse(robots[contact.row], state[contact.row], -px, -py, -tangent_ns)
    if contact.kind == ROBOT:
        _apply_impulse(robots[contact.other], state[contact.other], px, py, -tangent_ns)


@kernel()
def _apply_impulse(robot, state, px, py, tangent_ns):
    state[3] += px * robot.per_kg
    state[4] += py * robot.per_kg
    state[5] += tangent_ns * robot.radius_m * robot.per_kgm2


@kernel()
def separate(contacts, active, robots, state, dt_s):
    """Shift positions in `state` (rows, 6) so that nothing overlaps after the following move.

    This removes overlap, and the approach that the impulses left. First the lighter of two robots gives way, and
    velocities stay. That takes more sweeps than a step has where something blocks the lighter robot, such as a wall:
    then `_split_equally` removes the overlap beyond RESIDUAL_M.
    """
    shifted = False
    for sweep in range(MASS_SWEEPS + EQUAL_SWEEPS):
        equally = sweep >= MASS_SWEEPS
        separated = True
        for k in active:
            contact = contacts[k]
            overlap_m = _overlap_m(contact, robots, state, dt_s)
            if overlap_m <= (RESIDUAL_M if equally else TOLERANCE_M):
                continue
            separated = False
            if equally:
                _split_equally(contact, robots, state, overlap_m - RESIDUAL_M, dt_s)
            else:
                _split_by_mass(contact, robots, overlap_m)
        if separated:
            break
        shifted = True
    if shifted:
        for k in active:
            _apply_shift(robots, state, contacts[k].row)
            if contacts[k].kind == ROBOT:
                _apply_shift(robots, state, contacts[k].other)


@kernel()
def _overlap_m(contact, robots, state, dt_s):
    """Return the overlap after the shifts and the move; negative: a gap."""
    i, j = contact.row, contact.other
    x, y = -dt_s * state[i, 3] - robots[i].shift_x_m, -dt_s * state[i, 4] - robots[i].shift_y_m
    if contact.kind == ROBOT:
        x, y = x + dt_s * state[j, 3] + robots[j].shift_x_m, y + dt_s * state[j, 4] + robots[j].shift_y_m
    return -(contact.gap_m + x * contact.nx + y * contact.ny)


@kernel()
def _split_by_mass(contact, robots, overlap_m):
    """Shift both sides apart, the lighter side farther, as an impulse would."""
    first, second = robots[contact.row], robots[contact.other]
    _add_shift(first, -contact.nx, -contact.ny, overlap_m * contact.normal_kg * first.per_kg)
    if contact.kind == ROBOT:
        _add_shift(second, contact.nx, contact.ny, overlap_m * contact.normal_kg * second.per_kg)


@kernel()
def _split_equally(contact, robots, state, overlap_m, dt_s):
    """Set both sides back by the same distance, regardless of mass: few sweeps reach from a wall through a crowd."""
    moves = robots[contact.row].per_kg > 0.0  # followed robots do not give way
    other_moves = contact.kind == ROBOT and robots[contact.other].per_kg > 0.0
    if moves and other_moves:
        overlap_m *= 0.5
    if other_moves:
        _set_back(robots[contact.other], state[contact.other], contact.nx, contact.ny, overlap_m, dt_s)
    if moves:
        _set_back(robots[contact.row], state[contact.row], -contact.nx, -contact.ny, overlap_m, dt_s)


@kernel()
def _set_back(robot, state, nx, ny, shift_m, dt_s):
    """Remove the speed of a robot against (nx, ny), up to that of a shift, and shift it by the remaining distance.

    The robot can only lose energy.
    """
    lost_mps = min(max(-(state[3] * nx + state[4] * ny), 0.0), shift_m / dt_s)
    state[3] += lost_mps * nx
    state[4] += lost_mps * ny
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
    """Return the greatest displacement of robots in this number of steps, plus the look-ahead after them."""
    return (steps + 1) * dt_s * fastest_mps + LOOK_AHEAD * max_radius_m


@kernel(from_python=True)
def advance(step, motion, bodies, target, near, fixed, onsets):
    """Move all robots from a step of the tick on, to its end or until near bodies have to be listed again.

    Args:
        step: the step to begin with.
        motion: the MotionParams of the engine.
        bodies: the DiscBodies, written in place.
        target: (rows, 3) forward m/s, left turn rad/s, to the left m/s.
        near: the listed NearBodies.
        fixed: the walls and obstacles, a Fixed.
        onsets: (arenas, 2) added to: robot with robot, robot with something fixed.

    Returns:
        The next step, and the greatest speed of any robot or target.
    """
    dt_s, steps, max_radius_m = motion.dt_s, motion.steps, motion.max_radius_m
    robots, state, contacts = bodies.robots, bodies.state, near.contacts
    target_mps = _fastest_mps(target)
    displacement_m, fastest_mps = _max_displacement(near.contacting, robots, state, 0.0, target_mps)
    displacement_m, fastest_mps = _max_displacement(near.isolated, robots, state, displacement_m, fastest_mps)
    if displacement_m + needed_margin_m(fastest_mps, max_radius_m, dt_s, steps - step) > near.margin_m:
        return step, fastest_mps
    if step == 0:
        begin_tick(contacts, robots, bodies.touched)
    first = step
    # With `not` and `>` a speed that is not a number ends the tick instead of listing again for ever.
    while step < steps and not displacement_m + needed_margin_m(fastest_mps, max_radius_m, dt_s, 0) > near.margin_m:
        for row in near.contacting:
            drive(robots[row], state[row], target[row], bodies.braked[row], dt_s)
        active = near.buffer[: find_contacts(near, bodies, fixed, fastest_mps, dt_s)]
        solve(contacts, active, robots, state)
        separate(contacts, active, robots, state, dt_s)
        mark_touches(contacts, active, bodies, dt_s, motion.per_arena, onsets)
        for row in near.contacting:
            move(robots[row], state[row], bodies.travel_m[row], dt_s)
        displacement_m, fastest_mps = _max_displacement(near.contacting, robots, state, 0.0, fastest_mps)
        step += 1
    # Only contacts make a robot faster than both its speed and its target, so no isolated robot has left its margin.
    follow_targets(near.isolated, step - first, dt_s, bodies, target)
    return step, fastest_mps


@kernel()
def _fastest_mps(target):
    fastest2 = 0.0
    for row in range(len(target)):
        fastest2 = max(fastest2, target[row, 0] * target[row, 0] + target[row, 2] * target[row, 2])
    return np.sqrt(fastest2)


@kernel()
def _max_displacement(rows, robots, state, displacement_m, fastest_mps):
    """Return the greatest displacement of rows since they were listed and their greatest speed, at least the inputs."""
    displacement2, fastest2 = displacement_m * displacement_m, fastest_mps * fastest_mps
    for row in rows:
        dx, dy = state[row, 0] - robots[row].listed_x_m, state[row, 1] - robots[row].listed_y_m
        displacement2 = max(displacement2, dx * dx + dy * dy)
        fastest2 = max(fastest2, state[row, 3] * state[row, 3] + state[row, 4] * state[row, 4])
    return np.sqrt(displacement2), np.sqrt(fastest2)
