"""Decibels: 10 log10 of a ratio of powers; dBm is relative to one milliwatt."""

import math

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.base.math import compiled as math_compiled

NEPERS_PER_DB = portable.log(10.0) / 10.0  # nepers of power


@njit()
def to_db(ratio: float):
    """Return a ratio of powers in dB: 10 log10 x; -inf for 0."""
    return 10.0 * math_compiled.log10(ratio) if ratio > 0.0 else -math.inf


@njit()
def from_db(db: float):
    """Return a figure in dB as a ratio of powers: 10^(x / 10); a figure in dBm as a power in mW."""
    return math_compiled.exp(db * NEPERS_PER_DB)
