"""All steps of a tick, for the robots of all arenas. Compiled."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.kernels import borrowing
from swarmwire.world.engines.discs.contacts import LOOK_AHEAD, find_contacts
from swarmwire.world.engines.discs.motion import drive, follow_targets, move
from swarmwire.world.engines.discs.solver import separate, solve
from swarmwire.world.engines.discs.touches import begin_tick, note_touches


@borrowing(from_python=True)
def needed_margin_m(fastest_mps, widest_m, dt_s, steps):
    """How far robots may get in so many steps, and look ahead after them."""
    return (steps + 1) * dt_s * fastest_mps + LOOK_AHEAD * widest_m


@borrowing(from_python=True)
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


@borrowing()
def _fastest_mps(target):
    fastest2 = 0.0
    for row in range(len(target)):
        fastest2 = max(fastest2, target[row, 0] * target[row, 0] + target[row, 2] * target[row, 2])
    return np.sqrt(fastest2)


@borrowing()
def _spread(rows, robots, state, far_m, fastest_mps):
    """The greatest distance of these rows from where they were listed, and their greatest speed; no less than given."""
    far2, fastest2 = far_m * far_m, fastest_mps * fastest_mps
    for row in rows:
        dx, dy = state[row, 0] - robots[row].listed_x_m, state[row, 1] - robots[row].listed_y_m
        far2 = max(far2, dx * dx + dy * dy)
        fastest2 = max(fastest2, state[row, 3] * state[row, 3] + state[row, 4] * state[row, 4])
    return np.sqrt(far2), np.sqrt(fastest2)
