"""Duty cycle: the airtime that each robot spent within the last hour, by the minute.

A robot refuses a packet that would exceed the allowance. The log has 61 minutes, so that no hour has more.
"""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.phy.state import AirtimeLog

MINUTES = 61
MINUTE_NS = 60 * NS_PER_S
HOUR_NS = 60 * MINUTE_NS
UNLIMITED_NS = 2**62
BEFORE = -MINUTES  # a minute before the run


def allowance_ns(radio: Radio) -> int:
    """Return the airtime of a robot within an hour, in ns."""
    lora = radio.lora_or_none
    return UNLIMITED_NS if lora is None or lora.duty_cycle is None else round(lora.duty_cycle * HOUR_NS)


def airtime_log(rows: int, radio: Radio) -> AirtimeLog:
    """Return an empty log for `rows` robots, without rows if the radio has no duty cycle."""
    shape = (rows if allowance_ns(radio) < UNLIMITED_NS else 0, MINUTES)
    return AirtimeLog(np.full(shape, BEFORE, np.int64), np.zeros(shape, np.int64))


@kernel(inline="always")
def exceeds(params, state, r, airtime_ns, now_ns):
    """Return True if a frame of robot r from `now_ns` on exceeds its allowance."""
    spent_ns = airtime_ns
    if params.allowance_ns < UNLIMITED_NS:
        for k in range(MINUTES):
            if state.spent.minute[r, k] > now_ns // MINUTE_NS - MINUTES:
                spent_ns += state.spent.airtime_ns[r, k]
    return spent_ns > params.allowance_ns


@kernel(inline="always")
def spend(params, state, r, airtime_ns, now_ns):
    """Log the airtime of a frame of robot r that starts at `now_ns`."""
    if params.allowance_ns < UNLIMITED_NS:
        minute = now_ns // MINUTE_NS
        k = minute % MINUTES
        if state.spent.minute[r, k] != minute:
            state.spent.minute[r, k], state.spent.airtime_ns[r, k] = minute, 0
        state.spent.airtime_ns[r, k] += airtime_ns
