"""Which things a robot may touch soon (Verlet lists): listed with a margin, and anew once a robot has moved that far.

What moves does not depend on the margin: contacts are found among the listed things by what is near at the time, in an
order that the lists keep: pairs by the lower and then by the higher row, fixed things by row.

L. Verlet (1967), Computer "experiments" on classical fluids, Phys. Rev. 159, 98.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.grid import cell_of
from swarmwire.world.engines.discs_fixed import BOTTOM, CIRCLE, LEFT, POLYGON, RIGHT, TOP, gap_to_fixed, gap_to_wall

BEFORE, NOW = 1, 2  # bits of a pair's third column: it touched in the tick before, it touched in this one


@njit(cache=True)
def list_pairs(robots, state, grid, arenas, margin_m, old):
    """Pairs of robots with a gap of up to twice the margin, (pairs, 3): lower row, higher row, bits of touch.

    The bits come from the list `old`, which is in the same order.
    """
    rows = len(state)
    per_arena = rows // arenas
    pairs = np.empty((2 * rows + 16, 3), np.int64)
    count = at = 0
    for row in range(rows):
        x, y, reach = state[row, 0], state[row, 1], robots[row].radius_m + 2.0 * margin_m
        i = cell_of(x, grid.left_m, grid.cell_m, grid.nx)
        j = cell_of(y, grid.bottom_m, grid.cell_m, grid.ny)
        begin = count
        for beside in range(max(j - 1, 0), min(j + 2, grid.ny)):
            c = ((row // per_arena) * grid.ny + beside) * grid.nx
            for k in range(grid.start[c + max(i - 1, 0)], grid.start[c + min(i + 2, grid.nx)]):
                other = grid.order[k]
                if other <= row:
                    continue
                dx, dy, most = state[other, 0] - x, state[other, 1] - y, reach + robots[other].radius_m
                if dx * dx + dy * dy > most * most:
                    continue
                if count == len(pairs):
                    pairs = np.concatenate((pairs, np.empty_like(pairs)))
                place = count
                while place > begin and pairs[place - 1, 1] > other:
                    pairs[place] = pairs[place - 1]
                    place -= 1
                pairs[place, 0], pairs[place, 1], pairs[place, 2] = row, other, 0
                count += 1
        for k in range(begin, count):
            while at < len(old) and (old[at, 0] < row or (old[at, 0] == row and old[at, 1] < pairs[k, 1])):
                at += 1
            if at < len(old) and old[at, 0] == row and old[at, 1] == pairs[k, 1]:
                pairs[k, 2] = old[at, 2]
    return pairs[:count].copy()


@njit(cache=True)
def list_fixed(robots, state, size_m, walled, obstacles, cells, margin_m):
    """Fixed things with a gap of up to the margin, (things, 3): row, kind, number of the circle or polygon.

    An obstacle that ends where a robot begins, or lower, is none to it.
    """
    rows, circles = len(state), len(obstacles.circle)
    per_arena = rows // (len(obstacles.circle_start) - 1)
    half_size_m = (0.5 * size_m[0], 0.5 * size_m[1])
    things = np.empty((rows + 16, 3), np.int64)
    count = 0
    for row in range(rows):
        x, y, radius_m = state[row, 0], state[row, 1], robots[row].radius_m
        i = cell_of(x, -half_size_m[0], size_m[0] / cells.per_side, cells.per_side)
        j = cell_of(y, -half_size_m[1], size_m[1] / cells.per_side, cells.per_side)
        c = ((row // per_arena) * cells.per_side + j) * cells.per_side + i
        here = cells.which[cells.start[c] : cells.start[c + 1]]
        while count + 4 + len(here) > len(things):
            things = np.concatenate((things, np.empty_like(things)))
        if walled:
            for wall in (LEFT, RIGHT, BOTTOM, TOP):
                if gap_to_wall(wall, x, y, radius_m, half_size_m)[0] <= margin_m:
                    things[count, 0], things[count, 1], things[count, 2] = row, wall, 0
                    count += 1
        for obstacle in here:
            kind, which = (CIRCLE, obstacle) if obstacle < circles else (POLYGON, obstacle - circles)
            top_m = obstacles.circle_top_m[which] if kind == CIRCLE else obstacles.polygon_top_m[which]
            if top_m <= robots[row].bottom_m:
                continue
            gap_m = gap_to_fixed(
                kind, which, x, y, radius_m, half_size_m, obstacles.circle, obstacles.side_start, obstacles.side
            )[0]
            if gap_m <= margin_m:
                things[count, 0], things[count, 1], things[count, 2] = row, kind, which
                count += 1
    return things[:count].copy()


@njit(cache=True)
def split(rows, pairs, things):
    """The rows near which something is listed, and the others; both rising."""
    crowded = np.zeros(rows, np.bool_)
    for k in range(len(pairs)):
        crowded[pairs[k, 0]] = crowded[pairs[k, 1]] = True
    for k in range(len(things)):
        crowded[things[k, 0]] = True
    return np.flatnonzero(crowded), np.flatnonzero(~crowded)
