"""The levels of power at which a radio hears, is in range, and is disturbed; and how far that is."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.radio.config.path_loss_models import SPEED_OF_LIGHT_MPS, LossCurve
from swarmwire.comms.radio.config.phy import Bodies, Fading, Shadowing, Walls
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.propagation.fading import FadingModel, fading_model, scatter_waves
from swarmwire.comms.radio.propagation.path_loss import reach_m
from swarmwire.comms.radio.propagation.shadowing import amplitude_db, field_waves
from swarmwire.comms.radio.reception.receiver import Receiver, receiver_of, sensitivity_dbm
from swarmwire.comms.radio.stages.stage import ChannelContext

# What counts as sensitivity in data sheets: share of frames that are right, and their bytes (see `sensitivity_dbm`).
SENSOR_SPECS = {"802.15.4": (0.99, 26), "802.11b": (0.92, 1024), "802.11ag": (0.9, 1000)}


def receiver_for(radio: Radio) -> Receiver:
    """The receiver that the radio has."""
    return receiver_of(radio.reception_or_default, radio.bit_rate_bps)


def sensitivity_of(radio: Radio) -> float:
    """The least mean power in dBm that counts as in range: as given, or as data sheets state it for this receiver."""
    reception = radio.reception_or_default
    if reception.sensitivity_dbm is not None:
        return reception.sensitivity_dbm
    success, frame_bytes = SENSOR_SPECS.get(reception.model, (0.9, radio.max_payload_bytes + radio.overhead_bytes))
    of_bits_dbm = sensitivity_dbm(receiver_for(radio), radio.noise_or_default.power_dbm, success, 8 * frame_bytes)
    return max(of_bits_dbm, reception.preamble_dbm)  # without a preamble there are no bits


def range_of(radio: Radio) -> float | None:
    """Nominal reach in m: where path loss alone leaves the sensitivity, or the unit disk's radius.

    Never above `range_m`.
    """
    if not radio.is_phy:
        return radio.range_m
    antenna = radio.antenna_or_default
    most_db = antenna.power_dbm + 2.0 * antenna.gain_dbi - sensitivity_of(radio)
    found_m = float(reach_m(radio.loss_model.curve(radio.frequency_hz), most_db))
    return found_m if radio.range_m is None else min(found_m, radio.range_m)


def cut_off_dbm(radio: Radio) -> float:
    """The mean power below which a robot neither hears nor is disturbed."""
    return min(radio.noise_or_default.power_dbm, sensitivity_of(radio)) - radio.cut_off_db


# --- The surroundings of signals: propagation in numbers, as links are computed with.


SHADOWS_CUT_OFF = 2.5  # deviations of shadowing by which a link may be better than its path loss


class PropagationParams(NamedTuple):
    """Propagation in numbers."""

    send_dbm: FloatArray  # (rows,) transmit power and antenna gain
    receive_dbi: FloatArray  # (rows,) antenna gain
    curve: LossCurve
    reach_m: float  # no link is longer
    least_dbm: float  # no link is weaker, fading apart
    spread_db: float  # by how much shadowing may make up for path loss
    shadows: bool
    amplitude_db: float
    field: FloatArray  # (arenas, 3, n), as `field_waves` has them
    walls: bool
    crossing_db: float
    inside_db_per_m: float
    line_of_sight: bool
    bodies: bool
    body_db: float
    radius_m: FloatArray  # (rows,)
    most_radius_m: float
    fades: bool
    law: FadingModel
    scatter: FloatArray  # (arenas, 5, n), as `scatter_waves` has them


def propagation_params_of(radio: Radio, context: ChannelContext) -> PropagationParams:
    """What links go by: a radio, which may have other numbers than the medium's, under events."""
    send_dbm, receive_dbi = _antennas_of(radio, context)
    keys, radius_m = context.keys, context.radius_m
    shadowing, walls, bodies, fading = radio.shadowing, radio.walls, radio.bodies, radio.fading
    curve = radio.loss_model.curve(radio.frequency_hz)
    law = fading_model(fading or Fading(), radio.frequency_hz, radio.propagation_mps or SPEED_OF_LIGHT_MPS)
    spread_db = max(SHADOWS_CUT_OFF * shadowing.deviation_db - radio.cut_off_db, 0.0) if shadowing else 0.0
    best_dbm = float(send_dbm.max() + receive_dbi.max())
    far_m = float(reach_m(curve, best_dbm - cut_off_dbm(radio) + spread_db))
    return PropagationParams(
        send_dbm=send_dbm,
        receive_dbi=receive_dbi,
        curve=curve,
        reach_m=far_m if radio.range_m is None else min(far_m, radio.range_m),
        least_dbm=cut_off_dbm(radio),
        spread_db=spread_db,
        shadows=shadowing is not None,
        amplitude_db=amplitude_db(shadowing or Shadowing()),
        field=field_waves(keys, shadowing or Shadowing()),
        walls=walls is not None,
        crossing_db=(walls or Walls()).crossing_db,
        inside_db_per_m=(walls or Walls()).inside_db_per_m,
        line_of_sight=radio.needs_line_of_sight,
        bodies=bodies is not None,
        body_db=(bodies or Bodies()).crossing_db,
        radius_m=radius_m,
        most_radius_m=float(radius_m.max()),
        fades=fading is not None,
        law=law,
        scatter=np.array([scatter_waves(key, law.wave_number) for key in keys]),
    )


def _antennas_of(radio: Radio, context: ChannelContext) -> tuple[FloatArray, FloatArray]:
    """What each robot radiates in dBm, and the gain in dBi with which it hears, under events too, (rows,) each."""
    own, antenna, now, arenas = context.antennas, radio.antenna_or_default, context.disruption, len(context.keys)
    send_dbm = np.tile(own.send_dbm(antenna), arenas) + now.send_gain_db
    return send_dbm, np.tile(own.receive_dbi(antenna), arenas) + now.receive_gain_db
