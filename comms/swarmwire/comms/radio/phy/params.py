"""The rules of the run of events: the radio in numbers."""

# pyright: basic, reportUnknownMemberType=false

from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.clock import to_ns
from swarmwire.comms.radio.config.phy import METHODS
from swarmwire.comms.radio.config.radio import Radio, acknowledgement_bytes, airtime_ns
from swarmwire.comms.radio.phy.link_table import Thresholds
from swarmwire.comms.radio.phy.propagation import cut_off_dbm, receiver_for, sensitivity_of
from swarmwire.comms.radio.phy.reception import log_success_table
from swarmwire.comms.radio.propagation.decibels import from_db
from swarmwire.comms.radio.reception.receiver import Receiver, sinr_for_db
from swarmwire.comms.radio.timing import IEEE_802_11A, IEEE_802_11B, IEEE_802_11G, IEEE_802_15_4

SURE = 1.0 - 1e-12
DCF_OF = {"802.11a": IEEE_802_11A, "802.11b": IEEE_802_11B, "802.11g": IEEE_802_11G}


class PhyParams(NamedTuple):
    """The radio in numbers; powers in mW, times in ns."""

    robots: int  # in each arena
    method: int  # a place in METHODS
    acknowledged: bool
    queue_limit: int
    noise_mw: float
    least_sinr: float  # that a preamble needs
    least_mw: float  # that a preamble needs
    sure_sinr: float  # from here on all bits are right
    take_over_ns: int  # how long after its start a frame gives way to a stronger one
    busy_mw: float
    retries: int
    # Acknowledgements.
    short_space_ns: int
    acknowledgement_ns: int  # airtime
    acknowledgement_bits: int
    patience_ns: int  # how long an acknowledgement is waited for
    # CSMA.
    backoff_ns: int
    listen_ns: int
    turnaround_ns: int
    least_exponent: int
    most_exponent: int
    most_backoffs: int
    # DCF.
    slot_ns: int
    difs_ns: int
    distrust_ns: int  # EIFS - DIFS
    least_window: int
    most_window: int
    receiver: Receiver
    log_success: FloatArray  # by SINR, as `log_success_table` has it


def phy_params_of(radio: Radio, robots: int) -> PhyParams:
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
    return PhyParams(
        robots=robots,
        method=METHODS.index(access.method),
        acknowledged=access.acknowledges,
        queue_limit=radio.queue_limit,
        noise_mw=float(from_db(radio.noise_or_default.power_dbm)),
        least_sinr=float(from_db(reception.preamble_sinr_db)),
        least_mw=float(from_db(reception.preamble_dbm)),
        sure_sinr=float(from_db(sinr_for_db(receiver, SURE, most_bits))),
        take_over_ns=to_ns(reception.take_over_s),
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


def thresholds_of(radio: Radio, rules: PhyParams) -> Thresholds:
    """What power makes of a link."""
    received_mw = max(rules.least_mw, rules.least_sinr * rules.noise_mw)
    disturbs = radio.access_or_default.method != "none"
    return Thresholds(sensitivity_of(radio), received_mw, cut_off_dbm(radio) if disturbs else np.inf)
