"""Scenario tables of antennas: transmit power, gain and pattern, of the radio and of groups.

No kernels: a scenario is read without a compiler.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.errors import BadInput

PATTERNS = ("omnidirectional", "dipole", "patch", "table")
MAX_GAIN_DB = 200.0  # bound of the values of a table, and their opposite
# Directivity 4 / Cin(2 pi) = 1.6409 of a thin half-wave dipole (C. A. Balanis, Antenna Theory, 4-91).
DIPOLE_DBI = 2.1508803745492275


@dataclass(frozen=True)
class GainTable:
    """Gain by direction: linear in dB between rows, around the circle; constant beyond the first and last elevation."""

    azimuth_deg: tuple[float, ...] = parameter(
        help="directions left of the main direction, rising, within one turn", unit="deg"
    )
    gain_db: tuple[float, ...] = parameter(
        help="a value for each azimuth, added to gain_dbi; with elevation_deg such values for each elevation in turn",
        unit="dB",
    )
    elevation_deg: tuple[float, ...] = parameter(
        (0.0,), help="directions above the main direction, rising, -90 to 90", unit="deg"
    )


@dataclass(frozen=True)
class Pattern:
    """Gain of an antenna by direction, which turns with its robot's heading; the same when sending and receiving."""

    model: str = parameter(
        "omnidirectional",
        help="omnidirectional; dipole: half a wavelength, upright, 2.15 dBi; patch: of 3GPP; table: measured gains",
        choices=PATTERNS,
    )
    azimuth_deg: float = parameter(
        0.0, help="main direction, left of the robot's heading", unit="deg", at_least=-360, at_most=360
    )
    elevation_deg: float = parameter(
        0.0,
        help="main direction, above the horizontal; a dipole's axis is at right angles to it",
        unit="deg",
        at_least=-90,
        at_most=90,
    )
    beam_width_deg: float = parameter(
        65.0, help="patch only: azimuths between which it loses less than 3 dB", unit="deg", above=0, at_most=360
    )
    beam_height_deg: float = parameter(
        65.0, help="patch only: elevations between which it loses less than 3 dB", unit="deg", above=0, at_most=360
    )
    max_loss_db: float = parameter(
        30.0,
        help="dipole and patch only: greatest loss in any direction, against the main one",
        unit="dB",
        at_least=0,
        at_most=200,
    )
    table: GainTable | None = parameter(None, help="table only: gain by direction")

    @property
    def peak_db(self) -> float:
        """Greatest gain over all directions, which `gain_dbi` does not contain, in dB."""
        if self.model == "table" and self.table is not None:
            return max(self.table.gain_db)
        return DIPOLE_DBI if self.model == "dipole" else 0.0


@dataclass(frozen=True)
class Antenna:
    """Transmit power and antenna of a radio; without a pattern its gain is equal in all directions."""

    power_dbm: float = parameter(0.0, help="transmit power into the antenna", unit="dBm", at_least=-100, at_most=100)
    gain_dbi: float = parameter(
        0.0,
        help="gain of the antenna, when sending and when receiving; that of a pattern is added",
        unit="dBi",
        at_least=-100,
        at_most=100,
    )
    pattern: Pattern | None = parameter(None, help="gain by direction; default: the same in all directions")

    @property
    def peak_dbi(self) -> float:
        """Gain in the main direction, in dBi."""
        return self.gain_dbi + self.pattern.peak_db if self.pattern else self.gain_dbi

    @property
    def is_directional(self) -> bool:
        """True if the gain depends on the direction."""
        return self.pattern is not None and self.pattern.model != "omnidirectional"


@dataclass(frozen=True)
class RobotAntenna:
    """Radios of a group's robots where they differ from `[radio.antenna]` and `[radio.lora]`."""

    power_dbm: float | None = parameter(
        None, help="transmit power into the antenna", unit="dBm", at_least=-100, at_most=100
    )
    gain_dbi: float | None = parameter(
        None, help="gain of the antenna, when sending and when receiving", unit="dBi", at_least=-100, at_most=100
    )
    pattern: Pattern | None = parameter(None, help="gain by direction, in place of that of the radio")
    spreading_factor: int | None = parameter(
        None, help='frame "lora" only: in place of that of the radio', at_least=7, at_most=12
    )

    def or_default(self, antenna: Antenna) -> Antenna:
        """Return the antenna of the group's robots; `antenna` is the radio's."""
        changes = {name: value for name, value in vars(self).items() if value is not None}
        changes.pop("spreading_factor", None)
        return replace(antenna, **changes)


@dataclass(frozen=True, slots=True)
class Antennas:
    """Antennas of the robots of an arena, by group."""

    counts: tuple[int, ...]  # robots of each group
    groups: tuple[RobotAntenna, ...]

    @classmethod
    def of_groups(cls, groups: Iterable[tuple[int, RobotAntenna | None]]) -> "Antennas":
        """Return the antennas of groups, each with its number of robots, in their order."""
        antennas = [(count, antenna or RobotAntenna()) for count, antenna in groups]
        return cls(tuple(count for count, _ in antennas), tuple(antenna for _, antenna in antennas))

    @classmethod
    def alike(cls, robots: int) -> "Antennas":
        """Return the antennas of robots to all of which `[radio.antenna]` applies."""
        return cls.of_groups([(robots, None)])

    def by_group(self, antenna: Antenna) -> list[Antenna]:
        """Return the antenna of each group; `antenna` is the radio's."""
        return [group.or_default(antenna) for group in self.groups]

    def spreading_factors(self, default: int) -> IntArray:
        """Spreading factor of each robot, (robots,); `default` is the radio's."""
        return np.repeat(np.array([group.spreading_factor or default for group in self.groups], np.int64), self.counts)

    def send_dbm(self, antenna: Antenna) -> FloatArray:
        """Power that each robot radiates in its main direction, (robots,); `antenna` is the radio's."""
        power_dbm = np.array([group.power_dbm + group.peak_dbi for group in self.by_group(antenna)], np.float64)
        return np.repeat(power_dbm, self.counts)

    def receive_dbi(self, antenna: Antenna) -> FloatArray:
        """Antenna gain of each robot in its main direction, (robots,); `antenna` is the radio's."""
        return np.repeat(np.array([group.peak_dbi for group in self.by_group(antenna)], np.float64), self.counts)


def check_pattern(pattern: Pattern | None, where: str, key: str) -> None:
    """Raise BadInput for a key that the pattern's model does not use, or a table whose rows do not fit.

    `where` is the scenario's file and `key` that of the pattern, such as "radio.antenna.pattern".
    """
    if pattern is None:
        return
    used = {
        "azimuth_deg": PATTERNS[1:],
        "elevation_deg": PATTERNS[1:],
        "beam_width_deg": ("patch",),
        "beam_height_deg": ("patch",),
        "max_loss_db": ("dipole", "patch"),
        "table": ("table",),
    }
    default = Pattern()
    for name, models in used.items():
        if getattr(pattern, name) != getattr(default, name) and pattern.model not in models:
            expected = f'expected model {" or ".join(models)} with it, got "{pattern.model}"'
            raise BadInput(where, f"{key}.{name}", expected)
    if pattern.model == "table":
        if pattern.table is None:
            raise BadInput(where, f"{key}.table", 'is missing; the model "table" needs it')
        _check_table(pattern.table, where, f"{key}.table")


def _check_table(table: GainTable, where: str, key: str) -> None:
    azimuth, elevation = table.azimuth_deg, table.elevation_deg
    if not azimuth or not all(low < high for low, high in pairwise(azimuth)) or azimuth[-1] - azimuth[0] >= 360.0:
        raise BadInput(where, f"{key}.azimuth_deg", "expected values that rise, within less than 360 deg")
    if not elevation or not all(low < high for low, high in pairwise(elevation)):
        raise BadInput(where, f"{key}.elevation_deg", "expected values that rise")
    if elevation[0] < -90.0 or elevation[-1] > 90.0:
        raise BadInput(where, f"{key}.elevation_deg", "expected values from -90 to 90 deg")
    count = len(azimuth) * len(elevation)
    if len(table.gain_db) != count:
        rows = f"one for each of {len(azimuth)} azimuths and {len(elevation)} elevations"
        raise BadInput(where, f"{key}.gain_db", f"expected {count} values, {rows}; got {len(table.gain_db)}")
    if max(map(abs, table.gain_db)) > MAX_GAIN_DB:
        raise BadInput(where, f"{key}.gain_db", f"expected values from {-MAX_GAIN_DB:g} to {MAX_GAIN_DB:g} dB")
