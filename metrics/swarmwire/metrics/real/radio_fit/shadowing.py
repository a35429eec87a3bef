"""Shadowing fitted to the residuals of the path loss: deviation, correlation distance and noise."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.draws import derive_key, normal, purpose
from swarmwire.metrics.real.radio_fit.logs import PacketLog
from swarmwire.metrics.real.radio_fit.path_loss import EstimatedValue, PathLossFit, design

LOCATION_CELL_M = 0.05
MAX_LOCATIONS = 300
WAVES = 2048  # within 0.02 of the exact covariance for links up to 15 correlation distances long
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
STEPS = 24
FINEST_SHARE, COARSEST_SHARE = 0.004, 0.6  # bounds of correlation distances, relative to the extent of locations
WORKING_SHARE, WORKING_NOISE = 0.05, 0.5  # working covariance: delta relative to the extent, noise to sigma
MIN_LOCATIONS = 30
DRAWN = 200  # random fields; standard errors are accurate to 5 %
FALSE_ALARM = 0.01
FIELD, NOISE = purpose("fitted field"), purpose("fitted noise")
KEY = derive_key("radio fit")
BINS = 16
FARTHEST = 5.0  # greatest separation of a correlogram, in correlation distances


@dataclass(frozen=True)
class LocationMeans:
    """Mean values and number of the packets of each location of a link."""

    ends_m: FloatArray  # (n, 4) x and y of sender and receiver
    rssi_dbm: FloatArray  # (n,)
    packets: FloatArray  # (n,)

    @property
    def distance_m(self) -> FloatArray:
        """Length of each link, (n,)."""
        return np.hypot(self.ends_m[:, 2] - self.ends_m[:, 0], self.ends_m[:, 3] - self.ends_m[:, 1])


def location_means(log: PacketLog) -> LocationMeans:
    """Return the locations of links in a log with positions, both directions together, at most MAX_LOCATIONS evenly."""
    assert log.ends_m is not None
    ends_m, rssi_dbm = log.ends_m[log.received], log.rssi_dbm[log.received]
    swapped = (ends_m[:, 0] > ends_m[:, 2]) | ((ends_m[:, 0] == ends_m[:, 2]) & (ends_m[:, 1] > ends_m[:, 3]))
    ends_m = np.where(swapped[:, None], ends_m[:, [2, 3, 0, 1]], ends_m)
    cells = np.round(ends_m / LOCATION_CELL_M).astype(np.int64)
    _, first, index = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    index = index.reshape(-1)
    packets = np.bincount(index).astype(np.float64)
    mean_ends = np.stack([np.bincount(index, ends_m[:, i]) / packets for i in range(4)], axis=1)
    mean_rssi = np.bincount(index, rssi_dbm) / packets
    in_order = np.argsort(first)  # order of the log, not of the cells
    if len(in_order) > MAX_LOCATIONS:
        in_order = in_order[np.linspace(0, len(in_order) - 1, MAX_LOCATIONS).round().astype(np.int64)]
    return LocationMeans(mean_ends[in_order], mean_rssi[in_order], packets[in_order])


def link_features(ends_m: FloatArray, correlation_m: float) -> FloatArray:
    """Return F (n, 2 WAVES) for links with these ends (n, 4: x, y of both), sigma = 1: their covariance is F F'."""
    wave = np.arange(WAVES)
    quantile = (wave + 0.5) / WAVES
    # |k| has the distribution 1 - 1 / sqrt(1 + (2 pi delta k)^2); directions are uniform.
    k = np.sqrt((1.0 - quantile) ** -2 - 1.0) / (2.0 * math.pi * correlation_m)
    direction = 2.0 * math.pi * wave * GOLDEN
    kx, ky = k * np.cos(direction), k * np.sin(direction)
    dx, dy = ends_m[:, 2] - ends_m[:, 0], ends_m[:, 3] - ends_m[:, 1]
    x, y = 0.5 * (ends_m[:, 0] + ends_m[:, 2]), 0.5 * (ends_m[:, 1] + ends_m[:, 3])
    mean = np.sinc(np.outer(dx, kx) + np.outer(dy, ky))
    mean *= np.sqrt(np.hypot(dx, dy) / (2.0 * correlation_m * WAVES))[:, None]
    phase = 2.0 * math.pi * (np.outer(x, kx) + np.outer(y, ky))
    return np.concatenate([mean * np.cos(phase), mean * np.sin(phase)], axis=1)


def link_covariance(ends_m: FloatArray, correlation_m: float) -> FloatArray:
    """Return the covariance (n, n) of links, sigma = 1; its diagonal is 1 - delta/d (1 - exp(-d/delta))."""
    features = link_features(ends_m, correlation_m)
    return features @ features.T


class FieldFits(NamedTuple):
    """Fits to b sets of residuals."""

    deviation_db: FloatArray  # (b,) sigma
    correlation_m: FloatArray  # (b,) delta
    noise_db: FloatArray  # (b,)
    gain: FloatArray  # (b,) share of the squares that the field explains beyond noise
    inside: FloatArray  # (b,) 1: delta lies within the tried values; 0: at their ends


class FieldMoments:
    """Covariances of residuals at these locations for every tried correlation distance."""

    def __init__(self, locations: LocationMeans) -> None:
        ends_m, count = locations.ends_m, len(locations.packets)
        extent_m = float(np.ptp(ends_m.reshape(-1, 2), axis=0).max())
        working = link_covariance(ends_m, WORKING_SHARE * extent_m) + WORKING_NOISE**2 * np.eye(count)
        white = np.linalg.inv(np.linalg.cholesky(working))
        line = white @ design(locations.distance_m)
        self._project = white - line @ (np.linalg.pinv(line) @ white)
        self.tried_m: FloatArray = np.geomspace(FINEST_SHARE * extent_m, COARSEST_SHARE * extent_m, STEPS)
        self._field_covariances = [self._projected(link_covariance(ends_m, at_m)) for at_m in self.tried_m]
        self._noise_covariance = self._projected(np.diag(1.0 / locations.packets))

    def residuals(self, rssi_db: FloatArray) -> FloatArray:
        """Return whitened residuals (n, b) of a line of path loss, from means of locations (n, b)."""
        return self._project @ rssi_db

    def fit(self, residuals: FloatArray) -> FieldFits:
        """Return the best sigma, delta and noise for each column of residuals (n, b)."""
        noise = self._noise_covariance
        rd, dd = _products(noise, residuals), float((noise**2).sum())
        solutions = [self._solve(field, residuals, rd, dd) for field in self._field_covariances]
        variances = np.array(solutions)  # (steps, 3, b)
        explained: FloatArray = variances[:, 2]
        best: IntArray = explained.argmax(axis=0)
        position, inside = _peak(explained, best)
        sigma2, noise2 = (_interpolated(position, variances[:, k]) for k in (0, 1))
        by_noise, all_squares = rd**2 / dd, (residuals**2).sum(axis=0) ** 2
        gain = (explained[best, np.arange(len(best))] - by_noise) / all_squares
        correlation_m = np.exp(np.interp(position, np.arange(STEPS), np.log(self.tried_m)))
        return FieldFits(np.sqrt(sigma2), correlation_m, np.sqrt(noise2), gain, inside)

    def _projected(self, covariance: FloatArray) -> FloatArray:
        """Return a covariance of locations as the covariance of their residuals."""
        return self._project @ covariance @ self._project.T

    def _solve(self, field: FloatArray, residuals: FloatArray, rd: FloatArray, dd: float) -> tuple[FloatArray, ...]:
        """Return sigma^2, noise^2 and the squares that they explain, (b,) each; variances are at least 0."""
        rf, ff, fd = _products(field, residuals), float((field**2).sum()), float((field * self._noise_covariance).sum())
        determinant = ff * dd - fd * fd
        sigma2, noise2 = (rf * dd - rd * fd) / determinant, (rd * ff - rf * fd) / determinant
        no_noise, no_field = noise2 < 0.0, sigma2 < 0.0
        sigma2 = np.where(no_noise, np.maximum(rf / ff, 0.0), np.where(no_field, 0.0, sigma2))
        noise2 = np.where(no_noise, 0.0, np.where(no_field, rd / dd, noise2))
        missed = sigma2**2 * ff + 2.0 * sigma2 * noise2 * fd + noise2**2 * dd
        return sigma2, noise2, 2.0 * (sigma2 * rf + noise2 * rd) - missed


def _products(covariance: FloatArray, residuals: FloatArray) -> FloatArray:
    """Return the sum over all pairs of a covariance (n, n) times the products of residuals (n, b), (b,)."""
    return (residuals * (covariance @ residuals)).sum(axis=0)


def _interpolated(position: FloatArray, values: FloatArray) -> FloatArray:
    """Return the values of columns (steps, b) at positions (b,) between steps."""
    low = np.clip(np.floor(position).astype(np.int64), 0, STEPS - 2)
    column = np.arange(len(position))
    return values[low, column] + (position - low) * (values[low + 1, column] - values[low, column])


def _peak(height: FloatArray, best: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return positions (b,) of the maxima of columns (steps, b) between steps, and 1 where they are inside, else 0."""
    inside = (best > 0) & (best < STEPS - 1)
    step, column = np.clip(best, 1, STEPS - 2), np.arange(len(best))
    before, middle, after = height[step - 1, column], height[step, column], height[step + 1, column]
    curvature = before - 2.0 * middle + after
    shift = np.where(curvature < 0.0, 0.5 * (before - after) / np.where(curvature < 0.0, curvature, -1.0), 0.0)
    position = np.where(inside, step + np.clip(shift, -0.5, 0.5), best)
    return position, inside.astype(np.float64)


@dataclass(frozen=True)
class ShadowingFit:
    """The field's sigma and delta, independent noise, and the standard errors of the line of path loss."""

    deviation_db: EstimatedValue  # sigma
    correlation_m: EstimatedValue  # delta
    noise_db: EstimatedValue
    line_errors: tuple[float, float]  # standard errors of RSSI at 1 m in dB, and of the exponent


def fit_shadowing(locations: LocationMeans) -> ShadowingFit | str:
    """Fit the field, or return a sentence on missing data."""
    count = len(locations.packets)
    if count < MIN_LOCATIONS:
        return f"needs {MIN_LOCATIONS} locations of sender and receiver, got {count}"
    moments = FieldMoments(locations)
    fits = moments.fit(moments.residuals(locations.rssi_dbm[:, None]))
    noise = normal(KEY, np.arange(count)[:, None], np.arange(DRAWN), 0, NOISE) / np.sqrt(locations.packets)[:, None]
    by_chance = moments.fit(moments.residuals(noise))
    if np.mean(by_chance.gain >= fits.gain[0]) >= FALSE_ALARM:
        return "links that are near each other are no more alike than by chance"
    if not fits.inside[0]:
        low, high = moments.tried_m[[0, -1]]
        return f"expected between {low:.2g} and {high:.2g} m in so large a place, and none of these fits best"
    return _with_errors(locations, moments, fits, noise)


def _with_errors(locations: LocationMeans, moments: FieldMoments, fits: FieldFits, noise: FloatArray) -> ShadowingFit:
    deviation_db, correlation_m, noise_db = (
        float(values[0]) for values in (fits.deviation_db, fits.correlation_m, fits.noise_db)
    )
    features = link_features(locations.ends_m, correlation_m)
    waves = normal(KEY, np.arange(2 * WAVES)[:, None], np.arange(DRAWN), 0, FIELD)
    drawn = deviation_db * (features @ waves) + noise_db * noise
    again = moments.fit(moments.residuals(drawn))
    root = np.sqrt(locations.packets)[:, None]
    lines = np.linalg.lstsq(design(locations.distance_m) * root, drawn * root)[0]
    low, high = np.percentile(np.log(again.correlation_m), (15.87, 84.13))
    return ShadowingFit(
        EstimatedValue(deviation_db, float(again.deviation_db.std())),
        # A few drawn fields have no clear delta; half of the range of two thirds of them is robust.
        EstimatedValue(correlation_m, correlation_m * float(np.sinh(0.5 * (high - low)))),
        EstimatedValue(noise_db, float(again.noise_db.std())),
        (float(lines[0].std()), float(lines[1].std())),
    )


class Correlogram(NamedTuple):
    """Means over the pairs of locations in each bin."""

    separation_m: FloatArray  # (bins,) mean distance between corresponding ends of two links
    measured_db2: FloatArray  # (bins,) mean product of two residuals
    fitted_db2: FloatArray  # (bins,) covariance of the fitted field, for the same pairs


def correlogram(locations: LocationMeans, line: PathLossFit, field: ShadowingFit) -> Correlogram:
    """Return means over pairs of locations up to FARTHEST apart, in bins of equal width, without empty bins."""
    residual_db = locations.rssi_dbm - line.rssi_dbm(locations.distance_m)
    first, second = np.triu_indices(len(residual_db), 1)
    separation_m = _separation_m(locations.ends_m)[first, second]
    fitted_db2 = (
        field.deviation_db.value**2 * link_covariance(locations.ends_m, field.correlation_m.value)[first, second]
    )
    farthest_m = min(float(separation_m.max()), FARTHEST * field.correlation_m.value)
    near = separation_m <= farthest_m
    index = np.minimum((separation_m[near] / farthest_m * BINS).astype(np.int64), BINS - 1)
    pairs = np.bincount(index, minlength=BINS)
    filled = pairs > 0
    columns = (separation_m, (residual_db[first] * residual_db[second]), fitted_db2)
    means = (np.bincount(index, column[near], BINS)[filled] / pairs[filled] for column in columns)
    return Correlogram(*means)


def _separation_m(ends_m: FloatArray) -> FloatArray:
    """Return the mean distance (n, n) between the ends of two links, in the pairing with the least mean."""
    straight, swapped = (
        0.5
        * (
            np.hypot(*(ends_m[:, None, :2] - others[None, :, :2]).transpose(2, 0, 1))
            + np.hypot(*(ends_m[:, None, 2:] - others[None, :, 2:]).transpose(2, 0, 1))
        )
        for others in (ends_m, ends_m[:, [2, 3, 0, 1]])
    )
    return np.minimum(straight, swapped)
