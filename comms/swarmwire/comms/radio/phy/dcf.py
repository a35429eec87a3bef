"""DCF of IEEE 802.11: a station sends after the medium was idle for DIFS and for its backoff slots.

A station that finds the medium idle sends after DIFS, as in ns-3; the standard allows it to send at once. Each frame is
followed by a new backoff. Remaining slots freeze while the medium is busy and count on when it is idle again. After a
frame that was not decoded the medium counts as busy for EIFS (IEEE 802.11-2007, 9.2.3.4 and 9.2.5).

Virtual carrier sense: a data frame to one robot has a Duration, SIFS and the acknowledgement. Every other station that
decodes the frame sets its network allocation vector (NAV) to it and counts the medium as busy until then, also where it
cannot hear the acknowledgement (IEEE 802.11-2020, 10.3.2.4). Acknowledgements and broadcasts have the Duration 0.

A station senses a change only `cca_time_ns` after it (aCCATime): until then its slots count on, and if its backoff
ends, its frame overlaps the other. The receiver does not have this delay.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.draws_compiled import uniform
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import NO_ROBOT
from swarmwire.comms.radio.config.phy import METHODS
from swarmwire.comms.radio.phy.event_queue import SEND, cancel, due_ns, schedule
from swarmwire.comms.radio.phy.state import BACKING_OFF

DCF = METHODS.index("dcf")
SLOTS, SLOTS_BEFORE = purpose("dcf slots"), purpose("dcf slots before sending")


@kernel()
def request_access(params, state, events, r, now_ns):
    """Start channel access for the packet being served."""
    robot = state.robot[r]
    robot.mac_state = BACKING_OFF
    if state.reception[r].is_busy:
        return
    counted_ns = robot.free_from_ns + params.difs_ns + robot.backoff_slots * params.slot_ns
    if robot.backoff_slots == 0 or counted_ns <= now_ns:
        counted_ns = max(now_ns, robot.free_from_ns) + params.difs_ns
    schedule(events, SEND, r, counted_ns)


@kernel()
def defer(params, state, events, r, now_ns):
    """Draw a backoff for a packet that finds the medium busy and the last backoff completed (9.2.5.1)."""
    robot = state.robot[r]
    is_busy = state.reception[r].is_busy or now_ns < robot.nav_until_ns
    if robot.mac_state == BACKING_OFF and is_busy and robot.backoff_slots == 0:
        robot.backoff_slots = _backoff_slots(params, state, r, SLOTS_BEFORE)
        request_access(params, state, events, r, now_ns)


@kernel(inline="always")
def reception_ended(params, robot, r, s, is_decoded, now_ns):
    """Start EIFS at robot r after a frame of robot s that it did not decode, or end EIFS and extend the NAV."""
    if is_decoded:
        robot[r].eifs_until_ns = 0
        if robot[s].to != r:
            robot[r].nav_until_ns = max(robot[r].nav_until_ns, now_ns + robot[s].duration_ns)
    else:
        robot[r].eifs_until_ns = now_ns + params.eifs_extra_ns


@kernel(inline="always")
def sense(params, state, events, r, now_ns):
    """Update carrier sense after a change of the power at the robot; no effect under other access methods.

    The sensitivity applies to the sum of all frames on air, with or without a detected preamble, as in ns-3. IEEE
    802.11-2007, 17.3.10.5, allows 20 dB more for frames whose preamble was missed.
    """
    if params.method == DCF:
        rx = state.reception[r]
        is_energy = (rx.power_mw >= params.cca_sensitivity_mw) | (rx.power_mw + rx.jam_mw >= params.cca_ed_mw)
        is_busy = rx.is_deaf or rx.locked_to != NO_ROBOT or is_energy
        if is_busy != (rx.is_busy != 0):
            _change(params, state, events, r, now_ns)


@kernel()
def _change(params, state, events, r, now_ns):
    """Toggle carrier sense: freeze the backoff of a busy medium, or resume it."""
    robot, reception = state.robot[r], state.reception[r]
    reception.is_busy = not reception.is_busy
    if reception.is_busy:
        sensed_ns = now_ns + params.cca_time_ns
        counted = (sensed_ns - robot.free_from_ns - params.difs_ns) // params.slot_ns
        robot.backoff_slots = max(robot.backoff_slots - max(counted, 0), 0)
        if robot.mac_state == BACKING_OFF and due_ns(events, SEND, r) > sensed_ns:
            cancel(events, SEND, r)
    else:
        robot.free_from_ns = max(now_ns, robot.eifs_until_ns, robot.nav_until_ns)
        if robot.mac_state == BACKING_OFF:
            schedule(events, SEND, r, robot.free_from_ns + params.difs_ns + robot.backoff_slots * params.slot_ns)


@kernel()
def draw_backoff(params, state, r):
    """Draw the backoff that follows the robot's frame, keyed by (robot, sequence, attempt)."""
    robot = state.robot[r]
    robot.backoff_slots = _backoff_slots(params, state, r, SLOTS)


@kernel()
def _backoff_slots(params, state, r, draw_purpose):
    robot = state.robot[r]
    packet = state.packet[robot.packet]
    window = min((params.cw_min + 1) * 2**robot.exponent, params.cw_max + 1)
    u = uniform(state.keys[r // params.robots], r % params.robots, packet.sequence, robot.attempt, draw_purpose)
    return np.int64(u * window)
