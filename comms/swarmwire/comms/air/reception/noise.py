"""Thermal noise: what a receiver hears while nobody sends."""

import math
from dataclasses import dataclass

from swarmwire.comms.parameters import parameter

BOLTZMANN_J_PER_K = 1.380649e-23  # exact, SI 2019
ROOM_K = 290.0  # the temperature at which noise figures are defined (IEEE)


def noise_dbm(bandwidth_hz: float, noise_figure_db: float = 0.0, temperature_k: float = ROOM_K) -> float:
    """Noise power k T B F in dBm: -173.975 dBm in 1 Hz at 290 K, plus the receiver's noise figure."""
    return 10.0 * math.log10(1e3 * BOLTZMANN_J_PER_K * temperature_k * bandwidth_hz) + noise_figure_db


@dataclass(frozen=True)
class Noise:
    """What a receiver adds to what it hears."""

    bandwidth_hz: float = parameter(2e6, help="bandwidth of the receiver", unit="Hz", above=0, at_most=1e12)
    figure_db: float = parameter(
        6.0,
        help="noise figure: how far what it hears is above thermal noise",
        unit="dB",
        at_least=0,
        at_most=200,
    )

    @property
    def power_dbm(self) -> float:
        """The noise in the receiver's bandwidth at 290 K, in dBm."""
        return noise_dbm(self.bandwidth_hz, self.figure_db)
