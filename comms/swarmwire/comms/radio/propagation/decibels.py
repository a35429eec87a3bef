"""Decibels: 10 log10 of a ratio of powers; dBm is relative to one milliwatt."""

# pyright: basic, reportUnknownMemberType=false

import math

from swarmwire.comms.base.kernels import njit

NEPERS = math.log(10.0) / 10.0  # in a decibel, of power


@njit()
def to_db(ratio):
    """A ratio of powers in dB: 10 log10 x; -inf for 0."""
    return 10.0 * math.log10(ratio) if ratio > 0.0 else -math.inf


@njit()
def from_db(db):
    """The ratio of powers of a figure in dB: 10^(x / 10); from dBm, the power in mW."""
    return math.exp(db * NEPERS)
