"""Standard errors from the curvature of a log likelihood at its maximum."""

from collections.abc import Callable

import numpy as np

from swarmwire.comms.arrays import FloatArray

CORNERS = ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))


def standard_errors(cost: Callable[[FloatArray], float], at: FloatArray, step: float) -> FloatArray:
    """Standard errors (n,) of parameters where `cost`, the negative log likelihood, is least; by differences of `step`.

    NaN where the cost does not rise around the place: the data do not tell.
    """
    count = len(at)
    move = np.eye(count) * step
    bend = np.empty((count, count))
    for i in range(count):
        for j in range(i + 1):
            corners = sum(sign * cost(at + a * move[i] + b * move[j]) for a, b, sign in CORNERS)
            bend[i, j] = bend[j, i] = corners / (4.0 * step * step)
    if not np.isfinite(bend).all() or np.linalg.matrix_rank(bend) < count:
        return np.full(count, np.nan)
    variance = np.diag(np.linalg.inv(bend))
    return np.where(variance > 0.0, np.sqrt(np.abs(variance)), np.nan)
