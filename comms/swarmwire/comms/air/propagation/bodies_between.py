"""Bodies: robots that stand on the line between two others weaken their signal."""

# pyright: basic, reportUnknownMemberType=false

from numba import njit

from swarmwire.comms.geometry import grid


@njit(cache=True)
def bodies_between(x, y, radius_m, most_radius_m, cells, robots, a, b):
    """How many robots, rows a and b apart, have their disc on the line between a and b; equal both ways.

    `x`, `y`, `radius_m` (rows,) in m; `most_radius_m` is the greatest radius; `cells` is a `grid.Grid` of x and y with
    `robots` to each arena. The cost is that of the cells that the line's bounding box touches.
    """
    a, b = min(a, b), max(a, b)
    left, bottom = min(x[a], x[b]) - most_radius_m, min(y[a], y[b]) - most_radius_m
    right, top = max(x[a], x[b]) + most_radius_m, max(y[a], y[b]) + most_radius_m
    first_row = (a // robots) * cells.ny
    count = 0
    for j in range(
        grid.cell_of(bottom, cells.bottom_m, cells.cell_m, cells.ny),
        grid.cell_of(top, cells.bottom_m, cells.cell_m, cells.ny) + 1,
    ):
        row = (first_row + j) * cells.nx
        first = cells.start[row + grid.cell_of(left, cells.left_m, cells.cell_m, cells.nx)]
        stop = cells.start[row + grid.cell_of(right, cells.left_m, cells.cell_m, cells.nx) + 1]
        for at in range(first, stop):
            k = cells.order[at]
            if k not in (a, b) and is_on_line(x[a], y[a], x[b], y[b], x[k], y[k], radius_m[k]):
                count += 1
    return count


@njit(cache=True)
def is_on_line(ax, ay, bx, by, cx, cy, radius_m):
    """Whether a disc around (cx, cy) covers a point of the line from (ax, ay) to (bx, by); all in m."""
    dx, dy = bx - ax, by - ay
    length2 = dx * dx + dy * dy
    share = 0.0 if length2 == 0.0 else min(max(((cx - ax) * dx + (cy - ay) * dy) / length2, 0.0), 1.0)
    px, py = ax + share * dx - cx, ay + share * dy - cy
    return px * px + py * py < radius_m * radius_m
