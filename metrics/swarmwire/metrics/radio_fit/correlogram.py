"""The residuals' correlogram: how alike two links' residuals are, by how far their ends lie apart."""

from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.radio_fit.link_field import link_covariance
from swarmwire.metrics.radio_fit.path_loss_fit import PathLossFit
from swarmwire.metrics.radio_fit.places import Places
from swarmwire.metrics.radio_fit.shadowing_fit import ShadowingFit

BINS = 16
FARTHEST = 5.0  # correlation distances


class Correlogram(NamedTuple):
    """Means over the pairs of places in each bin."""

    apart_m: FloatArray  # (bins,) mean distance between corresponding ends of two links
    found_db2: FloatArray  # (bins,) mean product of two residuals
    fitted_db2: FloatArray  # (bins,) what the fitted field has for the same pairs


def correlogram(places: Places, line: PathLossFit, field: ShadowingFit) -> Correlogram:
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
