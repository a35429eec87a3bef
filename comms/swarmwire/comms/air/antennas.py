"""Antennas: the power and gain of each robot."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.air.parameters.propagation import Antenna, OwnAntenna
from swarmwire.comms.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class Antennas:
    """What robots have of their own, by index in the arena; NaN where they have what `[radio.antenna]` says."""

    power_dbm: FloatArray  # (robots,)
    gain_dbi: FloatArray  # (robots,)

    @classmethod
    def of_groups(cls, groups: Iterable[tuple[int, OwnAntenna | None]]) -> "Antennas":
        """Those of groups of so many robots each, in their order."""
        given = [(count, own or OwnAntenna()) for count, own in groups]
        counts = [count for count, _ in given]
        power_dbm = [np.nan if own.power_dbm is None else own.power_dbm for _, own in given]
        gain_dbi = [np.nan if own.gain_dbi is None else own.gain_dbi for _, own in given]
        return cls(np.repeat(power_dbm, counts), np.repeat(gain_dbi, counts))

    @classmethod
    def alike(cls, robots: int) -> "Antennas":
        """So many robots that have nothing of their own."""
        return cls.of_groups([(robots, None)])

    def send_dbm(self, antenna: Antenna) -> FloatArray:
        """What each robot radiates, power and gain, (robots,); `antenna` is the radio's."""
        return _or(self.power_dbm, antenna.power_dbm) + self.receive_dbi(antenna)

    def receive_dbi(self, antenna: Antenna) -> FloatArray:
        """The gain of each robot's antenna, (robots,)."""
        return _or(self.gain_dbi, antenna.gain_dbi)


def _or(own: FloatArray, otherwise: float) -> FloatArray:
    return np.where(np.isnan(own), otherwise, own)
