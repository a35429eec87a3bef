"""All steps of a tick, for the robots of all arenas. Compiled."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.world.engines.discs_contacts import LOOK_AHEAD, begin_tick, find_contacts, note_touches
from swarmwire.world.engines.discs_motion import drive, follow_targets, move
from swarmwire.world.engines.discs_solver import separate, solve


@njit(cache=True)
def needed_margin_m(fastest_mps, widest_m, dt_s, steps):
    """How far robots may get in so many steps, and look ahead after them."""
    return (steps + 1) * dt_s * fastest_mps + LOOK_AHEAD * widest_m


@njit(cache=True)
def advance(
    step, steps, dt_s, margin_m, widest_m, half_size_m, per_arena, robots, state, travel_m, touched, braked, target,
    spread, pairs, things, crowd, loners, contacts, circle, side_start, side, onsets,
):  # fmt: skip
    """Move all robots from this step of the tick on, to its end or until near things have to be listed anew.

    Returns:
        The step that was reached. `spread` (2,) then tells how far any robot is from where it was listed, and the
        greatest speed that one has or that is asked of one.
    """
    asked_mps = _fastest_mps(target)
    spread[1] = max(spread[1], asked_mps)
    if spread[0] + needed_margin_m(spread[1], widest_m, dt_s, steps - step) > margin_m:
        return step
    if step == 0:
        begin_tick(robots, pairs, touched)
    first = step
    spread[0], spread[1] = 0.0, asked_mps
    # Only contacts make robots faster than they were and were asked to be: loners cannot leave their margins.
    while step < steps and spread[0] + needed_margin_m(spread[1], widest_m, dt_s, 0) <= margin_m:
        for row in crowd:
            drive(robots[row], state[row], target[row], braked[row], dt_s)
        count = find_contacts(robots, state, dt_s, pairs, things, half_size_m, circle, side_start, side, contacts)
        met = contacts[:count]
        solve(met, robots, state)
        separate(met, robots, state, dt_s)
        note_touches(met, robots, pairs, touched, per_arena, onsets)
        for row in crowd:
            move(robots[row], state[row], travel_m[row], dt_s)
        _note_spread(crowd, robots, state, spread)
        step += 1
    follow_targets(loners, step - first, dt_s, robots, state, target, braked, travel_m)
    _note_spread(loners, robots, state, spread)
    return step


@njit(cache=True)
def _fastest_mps(target):
    fastest2 = 0.0
    for row in range(len(target)):
        fastest2 = max(fastest2, target[row, 0] * target[row, 0] + target[row, 2] * target[row, 2])
    return np.sqrt(fastest2)


@njit(cache=True)
def _note_spread(rows, robots, state, spread):
    """Raise `spread` to the greatest distance of these rows from where they were listed, and their greatest speed."""
    far2, fast2 = spread[0] * spread[0], spread[1] * spread[1]
    for row in rows:
        dx, dy = state[row, 0] - robots[row].listed_x_m, state[row, 1] - robots[row].listed_y_m
        far2 = max(far2, dx * dx + dy * dy)
        fast2 = max(fast2, state[row, 3] * state[row, 3] + state[row, 4] * state[row, 4])
    spread[0], spread[1] = np.sqrt(far2), np.sqrt(fast2)
