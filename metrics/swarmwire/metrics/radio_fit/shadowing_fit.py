"""Shadowing from where links lie: sigma and correlation distance of the field, and the noise beside it.

Noise is what differs from packet to packet at one place: fading, and the radio's own measurement. Standard errors are
those of fits to fields drawn by the fitted parameters in the same places (a parametric bootstrap): neighbouring links
share what stands around them, so that a log tells less than it has packets.
"""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.draws import derive_key, normal, purpose
from swarmwire.metrics.radio_fit.estimate import Estimate
from swarmwire.metrics.radio_fit.field_moments import FieldFits, FieldMoments
from swarmwire.metrics.radio_fit.link_field import WAVES, link_features
from swarmwire.metrics.radio_fit.path_loss_fit import design
from swarmwire.metrics.radio_fit.places import Places

MIN_PLACES = 30
DRAWN = 200  # fields for the standard errors, which they give to 5 %
FALSE_ALARM = 0.01
FIELD, NOISE = purpose("fitted field"), purpose("fitted noise")
KEY = derive_key("radio fit")


@dataclass(frozen=True)
class ShadowingFit:
    """The field's sigma and delta, the noise beside it, and what they mean for the line of path loss."""

    deviation_db: Estimate  # sigma
    correlation_m: Estimate  # delta
    noise_db: Estimate
    line_errors: tuple[float, float]  # standard errors of RSSI at 1 m in dB, and of the exponent


def fit_shadowing(places: Places) -> ShadowingFit | str:
    """The fit, or what it lacks."""
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


def _with_errors(places: Places, moments: FieldMoments, found: FieldFits, noise: FloatArray) -> ShadowingFit:
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
        Estimate(deviation_db, float(again.deviation_db.std())),
        # A few drawn fields have no clear delta; half of what two thirds of them span is not moved by those.
        Estimate(correlation_m, correlation_m * float(np.sinh(0.5 * (high - low)))),
        Estimate(noise_db, float(again.noise_db.std())),
        (float(lines[0].std()), float(lines[1].std())),
    )
