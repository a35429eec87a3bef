"""Products of residuals against what a shadowing field predicts for them: least squares over all pairs of places.

A field with noise has the covariance sigma^2 C(delta) + noise^2 D, D = diag(1 / packets), of which a fitted line
leaves P (...) P'. Products of residuals have that mean, whatever the field's distribution, so sigma^2 and noise^2 are
linear for a given delta, and delta is searched over a grid and between its steps by a parabola.

All is first made white by a working covariance, as neighbouring places say nearly the same: any one leaves the mean as
it is, and a poor one only costs precision. The fitted one itself (maximum likelihood) would trust fields to be Gaussian
to the finest detail, which those made of a few hundred waves are not: it finds correlation distances half too long.
"""

from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.metrics.radio_fit.link_field import link_covariance
from swarmwire.metrics.radio_fit.path_loss_fit import design
from swarmwire.metrics.radio_fit.places import Places

STEPS = 24
FINEST_SHARE, COARSEST_SHARE = 0.004, 0.6  # correlation distances that are tried, over the extent of the places
WORKING_SHARE, WORKING_NOISE = 0.05, 0.5  # the working covariance: delta over the extent, and noise over sigma


class FieldFits(NamedTuple):
    """The fits to b sets of residuals."""

    deviation_db: FloatArray  # (b,) sigma
    correlation_m: FloatArray  # (b,) delta
    noise_db: FloatArray  # (b,)
    gain: FloatArray  # (b,) what the field explains beyond noise, as a share of all squares
    inside: FloatArray  # (b,) 1 where delta lies within what was tried, 0 at its ends


class FieldMoments:
    """The predictions for given places at every correlation distance that is tried."""

    def __init__(self, places: Places) -> None:
        ends_m, count = places.ends_m, len(places.packets)
        extent_m = float(np.ptp(ends_m.reshape(-1, 2), axis=0).max())
        working = link_covariance(ends_m, WORKING_SHARE * extent_m) + WORKING_NOISE**2 * np.eye(count)
        white = np.linalg.inv(np.linalg.cholesky(working))
        line = white @ design(places.distance_m)
        self._project = white - line @ (np.linalg.pinv(line) @ white)
        self.tried_m: FloatArray = np.geomspace(FINEST_SHARE * extent_m, COARSEST_SHARE * extent_m, STEPS)
        self._of_field = [self._seen(link_covariance(ends_m, at_m)) for at_m in self.tried_m]
        self._of_noise = self._seen(np.diag(1.0 / places.packets))

    def residuals(self, rssi_db: FloatArray) -> FloatArray:
        """What a line of path loss leaves of means of places (n, b), made white."""
        return self._project @ rssi_db

    def fit(self, residuals: FloatArray) -> FieldFits:
        """The best sigma, delta and noise for each column of residuals (n, b)."""
        noise = self._of_noise
        rd, dd = _along(noise, residuals), float((noise**2).sum())
        variances = np.array([self._solve(field, residuals, rd, dd) for field in self._of_field])  # (steps, 3, b)
        explained: FloatArray = variances[:, 2]
        best: IntArray = explained.argmax(axis=0)
        place, inside = _peak(explained, best)
        sigma2, noise2 = (_between(place, variances[:, k]) for k in (0, 1))
        by_noise, all_squares = rd**2 / dd, (residuals**2).sum(axis=0) ** 2
        gain = (explained[best, np.arange(len(best))] - by_noise) / all_squares
        correlation_m = np.exp(np.interp(place, np.arange(STEPS), np.log(self.tried_m)))
        return FieldFits(np.sqrt(sigma2), correlation_m, np.sqrt(noise2), gain, inside)

    def _seen(self, covariance: FloatArray) -> FloatArray:
        """A covariance of places as that of their residuals."""
        return self._project @ covariance @ self._project.T

    def _solve(self, field: FloatArray, residuals: FloatArray, rd: FloatArray, dd: float) -> tuple[FloatArray, ...]:
        """sigma^2, noise^2 and the squares that they explain, (b,) each; neither variance below 0."""
        rf, ff, fd = _along(field, residuals), float((field**2).sum()), float((field * self._of_noise).sum())
        determinant = ff * dd - fd * fd
        sigma2, noise2 = (rf * dd - rd * fd) / determinant, (rd * ff - rf * fd) / determinant
        no_noise, no_field = noise2 < 0.0, sigma2 < 0.0
        sigma2 = np.where(no_noise, np.maximum(rf / ff, 0.0), np.where(no_field, 0.0, sigma2))
        noise2 = np.where(no_noise, 0.0, np.where(no_field, rd / dd, noise2))
        missed = sigma2**2 * ff + 2.0 * sigma2 * noise2 * fd + noise2**2 * dd
        return sigma2, noise2, 2.0 * (sigma2 * rf + noise2 * rd) - missed


def _along(covariance: FloatArray, residuals: FloatArray) -> FloatArray:
    """The sum over all pairs of a covariance (n, n) times the products of each column's (n, b) residuals, (b,)."""
    return (residuals * (covariance @ residuals)).sum(axis=0)


def _between(place: FloatArray, values: FloatArray) -> FloatArray:
    """Each column's (steps, b) value at a place (b,) between steps."""
    low = np.clip(np.floor(place).astype(np.int64), 0, STEPS - 2)
    column = np.arange(len(place))
    return values[low, column] + (place - low) * (values[low + 1, column] - values[low, column])


def _peak(height: FloatArray, best: IntArray) -> tuple[FloatArray, FloatArray]:
    """Where each column's (steps, b) greatest lies between steps, and whether it lies within them."""
    inside = (best > 0) & (best < STEPS - 1)
    at, column = np.clip(best, 1, STEPS - 2), np.arange(len(best))
    before, here, after = height[at - 1, column], height[at, column], height[at + 1, column]
    bend = before - 2.0 * here + after
    shift = np.where(bend < 0.0, 0.5 * (before - after) / np.where(bend < 0.0, bend, -1.0), 0.0)
    place = np.where(inside, at + np.clip(shift, -0.5, 0.5), best)
    return place, inside.astype(np.float64)
