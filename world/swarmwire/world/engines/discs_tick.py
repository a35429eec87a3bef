"""All steps of a tick, for the robots of all arenas. Compiled."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.world.engines.discs_contacts import LOOK_AHEAD, begin_tick, find_contacts, note_touches
from swarmwire.world.engines.discs_motion import driven, follow_targets, move
from swarmwire.world.engines.discs_solver import separate, solve


@njit(cache=True)
def needed_margin_m(fastest_mps, widest_m, dt_s, steps):
    """How far robots may get, and look ahead, in the steps of a tick."""
    return (steps + 1) * dt_s * fastest_mps + LOOK_AHEAD * widest_m


@njit(cache=True)
def advance(
    step, steps, dt_s, margin_m, widest_m, half_size_m, per_arena,
    robots, state, travel_m, touched, braked, target, unhindered, middle, shift_m, against_fixed, onsets,
    listed_at, spread, pairs, things, crowd, loners, contacts, circle, side_start, side,
):  # fmt: skip
    """Move all robots from this step of the tick on, up to its end or until the lists of near things have to be renewed.

    Returns:
        The step that was reached. `spread` (2,) is then how far robots are from where they were listed, at most, and
        the fastest speed of any robot, or that is asked of one.
    """
    asked = _fastest(target)
    spread[1] = max(spread[1], asked)
    if spread[0] + needed_margin_m(spread[1], widest_m, dt_s, steps - step) > margin_m:
        return step
    if step == 0:
        begin_tick(pairs, against_fixed, touched)
    spread[0], spread[1] = 0.0, asked
    first = step
    while step < steps and (step == first or spread[0] + needed_margin_m(spread[1], widest_m, dt_s, 0) <= margin_m):
        for row in crowd:
            now = state[row]
            vx, vy, turn, cos, sin = driven(robots[row], target[row], braked[row], dt_s, now, unhindered[row])
            now[3], now[4], now[5], unhindered[row] = vx, vy, turn, turn
            middle[row, 0], middle[row, 1] = cos, sin
        count = find_contacts(robots, state, dt_s, pairs, things, half_size_m, circle, side_start, side, contacts)
        solve(contacts, count, robots, state)
        separate(contacts, count, robots, state, dt_s, shift_m)
        note_touches(contacts, count, pairs, against_fixed, touched, per_arena, onsets)
        for row in crowd:
            now = state[row]
            if now[5] != unhindered[row]:
                ahead = now[2] + 0.5 * dt_s * now[5]
                middle[row, 0], middle[row, 1] = np.cos(ahead), np.sin(ahead)
            move(robots[row], dt_s, now, travel_m[row], middle[row, 0], middle[row, 1])
        _note_spread(crowd, state, listed_at, spread)
        step += 1
    follow_targets(loners, step - first, dt_s, robots, target, braked, state, travel_m, unhindered)
    _note_spread(loners, state, listed_at, spread)
    return step


@njit(cache=True)
def _fastest(target):
    fastest2 = 0.0
    for row in range(len(target)):
        fastest2 = max(fastest2, target[row, 0] * target[row, 0] + target[row, 2] * target[row, 2])
    return np.sqrt(fastest2)


@njit(cache=True)
def _note_spread(rows, state, listed_at, spread):
    """Raise `spread` to the greatest distance of these rows from where they were listed, and their greatest speed."""
    far2, fast2 = spread[0] * spread[0], spread[1] * spread[1]
    for row in rows:
        dx, dy = state[row, 0] - listed_at[row, 0], state[row, 1] - listed_at[row, 1]
        far2 = max(far2, dx * dx + dy * dy)
        fast2 = max(fast2, state[row, 3] * state[row, 3] + state[row, 4] * state[row, 4])
    spread[0], spread[1] = np.sqrt(far2), np.sqrt(fast2)
