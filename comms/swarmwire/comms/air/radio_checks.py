"""Checks of a radio that need more than one key: contradictions are refused with the key that makes them."""

from swarmwire.comms.air.parameters.delays import refuse_negative
from swarmwire.comms.air.parameters.propagation import Fading
from swarmwire.comms.air.parameters.reception import Reception, refuse_unfit
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.air.timing.airtime import DSSS_RATES_BPS, OFDM_BITS_PER_SYMBOL
from swarmwire.comms.errors import BadInput

OF_SIGNALS = ("antenna", "shadowing", "walls", "bodies", "fading", "noise", "reception", "access")
OF_MODELS = {"log_distance": "log-distance", "two_ray": "two-ray", "itu_indoor": "itu-indoor"}
RECEPTIONS = {"802.11a": "802.11ag", "802.11b": "802.11b", "802.11g": "802.11ag"}  # beside threshold and table
RATES_BPS = {
    "802.11a": tuple(OFDM_BITS_PER_SYMBOL),
    "802.11b": DSSS_RATES_BPS,
    "802.11g": tuple(OFDM_BITS_PER_SYMBOL),
}


def check_radio(radio: Radio, where: str) -> None:
    """Raise BadInput for the first contradiction in a scenario's [radio]."""
    for name, model in OF_MODELS.items():
        if getattr(radio, name) is not None and radio.model != model:
            raise BadInput(where, f"radio.{name}", f'expected model = "{model}" with it, got "{radio.model}"')
    if radio.is_signal:
        _check_signal(radio, where)
    else:
        _check_disk(radio, where)
    if radio.bursts is not None and radio.bursts.loss_bad < radio.bursts.loss_good:
        expected = f"expected at least loss_good, {radio.bursts.loss_good:g}; got {radio.bursts.loss_bad:g}"
        raise BadInput(where, "radio.bursts.loss_bad", expected)
    if radio.delays is not None:
        refuse_negative(radio.delays, where, "radio.delays")
    rates_bps = RATES_BPS.get(radio.frame, (radio.bit_rate_bps,))
    if radio.bit_rate_bps not in rates_bps:
        listed = ", ".join(str(rate_bps) for rate_bps in rates_bps)
        raise BadInput(where, "radio.bit_rate_bps", f"{radio.frame} has {listed}; got {radio.bit_rate_bps} bit/s")
    if radio.is_signal:
        _check_fits(radio, where)


def unfit_for_torus(radio: Radio) -> str | None:
    """The key by which a radio cannot be that of a torus, if any: only a disk's distances are known across its seam."""
    return "model" if radio.is_signal else "bodies_block" if radio.bodies_block else None


def _check_disk(radio: Radio, where: str) -> None:
    if radio.range_m is None:
        raise BadInput(where, "radio.range_m", "is missing; expected a number above 0 (m), as the model disk has one")
    for name in OF_SIGNALS:
        if getattr(radio, name) is not None:
            raise BadInput(where, f"radio.{name}", "expected a model with signals: a disk knows no strength")
    if radio.gives.rssi is not None:
        raise BadInput(where, "radio.gives.rssi", "expected a model with signals: a disk knows no strength")
    if radio.cut_off_db != Radio.cut_off_db:
        raise BadInput(where, "radio.cut_off_db", "expected a model with signals: a disk knows no strength")


def _check_signal(radio: Radio, where: str) -> None:
    refuse_unfit(radio.reception_or_default, radio.bit_rate_bps, where, "radio.reception")
    if radio.bodies_block:
        raise BadInput(where, "radio.bodies_block", "expected the model disk with it; signals have radio.bodies")
    if radio.walls is not None and radio.needs_line_of_sight:
        raise BadInput(where, "radio.walls", "expected no line_of_sight with it: obstacles either block or weaken")
    if radio.access_or_default.method == "dcf" and radio.frame == "plain":
        raise BadInput(where, "radio.access.method", 'expected a frame of IEEE 802.11 for "dcf", such as 802.11b')
    if radio.access_or_default.method == "csma-802154" and radio.frame != "plain":
        raise BadInput(where, "radio.access.method", f'expected frame = "plain" for "csma-802154", got {radio.frame}')


def _check_fits(radio: Radio, where: str) -> None:
    """Raise BadInput for what the chosen access, reception, frame or fading has no use for."""
    access, reception, fading = radio.access_or_default, radio.reception_or_default, radio.fading
    for name in ("busy_dbm", "most_retries"):
        if getattr(access, name) is not None and access.method not in ("csma-802154", "dcf"):
            raise BadInput(
                where, f"radio.access.{name}", f'expected method csma-802154 or dcf with it, got "{access.method}"'
            )
    fits = ("threshold", "table", RECEPTIONS.get(radio.frame, reception.model))
    if reception.model not in fits:
        expected = f"expected one of {', '.join(fits)} for frames of {radio.frame}; got {reception.model}"
        raise BadInput(where, "radio.reception.model", expected)
    given = {
        "reception.table": (reception.table is not None, reception.model, "table"),
        "reception.least_sinr_db": (reception.least_sinr_db != Reception.least_sinr_db, reception.model, "threshold"),
    }
    if fading is not None:
        given["fading.k"] = fading.k != Fading.k, fading.distribution, "rician"
        given["fading.m"] = fading.m != Fading.m, fading.distribution, "nakagami"
    for key, (is_given, chosen, needed) in given.items():
        if is_given and chosen != needed:
            raise BadInput(where, f"radio.{key}", f'expected "{needed}" with it, got "{chosen}"')
