"""Which discs overlap: pairs of robots of all arenas, found by cells. Compiled."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.geometry.robot_index import cell_of
from swarmwire.world.engines.held_back import shortest


@njit(cache=True)
def overlaps(state, radius_m, bottom_m, top_m, held, running, around):
    """Rising codes, as `count_began` has them, of robots that overlap, and of those that are held back.

    Args:
        state: (arenas, n, 6) x, y first.
        radius_m: (n,).
        bottom_m: (n,) height of the lower side; robots above one another do not overlap.
        top_m: (n,) of the upper side.
        held: (arenas, n) held back by something fixed.
        running: (arenas,) others are left out.
        around: the arena's extents, and whether it wraps.
    """
    arenas, n = held.shape
    bodies, widest_m = n + 1, 2.0 * radius_m.max()
    most = 2 * int(np.ceil(np.sqrt(n)))  # cells along a side: some four for each robot
    nx = min(max(int(2.0 * around.half_x_m / widest_m), 1), most)
    ny = min(max(int(2.0 * around.half_y_m / widest_m), 1), most)
    cell_x, cell_y = 2.0 * around.half_x_m / nx, 2.0 * around.half_y_m / ny
    head, follow = np.empty((ny, nx), np.int64), np.empty(n, np.int64)
    codes, found = np.empty(arenas * n, np.int64), 0
    for arena in range(arenas):
        if not running[arena]:
            continue
        head[:] = -1
        for i in range(n):
            x, y = state[arena, i, 0], state[arena, i, 1]
            column = cell_of(x, -around.half_x_m, cell_x, nx)
            row = cell_of(y, -around.half_y_m, cell_y, ny)
            for v in range(_first(row, ny, around.wraps), _last(row, ny, around.wraps) + 1):
                for u in range(_first(column, nx, around.wraps), _last(column, nx, around.wraps) + 1):
                    j = head[_round(v, ny), _round(u, nx)]
                    while j >= 0:
                        dx = shortest(x - state[arena, j, 0], around.half_x_m, around.wraps)
                        dy = shortest(y - state[arena, j, 1], around.half_y_m, around.wraps)
                        apart = radius_m[i] + radius_m[j]
                        level = bottom_m[i] < top_m[j] and bottom_m[j] < top_m[i]
                        if level and dx * dx + dy * dy < apart * apart:
                            codes = _room_for(codes, found)
                            codes[found] = (arena * bodies + j) * bodies + i
                            found += 1
                        j = follow[j]
            follow[i], head[row, column] = head[row, column], i
            if held[arena, i]:
                codes = _room_for(codes, found)
                codes[found] = (arena * bodies + i) * bodies + n
                found += 1
    codes = codes[:found].copy()
    codes.sort()
    return codes


@njit(cache=True)
def _round(cell, cells):
    """The cell itself, of one counted on beyond the border."""
    return cell + cells if cell < 0 else cell - cells if cell >= cells else cell


@njit(cache=True)
def _first(cell, cells, wraps):
    """The first of the cells around one along an axis; on a torus they may be counted on beyond the border."""
    if wraps:
        return cell - 1 if cells > 2 else cell
    return max(cell - 1, 0)


@njit(cache=True)
def _last(cell, cells, wraps):
    """The last of them; none comes twice."""
    if wraps:
        return cell + 1 if cells > 1 else cell
    return min(cell + 1, cells - 1)


@njit(cache=True)
def _room_for(codes, found):
    """The codes with room for one more."""
    if found < len(codes):
        return codes
    wider = np.empty(2 * len(codes), np.int64)
    wider[:found] = codes
    return wider
