"""The levels of power at which a radio hears, is in range, and is disturbed; and how far that is."""

# pyright: basic, reportUnknownMemberType=false

from swarmwire.comms.air.propagation.path_loss import reach_m
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.air.reception.receiver import Receiver, receiver_of
from swarmwire.comms.air.reception.sensitivity import sensitivity_dbm

# What counts as sensitivity in data sheets: share of frames that are right, and their bytes (see `sensitivity_dbm`).
SHEETS = {"802.15.4": (0.99, 26), "802.11b": (0.92, 1024), "802.11ag": (0.9, 1000)}


def receiver_for(radio: Radio) -> Receiver:
    """The receiver that the radio has."""
    return receiver_of(radio.reception_or_default, radio.bit_rate_bps)


def sensitivity_of(radio: Radio) -> float:
    """The least mean power in dBm that counts as in range: as given, or as data sheets state it for this receiver."""
    reception = radio.reception_or_default
    if reception.sensitivity_dbm is not None:
        return reception.sensitivity_dbm
    success, frame_bytes = SHEETS.get(reception.model, (0.9, radio.max_payload_bytes + radio.overhead_bytes))
    of_bits_dbm = sensitivity_dbm(receiver_for(radio), radio.noise_or_default.power_dbm, success, 8 * frame_bytes)
    return max(of_bits_dbm, reception.preamble_dbm)  # without a preamble there are no bits


def range_of(radio: Radio) -> float | None:
    """Nominal reach in m: where path loss alone leaves the sensitivity, or the disk's radius; never above `range_m`."""
    if not radio.is_signal:
        return radio.range_m
    antenna = radio.antenna_or_default
    most_db = antenna.power_dbm + 2.0 * antenna.gain_dbi - sensitivity_of(radio)
    found_m = float(reach_m(radio.loss_model.curve(radio.frequency_hz), most_db))
    return found_m if radio.range_m is None else min(found_m, radio.range_m)


def cut_off_dbm(radio: Radio) -> float:
    """The mean power below which a robot neither hears nor is disturbed."""
    return min(radio.noise_or_default.power_dbm, sensitivity_of(radio)) - radio.cut_off_db
