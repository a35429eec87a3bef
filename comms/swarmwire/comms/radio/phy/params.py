"""Parameters of the PHY's event simulation, derived once from the radio and the standards' timing."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.clock import to_ns
from swarmwire.comms.radio.config.frames import (
    acknowledgement_bytes,
    acknowledgement_ns,
    acknowledgement_rate_bps,
    broadcast_rate_bps,
    dcf_of,
    eifs_acknowledgement_ns,
    range_rate_bps,
)
from swarmwire.comms.radio.config.phy import METHODS, Reception
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.phy.duty_cycle import allowance_ns
from swarmwire.comms.radio.phy.ht.params import HT_RATES_BPS, HtParams, ht_params_of
from swarmwire.comms.radio.phy.link_table import Thresholds
from swarmwire.comms.radio.phy.propagation import cut_off_dbm, sensitivity_of
from swarmwire.comms.radio.phy.spreading import Spreading
from swarmwire.comms.radio.phy.success import log_success_table
from swarmwire.comms.radio.propagation.decibels import from_db
from swarmwire.comms.radio.reception.receiver import Receiver, receiver_of, sinr_for_db
from swarmwire.comms.radio.timing import ESB, IEEE_802_15_4, lora_cad

CERTAIN = 1.0 - 1e-12
FOREVER_NS = 2**62


class PhyParams(NamedTuple):
    """The radio as numbers for kernels; powers in mW, times in ns, SINR as a ratio."""

    robots: int  # robots per arena
    method: int  # index in METHODS
    acknowledged: bool
    queue_limit: int
    queue_lifetime_ns: int  # packets that waited longer are dropped
    noise_mw: float
    min_preamble_sinr: float  # lowest SINR of a detected preamble
    min_preamble_mw: float  # lowest power of a detected preamble
    error_free_sinr: float  # least SINR at which no bit is wrong
    lead_ns: IntArray  # (robots,) start of a frame that neither disturbs others nor is disturbed
    allowance_ns: int  # airtime of a robot within an hour
    capture_window_ns: int  # time after a frame's start in which a stronger frame can capture the receiver
    cca_ed_mw: float  # CCA energy detection threshold
    max_retries: int
    # Acknowledgements.
    sifs_ns: int
    ack_airtime_ns: int
    ack_bits: int
    ack_timeout_ns: int
    # CSMA.
    backoff_ns: int
    cca_ns: int
    turnaround_ns: int
    min_be: int
    max_be: int
    max_backoffs: int
    # DCF.
    cca_sensitivity_mw: float  # least power of a frame that makes the medium busy, received or not
    cca_time_ns: int  # delay between a change on the medium and its report by carrier sense
    slot_ns: int
    difs_ns: int
    eifs_extra_ns: int  # EIFS - DIFS
    data_duration_ns: int  # Duration of a data frame to one robot
    cw_min: int
    cw_max: int
    receiver: Receiver
    log_success: FloatArray  # tables of `log_success_table`, (bit rates, rows)
    # Rows in it.
    data_rate: int
    broadcast_rate: int
    ack_rate: int
    ht: HtParams | None  # only of radios of 802.11n


def phy_params_of(radio: Radio, robots: int, spreading: Spreading | None = None) -> PhyParams:
    """Return the PHY parameters of a radio; each arena has `robots` robots, which may have different `spreading`."""
    reception, access = radio.reception_or_default, radio.access_or_default
    receiver = receiver_of(reception, radio.bit_rate_bps)
    lora, method = radio.lora_or_none, access.method
    lead_ns = 0 if lora is None or method == "none" else lora.lead_ns
    csma, dcf = IEEE_802_15_4, dcf_of(radio)
    if lora is not None and method == "cad":  # the procedure of CSMA/CA with other numbers
        csma, method = lora_cad(lora.symbol_ns, lead_ns), "csma-802154"
    is_dcf, is_esb = access.method == "dcf", access.method == "esb"
    cca_threshold_dbm = access.cca_threshold_dbm
    if cca_threshold_dbm is None:
        cca_threshold_dbm = dcf.cca_ed_dbm if is_dcf else sensitivity_of(radio) + csma.cca_ed_above_sensitivity_db
    cca_sensitivity_dbm = access.cca_sensitivity_dbm
    if cca_sensitivity_dbm is None:
        cca_sensitivity_dbm = dcf.cca_sensitivity_dbm
    max_retries = access.max_retries
    if max_retries is None:
        max_retries = (dcf if is_dcf else ESB if is_esb else csma).max_retries
    ack_bytes = acknowledgement_bytes(radio)
    ack_ns = acknowledgement_ns(radio)
    turnaround_ns = ESB.turnaround_ns if is_esb else csma.turnaround_ns
    sifs_ns = dcf.sifs_ns if is_dcf else turnaround_ns
    sets_nav = is_dcf and access.acknowledges
    esb_timeout_ns = ESB.ard_ns(radio.bit_rate_bps)
    dcf_timeout_ns = sifs_ns + ack_ns + dcf.slot_ns
    # The standard's value at its bit rate; longer where an acknowledgement at a lower bit rate takes longer.
    csma_timeout_ns = max(csma.ack_wait_ns, sifs_ns + ack_ns + csma.backoff_ns)
    is_ht = radio.frame == "802.11n"
    ack_rate_bps, broadcast_bps = acknowledgement_rate_bps(radio), broadcast_rate_bps(radio)
    rates_bps = HT_RATES_BPS if is_ht else (radio.bit_rate_bps, broadcast_bps, ack_rate_bps)
    max_bits = 8 * (radio.max_payload_bytes + radio.overhead_bytes)
    return PhyParams(
        robots=robots,
        method=METHODS.index(method),
        acknowledged=access.acknowledges,
        queue_limit=radio.queue_limit,
        queue_lifetime_ns=FOREVER_NS if radio.queue_lifetime_s is None else to_ns(radio.queue_lifetime_s),
        noise_mw=float(from_db(radio.detector_noise_dbm)),
        min_preamble_sinr=float(from_db(reception.preamble_sinr_db)),
        min_preamble_mw=float(from_db(reception.preamble_dbm)),
        error_free_sinr=float(from_db(sinr_for_db(receiver, CERTAIN, max_bits))),
        lead_ns=np.full(robots, lead_ns) if spreading is None or lead_ns == 0 else spreading.lead_ns,
        allowance_ns=allowance_ns(radio),
        capture_window_ns=to_ns(reception.capture_window_s),
        cca_ed_mw=float(from_db(cca_threshold_dbm)),
        max_retries=max_retries,
        sifs_ns=sifs_ns,
        ack_airtime_ns=ack_ns,
        ack_bits=8 * ack_bytes,
        ack_timeout_ns=dcf_timeout_ns if is_dcf else esb_timeout_ns if is_esb else csma_timeout_ns,
        backoff_ns=csma.backoff_ns,
        cca_ns=csma.cca_ns,
        turnaround_ns=turnaround_ns,
        min_be=csma.min_be,
        max_be=csma.max_be,
        max_backoffs=csma.max_backoffs,
        cca_sensitivity_mw=float(from_db(cca_sensitivity_dbm)),
        cca_time_ns=dcf.cca_time_ns if access.cca_time_s is None else to_ns(access.cca_time_s),
        slot_ns=dcf.slot_ns,
        difs_ns=dcf.difs_ns,
        eifs_extra_ns=dcf.sifs_ns + eifs_acknowledgement_ns(radio),  # EIFS - DIFS: SIFS and an acknowledgement
        data_duration_ns=sifs_ns + ack_ns if sets_nav else 0,
        cw_min=dcf.cw_min,
        cw_max=dcf.cw_max,
        receiver=receiver,
        log_success=np.array([_log_success_at(reception, rate_bps) for rate_bps in rates_bps]),
        data_rate=rates_bps.index(range_rate_bps(radio)),
        broadcast_rate=rates_bps.index(broadcast_bps),
        ack_rate=rates_bps.index(ack_rate_bps),
        ht=ht_params_of(radio) if is_ht else None,
    )


@lru_cache(maxsize=32)  # a table takes 4 ms, and most radios have the same bit rate several times
def _log_success_at(reception: Reception, rate_bps: int) -> FloatArray:
    table = log_success_table(receiver_of(reception, rate_bps))
    table.setflags(write=False)
    return table


def thresholds_of(radio: Radio, params: PhyParams) -> Thresholds:
    """Return the power thresholds of links; without interference (access "none") there are no weak links."""
    receivable_mw = max(params.min_preamble_mw, params.min_preamble_sinr * params.noise_mw)
    interferes = radio.access_or_default.method != "none"
    return Thresholds(sensitivity_of(radio), receivable_mw, cut_off_dbm(radio) if interferes else np.inf)
