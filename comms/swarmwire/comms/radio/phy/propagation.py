"""Power levels of a radio and its propagation parameters: sensitivity, cut-off, nominal range, and inputs of links.

Sensitivity is the least mean power of a receiver in range. A signal below the cut-off is neither received nor
interference.
"""

import math
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.radio.config.frames import range_rate_bps
from swarmwire.comms.radio.config.path_loss_models import SPEED_OF_LIGHT_MPS, LossCurve
from swarmwire.comms.radio.config.phy import Bodies, Fading, Shadowing, Walls
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.phy.spreading import spreading_of
from swarmwire.comms.radio.propagation.antennas import AntennaPatterns, antenna_patterns
from swarmwire.comms.radio.propagation.fading import FadingModel, fading_model, scatter_waves
from swarmwire.comms.radio.propagation.path_loss import lifted, reach_m
from swarmwire.comms.radio.propagation.shadowing import amplitude_db, field_waves
from swarmwire.comms.radio.reception.receiver import Receiver, receiver_of, sensitivity_dbm

# Frame success rate and frame size in bytes at which data sheets state the sensitivity (see `sensitivity_dbm`).
DATA_SHEET_SENSITIVITY = {
    "802.15.4": (0.99, 26),
    "802.11b": (0.92, 1024),
    "802.11ag": (0.9, 1000),
    "802.11ag-nist": (0.9, 1000),
}


def receiver_for(radio: Radio) -> Receiver:
    """Return the receiver of a radio, at the bit rate that reaches farthest."""
    return receiver_of(radio.reception_or_default, range_rate_bps(radio))


def sensitivity_of(radio: Radio) -> float:
    """Return the lowest mean power in dBm of a receiver in range: configured, or derived as in data sheets.

    It is at least the power at which preambles are detected.
    """
    reception, noise_dbm = radio.reception_or_default, radio.detector_noise_dbm
    bits_dbm = reception.sensitivity_dbm
    if bits_dbm is None:
        success, frame_bytes = DATA_SHEET_SENSITIVITY.get(
            reception.model, (0.9, radio.max_payload_bytes + radio.overhead_bytes)
        )
        bits_dbm = sensitivity_dbm(receiver_for(radio), noise_dbm, success, 8 * frame_bytes)
    return max(bits_dbm, reception.preamble_dbm, noise_dbm + reception.preamble_sinr_db)


def range_of(radio: Radio) -> float | None:
    """Return the nominal range in m: the distance at which path loss alone reaches the sensitivity, or the unit disk's.

    It is at most `range_m`, and that of robots on the floor whose antennas point at each other.
    """
    if not radio.is_phy:
        return radio.range_m
    antenna = radio.antenna_or_default
    max_loss_db = antenna.power_dbm + 2.0 * antenna.peak_dbi - sensitivity_of(radio)
    range_m = float(reach_m(radio.path_loss_model.curve(radio.frequency_hz), max_loss_db))
    return range_m if radio.range_m is None else min(range_m, radio.range_m)


def cut_off_dbm(radio: Radio) -> float:
    """Return the mean power in dBm below which a signal is neither received nor interference."""
    return min(radio.detector_noise_dbm, sensitivity_of(radio)) - radio.cut_off_db


SHADOWING_MARGIN = 2.5  # standard deviations of shadowing that a link may gain over its path loss


class PropagationParams(NamedTuple):
    """Propagation parameters as numbers for kernels."""

    send_dbm: FloatArray  # (rows,) transmit power and antenna gain in the main direction
    receive_dbi: FloatArray  # (rows,) antenna gain in the main direction
    directs: bool  # the gain of some antenna depends on the direction
    patterns: AntennaPatterns
    curve: LossCurve
    max_loss_db: float  # no link has a greater path loss
    range_m: float  # no link is longer; inf: any distance
    reach_m: float  # the least of both, between robots on the floor
    min_dbm: float  # no link is weaker, without fading
    spread_db: float  # shadowing gain that may offset path loss
    shadows: bool
    amplitude_db: float
    field: FloatArray  # (arenas, 3, n), see `field_waves`
    walls: bool
    crossing_db: float
    inside_db_per_m: float
    line_of_sight: bool
    bodies: bool
    body_db: float
    radius_m: FloatArray  # (rows,)
    height_m: FloatArray  # (rows,)
    fades: bool
    fading_model: FadingModel
    scatter: FloatArray  # (arenas, 5, n), see `scatter_waves`

    def up_to(self, z: float) -> "PropagationParams":
        """Return the parameters for robots at heights up to z in m: the reach of two-ray grows with the heights."""
        return self._replace(reach_m=_reach_m(lifted(self.curve, z, z), self.max_loss_db, self.range_m))


def propagation_params_of(radio: Radio, context: ChannelContext) -> PropagationParams:
    """Return the parameters of the links of `radio`, which may be tuned, under the active disruption."""
    send_dbm, receive_dbi = _antennas_of(radio, context)
    keys, antennas = context.keys, context.antennas.by_group(radio.antenna_or_default)
    groups = np.arange(len(antennas))
    shadowing, walls, bodies, fading = radio.shadowing, radio.walls, radio.bodies, radio.fading
    curve = radio.path_loss_model.curve(radio.frequency_hz)
    model = fading_model(fading or Fading(), radio.frequency_hz, radio.propagation_mps or SPEED_OF_LIGHT_MPS)
    spread_db = max(SHADOWING_MARGIN * shadowing.deviation_db - radio.cut_off_db, 0.0) if shadowing else 0.0
    best_dbm = float(send_dbm.max() + receive_dbi.max())
    max_loss_db = best_dbm - cut_off_dbm(radio) + spread_db
    range_m = math.inf if radio.range_m is None else radio.range_m
    return PropagationParams(
        send_dbm=send_dbm,
        receive_dbi=receive_dbi,
        directs=any(antenna.is_directional for antenna in antennas),
        patterns=antenna_patterns(antennas, np.tile(np.repeat(groups, context.antennas.counts), len(keys))),
        curve=curve,
        max_loss_db=max_loss_db,
        range_m=range_m,
        reach_m=_reach_m(curve, max_loss_db, range_m),
        min_dbm=cut_off_dbm(radio),
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
        radius_m=context.radius_m,
        height_m=context.height_m,
        fades=fading is not None,
        fading_model=model,
        scatter=np.array([scatter_waves(key, model.wave_number) for key in keys]),
    )


def _reach_m(curve: LossCurve, max_loss_db: float, range_m: float) -> float:
    return min(float(reach_m(curve, max_loss_db)), range_m)


def _antennas_of(radio: Radio, context: ChannelContext) -> tuple[FloatArray, FloatArray]:
    """Return radiated power in dBm and receive gain in dBi of each robot, with the gains of events, (rows,) each.

    The receive gain contains the despreading gain of robots with a spreading factor of their own.
    """
    antennas, antenna, disruption = context.antennas, radio.antenna_or_default, context.disruption
    arenas = len(context.keys)
    send_dbm = np.tile(antennas.send_dbm(antenna), arenas) + disruption.send_gain_db
    receive_dbi = np.tile(antennas.receive_dbi(antenna), arenas) + disruption.receive_gain_db
    spreading = spreading_of(radio, context)
    return send_dbm, receive_dbi if spreading is None else receive_dbi + spreading.gain_db
