"""A fit as rows for people: parameter, value, standard error, unit."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from swarmwire.metrics.radio_fit.estimate import Estimate
from swarmwire.metrics.radio_fit.loss_fit import NAMES, LossFit
from swarmwire.metrics.radio_fit.path_loss_fit import PathLossFit
from swarmwire.metrics.radio_fit.radio_fit import RadioFit
from swarmwire.metrics.radio_fit.shadowing_fit import ShadowingFit

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
WORDS = {
    "bad_s": "bursts: mean duration",
    "good_s": "bursts: mean time between",
    "loss_bad": "bursts: loss within",
    "loss_good": "bursts: loss between",
}


class Row(NamedTuple):
    """One line; a parameter that was left out has no value, and says why."""

    parameter: str
    estimate: Estimate | None
    unit: str
    left_out: str = ""


def parameter_rows(fit: RadioFit) -> Iterator[Row]:
    """Every parameter, fitted or left out."""
    line, field, losses = fit.path_loss, fit.shadowing, fit.losses
    if isinstance(line, PathLossFit):
        yield Row("path loss exponent", line.exponent, "")
        yield Row("RSSI at 1 m", line.rssi_at_1_m_dbm, "dBm")
    else:
        yield Row("path loss", None, "", line)
    if isinstance(field, ShadowingFit):
        yield Row("shadowing: sigma", field.deviation_db, "dB")
        yield Row("shadowing: correlation distance", field.correlation_m, "m")
        yield Row("noise from packet to packet", field.noise_db, "dB")
    else:
        yield Row("shadowing", None, "", field)
    yield from loss_rows(losses, fit.sequences.interval_s)


def loss_rows(losses: LossFit | str, interval_s: float) -> Iterator[Row]:
    """Losses, single and in bursts, of packets that are usually so long apart."""
    if isinstance(losses, str):
        yield Row("losses", None, "", losses)
        return
    yield Row("loss", losses.loss, "")
    bursts = losses.chosen.bursts
    if bursts is None:
        yield Row("bursts", None, "", "losses are no burstier than single ones")
        return
    for name in NAMES:
        error = losses.chosen.errors.get(name, math.nan)
        yield Row(WORDS[name], Estimate(getattr(bursts, name), error), "s" if name.endswith("_s") else "")
    turned = 1.0 - math.exp(-interval_s * (1.0 / bursts.bad_s + 1.0 / bursts.good_s))
    for name, share in (("p, good to bad", bursts.bad_share), ("r, bad to good", 1.0 - bursts.bad_share)):
        yield Row(f"{name} in {interval_s:.3g} s", Estimate(share * turned, math.nan), "")


def residual_rows(fit: RadioFit) -> Iterator[tuple[str, str]]:
    """What the line of path loss leaves, in words."""
    residual_db = fit.residual_db
    if len(residual_db):
        yield "root mean square", f"{float(np.sqrt(np.mean(residual_db**2))):.2f} dB"
        for share, value in zip(QUANTILES, np.quantile(residual_db, QUANTILES).tolist(), strict=True):
            yield f"{share:.0%} below", f"{value:+.2f} dB"
