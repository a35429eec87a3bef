"""What drives can follow of what agents ask for: each kind of drive clips commands in its own way. Compiled."""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.bodies.drives import DRIVES, wheel_base_of
from swarmwire.comms.truth import Group

WHEELS, TWIST, HOLONOMIC = (list(DRIVES).index(kind) for kind in ("wheels", "twist", "holonomic"))
ROUNDED = 1.0 + 1e-9  # a command that asks for exactly the limit and was rounded is not clipped


class Limits(NamedTuple):
    """How fast each robot index of an arena can go, (robots,) each."""

    kind: IntArray  # WHEELS, TWIST or HOLONOMIC
    half_base_m: FloatArray  # half the distance between the wheels; 0: it has none
    max_linear_mps: FloatArray  # of wheels that of a wheel, of a holonomic drive that of the planar vector
    max_angular_radps: FloatArray


def limits_of(groups: Sequence[Group]) -> Limits:
    """The limits of the groups' drives."""
    columns = [
        (
            list(DRIVES).index(drive.kind),
            0.5 * wheel_base_of(drive),
            drive.max_linear_mps,
            drive.max_angular_radps,
        )
        for drive in (group.body.drive for group in groups)
    ]
    sizes = [group.stop - group.start for group in groups]
    kind, *rest = (np.repeat(np.array(column), sizes) for column in zip(*columns, strict=True))
    return Limits(kind, *rest)


@njit(cache=True)
def take_commands(
    limits: Limits,
    alive: BoolArray,
    rows: IntArray,
    drive: BoolArray,
    linear_mps: FloatArray,
    angular_radps: FloatArray,
    lateral_mps: FloatArray,
    command: FloatArray,
) -> tuple[IntArray, IntArray]:
    """Write what drives can follow of new commands into `command` (rows, 3), which holds the last ones.

    Two wheels shrink both speeds by one factor, so that the curve stays the same; a twist drive cuts each speed to its
    own limit; a holonomic one shrinks the planar vector, so that the direction stays, and cuts the turn. Bodies with
    wheels do not move sideways.

    Args:
        limits: of each robot index.
        alive: (all rows,).
        rows: (n,) robot row of each command.
        drive: (n,) False: no command.
        linear_mps: (n,) forward speed asked for.
        angular_radps: (n,) left turn asked for.
        lateral_mps: (n,) speed to the left asked for.
        command: (all rows, 3) forward m/s, left turn rad/s, to the left m/s.

    Returns:
        How many commands were too fast, and how many were not finite and so dropped, (arenas,) each.
    """
    robots = len(limits.kind)
    arenas = len(command) // robots
    clipped, not_finite = np.zeros(arenas, np.int64), np.zeros(arenas, np.int64)
    for k in range(len(rows)):
        if not drive[k]:
            continue
        row = rows[k]
        linear, angular, lateral = linear_mps[k], angular_radps[k], lateral_mps[k]
        if not (np.isfinite(linear) and np.isfinite(angular) and np.isfinite(lateral)):
            not_finite[row // robots] += 1
            continue
        if not alive[row]:
            continue
        i = row % robots
        linear, angular, lateral, too_fast = _within(limits, i, linear, angular, lateral)
        clipped[row // robots] += too_fast
        command[row, 0], command[row, 1], command[row, 2] = linear, angular, lateral
    return clipped, not_finite


@njit(cache=True)
def _within(limits, i, linear, angular, lateral):
    """What the drive of robot index i can follow of a command, and whether it asked for more."""
    kind, most, most_turn = limits.kind[i], limits.max_linear_mps[i], limits.max_angular_radps[i]
    too_fast = lateral != 0.0 and kind != HOLONOMIC
    if kind != HOLONOMIC:
        lateral = 0.0
    if kind == WHEELS:
        fastest = abs(linear) + abs(angular) * limits.half_base_m[i]
        if fastest > most * ROUNDED:
            return linear * (most / fastest), angular * (most / fastest), lateral, True
        return linear, angular, lateral, too_fast
    size = np.hypot(linear, lateral)
    if size > most * ROUNDED:
        too_fast = True
        linear, lateral = linear * (most / size), lateral * (most / size)
    if abs(angular) > most_turn * ROUNDED:
        too_fast = True
        angular = most_turn if angular > 0.0 else -most_turn
    return linear, angular, lateral, too_fast
