"""From a scenario's radio to the numbers that events and links are computed with."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.air.decibels import from_db
from swarmwire.comms.air.frames import acknowledgement_bytes, airtime_ns
from swarmwire.comms.air.propagation.fading import fading_law
from swarmwire.comms.air.propagation.loss_curve import SPEED_OF_LIGHT_MPS
from swarmwire.comms.air.propagation.parameters import Bodies, Fading, Shadowing, Walls
from swarmwire.comms.air.propagation.path_loss import reach_m
from swarmwire.comms.air.propagation.scattering import scatter_waves
from swarmwire.comms.air.propagation.shadowing import amplitude_db, field_waves
from swarmwire.comms.air.radio import Radio
from swarmwire.comms.air.reception.reception import Receiver, receiver_of
from swarmwire.comms.air.reception.sensitivity import sensitivity_dbm, sinr_for_db
from swarmwire.comms.air.signal.link_table import Surroundings
from swarmwire.comms.air.signal.links_by_sender import Levels
from swarmwire.comms.air.signal.log_success import log_success_table
from swarmwire.comms.air.signal.parameters import METHODS
from swarmwire.comms.air.signal.tables import Rules
from swarmwire.comms.air.traffic.access_timing import IEEE_802_11A, IEEE_802_11B, IEEE_802_11G, IEEE_802_15_4
from swarmwire.comms.arrays import FloatArray, KeyArray
from swarmwire.comms.clock import to_ns

# What counts as sensitivity in data sheets: share of frames that are right, and their bytes (see `sensitivity_dbm`).
SHEETS = {"802.15.4": (0.99, 26), "802.11b": (0.92, 1024), "802.11ag": (0.9, 1000)}
SURE = 1.0 - 1e-12
SHADOWS_CUT_OFF = 2.5  # deviations of shadowing by which a link may be better than its path loss
DCF_OF = {"802.11a": IEEE_802_11A, "802.11b": IEEE_802_11B, "802.11g": IEEE_802_11G}


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


def rules_of(radio: Radio, robots: int) -> Rules:
    """What events go by."""
    reception, access, receiver = radio.reception_or_default, radio.access_or_default, receiver_for(radio)
    csma, dcf = IEEE_802_15_4, DCF_OF.get(radio.frame, IEEE_802_11B)
    is_dcf = access.method == "dcf"
    busy_dbm = access.busy_dbm
    if busy_dbm is None:
        busy_dbm = dcf.busy_energy_dbm if is_dcf else sensitivity_of(radio) + csma.busy_above_sensitivity_db
    retries = access.most_retries
    if retries is None:
        retries = dcf.most_retries if is_dcf else csma.most_retries
    answer_bytes = acknowledgement_bytes(radio)
    answer_ns = int(airtime_ns(radio, np.array([answer_bytes]))[0])
    short_space_ns = dcf.short_space_ns if is_dcf else csma.turnaround_ns
    dcf_patience_ns = short_space_ns + answer_ns + dcf.slot_ns
    # The standard's at its bit rate, and as long as an answer takes at a lower one.
    csma_patience_ns = max(csma.acknowledgement_wait_ns, short_space_ns + answer_ns + csma.backoff_ns)
    most_bits = 8 * (radio.max_payload_bytes + radio.overhead_bytes)
    return Rules(
        robots=robots,
        method=METHODS.index(access.method),
        acknowledged=access.acknowledges,
        queue_limit=radio.queue_limit,
        noise_mw=float(from_db(radio.noise_or_default.power_dbm)),
        least_sinr=float(from_db(reception.preamble_sinr_db)),
        least_mw=float(from_db(reception.preamble_dbm)),
        sure_sinr=float(from_db(sinr_for_db(receiver, SURE, most_bits))),
        take_over_ns=to_ns(reception.take_over_s),
        loss=radio.loss,
        busy_mw=float(from_db(busy_dbm)),
        retries=retries,
        short_space_ns=short_space_ns,
        acknowledgement_ns=answer_ns,
        acknowledgement_bits=8 * answer_bytes,
        patience_ns=dcf_patience_ns if is_dcf else csma_patience_ns,
        backoff_ns=csma.backoff_ns,
        listen_ns=csma.cca_ns,
        turnaround_ns=csma.turnaround_ns,
        least_exponent=csma.least_exponent,
        most_exponent=csma.most_exponent,
        most_backoffs=csma.most_backoffs,
        slot_ns=dcf.slot_ns,
        difs_ns=dcf.difs_ns,
        distrust_ns=dcf.short_space_ns + answer_ns,  # EIFS - DIFS: SIFS and an acknowledgement
        least_window=dcf.least_window,
        most_window=dcf.most_window,
        receiver=receiver,
        log_success=log_success_table(receiver),
    )


def levels_of(radio: Radio, rules: Rules) -> Levels:
    """What power makes of a link."""
    heard_mw = max(rules.least_mw, rules.least_sinr * rules.noise_mw)
    disturbs = radio.access_or_default.method != "none"
    return Levels(sensitivity_of(radio), heard_mw, cut_off_dbm(radio) if disturbs else np.inf)


def cut_off_dbm(radio: Radio) -> float:
    """The mean power below which a robot neither hears nor is disturbed."""
    return min(radio.noise_or_default.power_dbm, sensitivity_of(radio)) - radio.cut_off_db


def surroundings_of(
    radio: Radio, keys: KeyArray, radius_m: FloatArray, send_dbm: FloatArray, receive_dbi: FloatArray
) -> Surroundings:
    """What links go by; by robot row (rows,): radii, power and gain, and gain."""
    shadowing, walls, bodies, fading = radio.shadowing, radio.walls, radio.bodies, radio.fading
    curve = radio.loss_model.curve(radio.frequency_hz)
    law = fading_law(fading or Fading(), radio.frequency_hz, radio.propagation_mps or SPEED_OF_LIGHT_MPS)
    spread_db = max(SHADOWS_CUT_OFF * shadowing.deviation_db - radio.cut_off_db, 0.0) if shadowing else 0.0
    best_dbm = float(send_dbm.max() + receive_dbi.max())
    far_m = float(reach_m(curve, best_dbm - cut_off_dbm(radio) + spread_db))
    return Surroundings(
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
