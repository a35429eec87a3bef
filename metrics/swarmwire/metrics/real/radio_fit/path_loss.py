"""Path loss fitted to RSSI over distance: reference loss and exponent, with their standard errors."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray

CORNERS = ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))
MIN_PACKETS = 10
MIN_SPAN = 1.5  # ratio of the farthest to the nearest distance; over less, noise determines the slope
MIN_CLUSTERS = 10
# The exponent is near 1 in tunnels, which guide waves; below, range grows so fast with power that it has no limit.
MIN_EXPONENT, MAX_EXPONENT = 0.5, 20.0


class EstimatedValue(NamedTuple):
    """A value and its standard error, in the unit of its name."""

    value: float
    standard_error: float  # NaN: unknown


def standard_errors(cost: Callable[[FloatArray], float], minimum: FloatArray, step: float) -> FloatArray:
    """Return standard errors (n,) of parameters at the minimum of the negative log likelihood, by differences.

    NaN if the cost does not rise in all directions.
    """
    count = len(minimum)
    move = np.eye(count) * step
    curvature = np.empty((count, count))
    for i in range(count):
        for j in range(i + 1):
            corners = sum(sign * cost(minimum + a * move[i] + b * move[j]) for a, b, sign in CORNERS)
            curvature[i, j] = curvature[j, i] = corners / (4.0 * step * step)
    if not np.isfinite(curvature).all() or np.linalg.matrix_rank(curvature) < count:
        return np.full(count, np.nan)
    variance = np.diag(np.linalg.inv(curvature))
    return np.where(variance > 0.0, np.sqrt(np.abs(variance)), np.nan)


@dataclass(frozen=True)
class PathLossFit:
    """RSSI(d) = rssi_at_1_m - 10 n log10 d."""

    exponent: EstimatedValue  # n
    rssi_at_1_m_dbm: EstimatedValue

    def rssi_dbm(self, distance_m: FloatArray) -> FloatArray:
        """Return the line at distances of any shape."""
        return self.rssi_at_1_m_dbm.value - 10.0 * self.exponent.value * np.log10(distance_m)


def design(distance_m: FloatArray) -> FloatArray:
    """Return the design matrix (n, 2) of RSSI at 1 m and the exponent."""
    return np.stack([np.ones_like(distance_m), -10.0 * np.log10(distance_m)], axis=1)


def missing_data(distance_m: FloatArray) -> str | None:
    """Return a sentence on missing data; None if these distances suffice."""
    if len(distance_m) < MIN_PACKETS:
        return f"needs {MIN_PACKETS} received packets, got {len(distance_m)}"
    span = float(distance_m.max() / distance_m.min())
    if span < MIN_SPAN:
        return f"needs distances that span a factor of {MIN_SPAN:g}, got {span:.2f}"
    return None


def implausibility(fit: PathLossFit) -> str | None:
    """Return a sentence on an implausible exponent; None if the fit is plausible."""
    exponent = round(fit.exponent.value, 3) + 0.0  # rounded to 0 rather than -0 or 1e-17
    if MIN_EXPONENT <= exponent <= MAX_EXPONENT:
        return None
    trend = "does not fall" if exponent <= 0.0 else "falls too little" if exponent < MIN_EXPONENT else "falls too fast"
    bounds = f"{MIN_EXPONENT:g} to {MAX_EXPONENT:g}"
    return f"RSSI {trend} with distance: expected an exponent of {bounds}, got {exponent:g}"


def fit_path_loss(distance_m: FloatArray, rssi_dbm: FloatArray, cluster: IntArray) -> PathLossFit:
    """Fit RSSI by ordinary least squares over received packets (n,).

    Packets of a cluster (n,), such as the two directions between two robots, share their surroundings. Standard
    errors allow for it (the sandwich of Liang and Zeger, Biometrika 73, 1986) where there are enough clusters.
    """
    x = design(distance_m)
    inverse = np.linalg.inv(x.T @ x)
    beta = inverse @ (x.T @ rssi_dbm)
    residual = rssi_dbm - x @ beta
    variance = inverse * (residual @ residual) / max(len(rssi_dbm) - 2, 1)
    clusters = np.unique(cluster, return_inverse=True)[1]
    count = int(clusters.max()) + 1
    if count >= MIN_CLUSTERS:
        score = np.stack([np.bincount(clusters, x[:, i] * residual) for i in range(2)], axis=1)
        variance = inverse @ (score.T @ score) @ inverse * count / (count - 1)
    errors = np.sqrt(np.diag(variance))
    return PathLossFit(
        EstimatedValue(float(beta[1]), float(errors[1])), EstimatedValue(float(beta[0]), float(errors[0]))
    )
