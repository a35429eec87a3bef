"""A fit as the scenario's table `[radio]`: the one place that knows under which keys a scenario has what was fitted."""

from typing import Any

from swarmwire.comms.radio.config.path_loss_models import LogDistance
from swarmwire.comms.radio.config.phy import Antenna, Shadowing
from swarmwire.metrics.radio_fit.loss_fit import NAMES, LossFit
from swarmwire.metrics.radio_fit.path_loss_fit import PathLossFit
from swarmwire.metrics.radio_fit.radio_fit import RadioFit
from swarmwire.metrics.radio_fit.shadowing_fit import ShadowingFit

DIGITS = 4


def radio_table(fit: RadioFit, antenna: Antenna) -> dict[str, Any]:
    """`{"radio": {...}}` with what could be fitted, and nothing for the rest.

    RSSI tell power, gains and reference loss only in sum: the antenna is the one that the robots are said to have had.
    """
    radio: dict[str, Any] = {}
    tables: dict[str, Any] = {}
    if isinstance(fit.path_loss, PathLossFit):
        sent_dbm = antenna.power_dbm + 2.0 * antenna.gain_dbi
        line = LogDistance(fit.path_loss.exponent.value, sent_dbm - fit.path_loss.rssi_at_1_m_dbm.value)
        radio["model"] = "log-distance"
        tables["log_distance"] = _table(line, ("exponent", "reference_loss_db"))
        tables["antenna"] = _table(antenna, ("power_dbm", "gain_dbi"))
    if isinstance(fit.shadowing, ShadowingFit):
        field = Shadowing(fit.shadowing.deviation_db.value, fit.shadowing.correlation_m.value)
        tables["shadowing"] = _table(field, ("deviation_db", "correlation_m"))
    return {"radio": {**radio, **tables, **loss_table(fit.losses)}}


def loss_table(losses: LossFit | str) -> dict[str, Any]:
    """`loss`, or the table `bursts`, by what the data speak for; nothing where losses could not be fitted."""
    if isinstance(losses, str):
        return {}
    bursts = losses.chosen.bursts
    return {"loss": rounded(losses.loss.value)} if bursts is None else {"bursts": _table(bursts, NAMES)}


def _table(parameters: object, keys: tuple[str, ...]) -> dict[str, float]:
    return {key: rounded(getattr(parameters, key)) for key in keys}


def rounded(value: float) -> float:
    """As many digits as any fit can mean."""
    return float(f"{value:.{DIGITS}g}")
