"""What the world's air tells a driver-run robot in a tick: a `tick` frame without senses, checked on arrival."""

import numpy as np

from swarmwire.comms.clock import tick_start_ns
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.outcomes import Outcomes
from swarmwire.comms.packets import Heard
from swarmwire.comms.senses import GroupSenses
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.air_terms import AirTerms
from swarmwire.comms.wire.tick_frames import decode_tick, encode_tick

GROUP = "air"  # stands for the robot's own group, of which nothing is told
MOST_BYTES = 2**20  # of a frame, either way
LAST_NS = 2**62  # no run comes so far; later times do not fit those that are told with packets


def encode_air(tick: int, row: int, heard: Heard, outcomes: Outcomes) -> bytes:
    """The frame to the robot of this row: what it heard, and what became of its packets."""
    return encode_tick(tick, {GROUP: GroupSenses(np.array([row]), {})}, heard, outcomes)


def decode_air(data: bytes, terms: AirTerms) -> tuple[int, Heard, Outcomes]:
    """The tick and what `encode_air` was given; BadFrame if the frame is none, contradicts itself or is for another."""
    frame = frames.decode(data, MOST_BYTES)
    if frame.kind != "tick" or not 0 <= tick_start_ns(frame.tick, terms.rate_hz) < LAST_NS:
        raise BadFrame("malformed", f"{frame.kind} {frame.tick}, expected a tick")
    _, heard, outcomes = decode_tick(frame, terms.gives, {GROUP})
    if ((heard.sender < 0) | (heard.sender >= len(terms.robots)) | (heard.receiver != terms.row)).any():
        raise BadFrame("malformed", "heard/numbers: expected packets of the robot's arena to itself")
    if (outcomes.row != terms.row).any():
        raise BadFrame("malformed", "outcomes: expected the robot's own")
    return frame.tick, heard, outcomes
