"""All steps of a tick, for the robots of all arenas. Compiled."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.air.signal.borrowing import borrowing
from swarmwire.world.engines.discs_contacts import LOOK_AHEAD, find_contacts
from swarmwire.world.engines.discs_motion import drive, follow_targets, move
from swarmwire.world.engines.discs_solver import separate, solve
from swarmwire.world.engines.discs_touches import begin_tick, note_touches


@borrowing()
def needed_margin_m(fastest_mps, widest_m, dt_s, steps):
    """How far robots may get in so many steps, and look ahead after them."""
    return (steps + 1) * dt_s * fastest_mps + LOOK_AHEAD * widest_m


@borrowing()
def advance(
    step, steps, dt_s, margin_m, widest_m, half_size_m, per_arena, robots, state, travel_m, touched, braked, target,
    spread, contacts, met, crowd, loners, circle, side_start, side, onsets,
):  # fmt: skip
    """Move all robots from this step of the tick on, to its end or until near things have to be listed anew.

    Returns:
        The step that was reached. `spread` (2,) then tells how far any robot is from where it was listed, and the
        greatest speed of any.
    """
    fastest_mps = max(spread[1], _fastest_mps(target))
    if spread[0] + needed_margin_m(fastest_mps, widest_m, dt_s, steps - step) > margin_m:
        spread[1] = fastest_mps
        return step
    if step == 0:
        begin_tick(contacts, robots, touched)
    first = step
    while step < steps and spread[0] + needed_margin_m(fastest_mps, widest_m, dt_s, 0) <= margin_m:
        for row in crowd:
            drive(robots[row], state[row], target[row], braked[row], dt_s)
        count = find_contacts(contacts, met, robots, state, fastest_mps, dt_s, half_size_m, circle, side_start, side)
        now = met[:count]
        solve(contacts, now, robots, state)
        separate(contacts, now, robots, state, dt_s)
        note_touches(contacts, now, robots, state, dt_s, touched, per_arena, onsets)
        for row in crowd:
            move(robots[row], state[row], travel_m[row], dt_s)
        spread[0] = spread[1] = 0.0
        _note_spread(crowd, robots, state, spread)
        fastest_mps = max(fastest_mps, spread[1])
        step += 1
    # Only contacts make a robot faster than it was and was asked to be, so no loner has left its margin.
    follow_targets(loners, step - first, dt_s, robots, state, target, braked, travel_m)
    _note_spread(loners, robots, state, spread)
    return step


@borrowing()
def _fastest_mps(target):
    fastest2 = 0.0
    for row in range(len(target)):
        fastest2 = max(fastest2, target[row, 0] * target[row, 0] + target[row, 2] * target[row, 2])
    return np.sqrt(fastest2)


@borrowing()
def _note_spread(rows, robots, state, spread):
    """Raise `spread` to the greatest distance of these rows from where they were listed, and their greatest speed."""
    far2, fast2 = spread[0] * spread[0], spread[1] * spread[1]
    for row in rows:
        dx, dy = state[row, 0] - robots[row].listed_x_m, state[row, 1] - robots[row].listed_y_m
        far2 = max(far2, dx * dx + dy * dy)
        fast2 = max(fast2, state[row, 3] * state[row, 3] + state[row, 4] * state[row, 4])
    spread[0], spread[1] = np.sqrt(far2), np.sqrt(fast2)
