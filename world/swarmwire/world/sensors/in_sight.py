"""Whether anything stands in a straight line over the floor, looked for in the cells along it. Compiled."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.geometry.obstacle_index import ray_to_thing
from swarmwire.comms.geometry.obstacles import ray_to_circle
from swarmwire.comms.kernels import borrowing
from swarmwire.world.sensors.crowd import nearest

MARGIN_M = 1e-9  # a line along the border of two cells goes through both


@borrowing()
def things_between(things, arena, x, y, to_x, to_y, low_m):
    """Whether an obstacle higher than `low_m` touches the line from x, y to another place."""
    cells = things.cells
    apart = np.sqrt((to_x - x) ** 2 + (to_y - y) ** 2)
    if apart == 0.0 or len(things.shape) == 0:
        return False
    dx, dy = (to_x - x) / apart, (to_y - y) / apart
    for column in range(_cell(min(x, to_x), cells.per_x, cells.nx), _cell(max(x, to_x), cells.per_x, cells.nx) + 1):
        low, high = _rows(cells, column, MARGIN_M, x, y, to_x, to_y)
        for row in range(low, high + 1):
            c = (arena * cells.ny + row % cells.ny) * cells.nx + column % cells.nx
            for at in range(cells.start[c], cells.start[c + 1]):
                k = cells.item[at]
                if things.shape[k, 3] > low_m and ray_to_thing(x, y, dx, dy, things, k) <= apart:
                    return True
    return False


@borrowing()
def robots_between(crowd, widest_m, arena, own, x, y, to_x, to_y):
    """Whether a robot that is as high as robot `own` somewhere touches the line from its place x, y to another."""
    cells = crowd.cells
    apart = np.sqrt((to_x - x) ** 2 + (to_y - y) ** 2)
    if apart == 0.0:
        return False
    dx, dy = (to_x - x) / apart, (to_y - y) / apart
    middle_x, middle_y = 0.5 * (x + to_x), 0.5 * (y + to_y)
    first = _cell(min(x, to_x) - widest_m, cells.per_x, cells.nx)
    last = _cell(max(x, to_x) + widest_m, cells.per_x, cells.nx)
    for column in range(first, last + 1):
        low, high = _rows(cells, column, widest_m, x, y, to_x, to_y)
        for row in range(low, high + 1):
            c = (arena * cells.ny + row % cells.ny) * cells.nx + column % cells.nx
            for at in range(cells.start[c], cells.start[c + 1]):
                other = cells.item[at]
                beside = crowd.bottom_m[other] < crowd.top_m[own] and crowd.bottom_m[own] < crowd.top_m[other]
                if other == own or not beside:
                    continue
                cx = nearest(middle_x, crowd.state[arena, other, 0], crowd.wrap_x, crowd.per_wrap_x)
                cy = nearest(middle_y, crowd.state[arena, other, 1], crowd.wrap_y, crowd.per_wrap_y)
                if ray_to_circle(x, y, dx, dy, cx, cy, crowd.radius_m[other]) <= apart:
                    return True
    return False


@borrowing()
def _cell(at, per, cells):
    """The column or row of a coordinate, not rolled up."""
    return int(np.floor(at * per + 0.5 * cells))


@borrowing()
def _rows(cells, column, margin_m, x, y, to_x, to_y):
    """First and last row of a column, not rolled up, where something this wide may touch the line."""
    low, high = min(y, to_y), max(y, to_y)
    if to_x != x:
        left = (column - 0.5 * cells.nx) / cells.per_x - margin_m
        right = (column + 1.0 - 0.5 * cells.nx) / cells.per_x + margin_m
        slope = (to_y - y) / (to_x - x)
        one = y + slope * (max(left, min(x, to_x)) - x)
        other = y + slope * (min(right, max(x, to_x)) - x)
        low, high = max(low, min(one, other)), min(high, max(one, other))
    return _cell(low - margin_m, cells.per_y, cells.ny), _cell(high + margin_m, cells.per_y, cells.ny)
