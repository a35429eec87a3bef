"""One frame at one receiver, and its keyed draws: one draw per purpose for each packet at each receiver."""

from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.draws_compiled import normal, uniform
from swarmwire.comms.base.kernels import kernel


class ReceivedFrame(NamedTuple):
    """One frame at one receiver, as input of kernels: without distance, poses or power.

    Draws are keyed by `key`, (s, r, sequence) and a purpose of their own; those of losses by the purpose + `attempt`.
    """

    key: int  # key of the arena
    sender: int | np.int64  # robot row
    receiver: int | np.int64  # robot row
    s: int | np.int64  # index of the sender in the arena
    r: int | np.int64  # index of the receiver in the arena
    sequence: int  # sequence number of the packet, or of the acknowledged packet
    attempt: int  # number of the attempt, from 0; a unit disk has only one
    is_ack: bool
    at_ns: int  # unit disk: end of the airtime; PHY: start of the airtime
    trace_ns: int  # time at which traces are read. Unit disk: `at_ns`; PHY: start of the current poses


@kernel()
def link_uniform(frame: Any, draw_purpose: Any):
    """Draw the frame's number in [0, 1) for this purpose."""
    return uniform(frame.key, frame.s, frame.r, frame.sequence, draw_purpose)


@kernel()
def link_normal(frame: Any, draw_purpose: Any):
    """Draw the frame's standard normal number for this purpose."""
    return normal(frame.key, frame.s, frame.r, frame.sequence, draw_purpose)


@kernel()
def loss_uniform(frame: Any, data_purpose: Any, ack_purpose: Any):
    """Draw the number in [0, 1) of this attempt.

    Acknowledgements have purposes of their own, since the acknowledged packet has the same counters.
    """
    return link_uniform(frame, (ack_purpose if frame.is_ack else data_purpose) + frame.attempt)
