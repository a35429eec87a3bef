"""Friis: free space between two antennas, without ground and obstacles."""

import math
from dataclasses import dataclass

from swarmwire.comms.air.propagation.loss_curve import SPEED_OF_LIGHT_MPS, LossCurve, straight


def loss_at_1_m_db(frequency_hz: float) -> float:
    """Free-space loss over 1 m in dB: 20 log10(4 pi f / c)."""
    return 20.0 * math.log10(4.0 * math.pi * frequency_hz / SPEED_OF_LIGHT_MPS)


@dataclass(frozen=True)
class Friis:
    """L(d) = 20 log10(4 pi d f / c) dB (H. T. Friis, Proc. IRE 34, 1946), antenna gains apart."""

    def curve(self, frequency_hz: float) -> LossCurve:
        """The loss at this frequency."""
        return straight(loss_at_1_m_db(frequency_hz), 20.0)
