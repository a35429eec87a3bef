"""How far a radio reaches, in short."""

# pyright: basic, reportUnknownMemberType=false

from swarmwire.comms.air.propagation.path_loss import reach_m
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.air.signal.numbers import sensitivity_of


def range_of(radio: Radio) -> float | None:
    """Nominal reach in m: where path loss alone leaves the sensitivity, or the disk's radius; never above `range_m`."""
    if not radio.is_signal:
        return radio.range_m
    antenna = radio.antenna_or_default
    most_db = antenna.power_dbm + 2.0 * antenna.gain_dbi - sensitivity_of(radio)
    found_m = float(reach_m(radio.loss_model.curve(radio.frequency_hz), most_db))
    return found_m if radio.range_m is None else min(found_m, radio.range_m)
