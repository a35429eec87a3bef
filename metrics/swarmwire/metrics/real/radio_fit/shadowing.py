"""Shadowing fitted to the residuals of the path loss: deviation, correlation distance and noise."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.draws import derive_key, normal, purpose
from swarmwire.metrics.real.radio_fit.logs import PacketLog
from swarmwire.metrics.real.radio_fit.path_loss import EstimatedValue, PathLossFit, design

SAME_PLACE_M = 0.05
MAX_PLACES = 300
WAVES = 2048  # within 0.02 of the exact covariance for links up to 15 correlation distances long
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
STEPS = 24
FINEST_SHARE, COARSEST_SHARE = 0.004, 0.6  # correlation distances that are tried, over the extent of the places
WORKING_SHARE, WORKING_NOISE = 0.05, 0.5  # the working covariance: delta over the extent, and noise over sigma
MIN_PLACES = 30
DRAWN = 200  # fields for the standard errors, which they give to 5 %
FALSE_ALARM = 0.01
FIELD, NOISE = purpose("fitted field"), purpose("fitted noise")
KEY = derive_key("radio fit")
BINS = 16
FARTHEST = 5.0  # correlation distances


@dataclass(frozen=True)
class LocationMeans:
    """Mean values and number of the packets of each place."""

    ends_m: FloatArray  # (n, 4) x and y of sender and receiver
    rssi_dbm: FloatArray  # (n,)
    packets: FloatArray  # (n,)

    @property
    def distance_m(self) -> FloatArray:
        """Length of each link, (n,)."""
        return np.hypot(self.ends_m[:, 2] - self.ends_m[:, 0], self.ends_m[:, 3] - self.ends_m[:, 1])


def places_of(log: PacketLog) -> LocationMeans:
    """The places of a log with positions, both directions of a link as one; an even choice where there are many."""
    assert log.ends_m is not None
    ends_m, rssi_dbm = log.ends_m[log.received], log.rssi_dbm[log.received]
    turned = (ends_m[:, 0] > ends_m[:, 2]) | ((ends_m[:, 0] == ends_m[:, 2]) & (ends_m[:, 1] > ends_m[:, 3]))
    ends_m = np.where(turned[:, None], ends_m[:, [2, 3, 0, 1]], ends_m)
    cells = np.round(ends_m / SAME_PLACE_M).astype(np.int64)
    _, first, place = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    place = place.reshape(-1)
    packets = np.bincount(place).astype(np.float64)
    mean_ends = np.stack([np.bincount(place, ends_m[:, i]) / packets for i in range(4)], axis=1)
    mean_rssi = np.bincount(place, rssi_dbm) / packets
    in_order = np.argsort(first)  # evenly over the log, not over the cells
    if len(in_order) > MAX_PLACES:
        in_order = in_order[np.linspace(0, len(in_order) - 1, MAX_PLACES).round().astype(np.int64)]
    return LocationMeans(mean_ends[in_order], mean_rssi[in_order], packets[in_order])


def link_features(ends_m: FloatArray, correlation_m: float) -> FloatArray:
    """F (n, 2 WAVES) for links with these ends (n, 4: x, y of either), sigma = 1: their covariance is F F'."""
    wave = np.arange(WAVES)
    quantile = (wave + 0.5) / WAVES
    # |k| has the distribution 1 - 1 / sqrt(1 + (2 pi delta k)^2), and all directions are alike.
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
    """The covariance (n, n) of links, sigma = 1; on its diagonal 1 - delta/d (1 - exp(-d/delta))."""
    features = link_features(ends_m, correlation_m)
    return features @ features.T


class FieldFits(NamedTuple):
    """The fits to b sets of residuals."""

    deviation_db: FloatArray  # (b,) sigma
    correlation_m: FloatArray  # (b,) delta
    noise_db: FloatArray  # (b,)
    gain: FloatArray  # (b,) share of the squares that the field explains beyond noise
    inside: FloatArray  # (b,) 1 where delta lies within the tried values, 0 at their ends


class FieldMoments:
    """The predictions for given places at every correlation distance that is tried."""

    def __init__(self, places: LocationMeans) -> None:
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
        """Whitened residuals of a line of path loss, of means of places (n, b)."""
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


@dataclass(frozen=True)
class ShadowingFit:
    """The field's sigma and delta, the noise beside it, and the standard errors of the line of path loss."""

    deviation_db: EstimatedValue  # sigma
    correlation_m: EstimatedValue  # delta
    noise_db: EstimatedValue
    line_errors: tuple[float, float]  # standard errors of RSSI at 1 m in dB, and of the exponent


def fit_shadowing(places: LocationMeans) -> ShadowingFit | str:
    """The fit, or a sentence on missing data."""
    count = len(places.packets)
    if count < MIN_PLACES:
        return f"needs {MIN_PLACES} places of sender and receiver, got {count}"
    moments = FieldMoments(places)
    found = moments.fit(moments.residuals(places.rssi_dbm[:, None]))
    noise = normal(KEY, np.arange(count)[:, None], np.arange(DRAWN), 0, NOISE) / np.sqrt(places.packets)[:, None]
    by_chance = moments.fit(moments.residuals(noise))
    if np.mean(by_chance.gain >= found.gain[0]) >= FALSE_ALARM:
        return "links that are near each other are no more alike than by chance"
    if not found.inside[0]:
        low, high = moments.tried_m[[0, -1]]
        return f"expected between {low:.2g} and {high:.2g} m in so large a place, and none of these fits best"
    return _with_errors(places, moments, found, noise)


def _with_errors(places: LocationMeans, moments: FieldMoments, found: FieldFits, noise: FloatArray) -> ShadowingFit:
    deviation_db, correlation_m, noise_db = (
        float(of[0]) for of in (found.deviation_db, found.correlation_m, found.noise_db)
    )
    features = link_features(places.ends_m, correlation_m)
    waves = normal(KEY, np.arange(2 * WAVES)[:, None], np.arange(DRAWN), 0, FIELD)
    drawn = deviation_db * (features @ waves) + noise_db * noise
    again = moments.fit(moments.residuals(drawn))
    root = np.sqrt(places.packets)[:, None]
    lines = np.linalg.lstsq(design(places.distance_m) * root, drawn * root)[0]
    low, high = np.percentile(np.log(again.correlation_m), (15.87, 84.13))
    return ShadowingFit(
        EstimatedValue(deviation_db, float(again.deviation_db.std())),
        # A few drawn fields have no clear delta; half of the range of two thirds of them is robust.
        EstimatedValue(correlation_m, correlation_m * float(np.sinh(0.5 * (high - low)))),
        EstimatedValue(noise_db, float(again.noise_db.std())),
        (float(lines[0].std()), float(lines[1].std())),
    )


class Correlogram(NamedTuple):
    """Means over the pairs of places in each bin."""

    apart_m: FloatArray  # (bins,) mean distance between corresponding ends of two links
    found_db2: FloatArray  # (bins,) mean product of two residuals
    fitted_db2: FloatArray  # (bins,) covariance of the fitted field, for the same pairs


def correlogram(places: LocationMeans, line: PathLossFit, field: ShadowingFit) -> Correlogram:
    """The pairs up to a few correlation distances apart, in bins of equal width; bins without a pair are left out."""
    residual_db = places.rssi_dbm - line.rssi_dbm(places.distance_m)
    one, other = np.triu_indices(len(residual_db), 1)
    apart_m = _apart_m(places.ends_m)[one, other]
    fitted_db2 = field.deviation_db.value**2 * link_covariance(places.ends_m, field.correlation_m.value)[one, other]
    farthest_m = min(float(apart_m.max()), FARTHEST * field.correlation_m.value)
    near = apart_m <= farthest_m
    place = np.minimum((apart_m[near] / farthest_m * BINS).astype(np.int64), BINS - 1)
    pairs = np.bincount(place, minlength=BINS)
    there = pairs > 0
    columns = (apart_m, (residual_db[one] * residual_db[other]), fitted_db2)
    means = (np.bincount(place, column[near], BINS)[there] / pairs[there] for column in columns)
    return Correlogram(*means)


def _apart_m(ends_m: FloatArray) -> FloatArray:
    """Mean distance (n, n) between the ends of two links, paired so that it is the least."""
    straight, turned = (
        0.5
        * (
            np.hypot(*(ends_m[:, None, :2] - others[None, :, :2]).transpose(2, 0, 1))
            + np.hypot(*(ends_m[:, None, 2:] - others[None, :, 2:]).transpose(2, 0, 1))
        )
        for others in (ends_m, ends_m[:, [2, 3, 0, 1]])
    )
    return np.minimum(straight, turned)
