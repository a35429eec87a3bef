"""Vicsek's model apart from the emulator, in both orders in which programs update it.

As printed in 1995 a particle moves by the direction that it had, while it takes the new one; many programs turn it
first, and move it by the new one.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.draws import derive_key, purpose, uniform

PLACE, NOISE = purpose("place"), purpose("noise")


def mean_order(
    robots: int, side: float, way: float, noise_rad: float, steps: tuple[int, int], *, new: bool, seed: int
) -> float:
    """The mean order of a run, between the first and the last of `steps`; range 1, `way` a step."""
    key, index = derive_key("reference", seed), np.arange(robots)
    x, y, turn = (uniform(key, axis, index, 0, PLACE) for axis in range(3))
    x, y, theta = side * x, side * y, 2.0 * np.pi * turn
    orders: list[float] = []
    for step in range(steps[1]):
        noise = noise_rad * (uniform(key, step, index, 0, NOISE) - 0.5)
        turned = mean_direction(x, y, theta, side) + noise
        go = turned if new else theta
        x, y, theta = (x + way * np.cos(go)) % side, (y + way * np.sin(go)) % side, turned
        if step >= steps[0]:
            orders.append(float(np.hypot(np.cos(theta).mean(), np.sin(theta).mean())))
    return float(np.mean(orders))


@njit(cache=True)
def mean_direction(x: FloatArray, y: FloatArray, theta: FloatArray, side: float) -> FloatArray:
    """Of all within 1 of each, itself included, on a torus; (n,) each. Cells of at least 1, three in a row or more."""
    cells = int(side)
    first, after = np.full((cells, cells), -1), np.empty(len(x), np.int64)
    column = np.minimum((x * (cells / side)).astype(np.int64), cells - 1)
    row = np.minimum((y * (cells / side)).astype(np.int64), cells - 1)
    for i in range(len(x)):
        after[i] = first[row[i], column[i]]
        first[row[i], column[i]] = i
    c, s, mean = np.cos(theta), np.sin(theta), np.empty(len(x))
    for i in range(len(x)):
        along, across = 0.0, 0.0
        for cell in range(9):
            k = first[(row[i] + cell // 3 - 1) % cells, (column[i] + cell % 3 - 1) % cells]
            while k >= 0:
                dx, dy = x[k] - x[i], y[k] - y[i]
                dx, dy = dx - side * np.round(dx / side), dy - side * np.round(dy / side)
                if dx * dx + dy * dy <= 1.0:
                    along += c[k]
                    across += s[k]
                k = after[k]
        mean[i] = np.arctan2(across, along)
    return mean
