"""Occupied pixels merged into rectangles: few obstacles for engines, rays and signals to look at. Compiled."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.arrays import BoolArray, IntArray


def merged_boxes(occupied: BoolArray, most: int) -> IntArray:
    """Rectangles that cover the occupied pixels (rows, columns) and nothing else, none of them twice, (boxes, 4).

    Each is its first row, first column, rows and columns. Of every first pixel in reading order that is not covered yet
    it is the larger of two rectangles: as wide as can be and then as tall, or the other way round. If there would be
    more than `most`, there are `most + 1`.
    """
    return _merged(occupied.copy(), most)


@njit(cache=True)
def _merged(left, most):
    boxes = np.empty((most + 1, 4), np.int64)
    found = 0
    for row in range(left.shape[0]):
        for column in range(left.shape[1]):
            if not left[row, column]:
                continue
            if found > most:
                return boxes
            wide = _columns(left, row, column, 1)
            below = _rows(left, row, column, wide)
            tall = _rows(left, row, column, 1)
            beside = _columns(left, row, column, tall)
            rows, columns = (below, wide) if below * wide >= tall * beside else (tall, beside)
            left[row : row + rows, column : column + columns] = False
            boxes[found] = row, column, rows, columns
            found += 1
    return boxes[:found]


@njit(cache=True)
def _columns(left, row, column, rows):
    """How many columns from `column` on are occupied in all of these rows."""
    columns = 0
    while column + columns < left.shape[1] and left[row : row + rows, column + columns].all():
        columns += 1
    return columns


@njit(cache=True)
def _rows(left, row, column, columns):
    """How many rows from `row` on are occupied in all of these columns."""
    rows = 0
    while row + rows < left.shape[0] and left[row + rows, column : column + columns].all():
        rows += 1
    return rows
