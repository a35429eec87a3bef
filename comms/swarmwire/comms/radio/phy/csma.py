"""Unslotted CSMA/CA of IEEE 802.15.4: random backoff, clear channel assessment (CCA), turnaround, then the frame.

After a busy CCA the backoff exponent BE grows, up to macMaxBE. More than macMaxCSMABackoffs busy CCAs (NB) end the
attempt as a channel access failure.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.draws_compiled import uniform
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import NO_ROBOT
from swarmwire.comms.radio.phy import reception
from swarmwire.comms.radio.phy.event_queue import CCA_END, SEND, TIMER, schedule
from swarmwire.comms.radio.phy.state import BACKING_OFF, SENSING, SILENT, TURNAROUND

BACKOFF = purpose("csma backoff")


@kernel()
def request_access(params, state, events, r, now_ns):
    """Start channel access for the packet being served: NB = 0, BE = macMinBE."""
    robot = state.robot[r]
    robot.nb, robot.exponent = 0, params.min_be
    _back_off(params, state, events, r, now_ns)


@kernel()
def start_cca(params, state, events, r, now_ns):
    """Assess the channel for `cca_ns` after a backoff."""
    state.robot[r].mac_state = SENSING
    state.reception[r].peak_mw = 0.0
    schedule(events, CCA_END, r, now_ns + params.cca_ns)


@kernel()
def end_cca(params, state, events, r, now_ns):
    """Turn around to send after an idle CCA, or back off again; return True on channel access failure.

    The rules are ns-3's: the channel is busy while the receiver is locked to a frame, however weak (BUSY_RX), and by
    energy if a frame began during the CCA or is on air at its end. Frames that ended during the CCA do not count.
    """
    robot, rx = state.robot[r], state.reception[r]
    is_receiving = rx.locked_to != NO_ROBOT
    has_energy = max(rx.peak_mw, rx.power_mw) + rx.jam_mw >= params.cca_ed_mw
    if not (is_receiving or has_energy) and robot.on_air == SILENT:
        robot.mac_state = TURNAROUND
        reception.stop_receiving(state, r)
        schedule(events, SEND, r, now_ns + params.turnaround_ns)
        return False
    robot.nb += 1
    robot.exponent = min(robot.exponent + 1, params.max_be)
    if robot.nb > params.max_backoffs:
        return True
    _back_off(params, state, events, r, now_ns)
    return False


@kernel()
def _back_off(params, state, events, r, now_ns):
    """Wait U{0 .. 2^BE - 1} backoff periods, keyed by (robot, sequence, attempt and NB)."""
    robot = state.robot[r]
    robot.mac_state = BACKING_OFF
    sequence, attempt = state.packet[robot.packet].sequence, 16 * robot.attempt + robot.nb
    u = uniform(state.keys[r // params.robots], r % params.robots, sequence, attempt, BACKOFF)
    schedule(events, TIMER, r, now_ns + np.int64(u * 2**robot.exponent) * params.backoff_ns)
