"""What a scenario says of propagation beyond path loss. No kernels here: a scenario is read without a compiler."""

from dataclasses import dataclass

from swarmwire.comms.parameters import parameter

FADINGS = ("rayleigh", "rician", "nakagami")


@dataclass(frozen=True)
class Antenna:
    """What a robot's radio puts on air and takes from it; the same in all directions."""

    power_dbm: float = parameter(0.0, help="transmit power into the antenna", unit="dBm", at_least=-100, at_most=100)
    gain_dbi: float = parameter(
        0.0, help="gain of the antenna, for what it sends and what it hears", unit="dBi", at_least=-100, at_most=100
    )


@dataclass(frozen=True)
class OwnAntenna:
    """What the antennas of a group's robots have of their own, instead of what `[radio.antenna]` says."""

    power_dbm: float | None = parameter(
        None, help="their transmit power into the antenna", unit="dBm", at_least=-100, at_most=100
    )
    gain_dbi: float | None = parameter(
        None, help="the gain of their antenna, for what they send and hear", unit="dBi", at_least=-100, at_most=100
    )


@dataclass(frozen=True)
class Shadowing:
    """How strongly and over which distance the surroundings vary."""

    deviation_db: float = parameter(
        4.0, help="sigma: standard deviation of the loss on long links", unit="dB", at_least=0, at_most=40
    )
    correlation_m: float = parameter(
        5.0, help="delta: distance over which the surroundings change", unit="m", above=0, at_most=10_000
    )


@dataclass(frozen=True)
class Walls:
    """What obstacles take. ns-3's buildings have 4 dB for wood, 7 concrete with windows, 12 stone, 15 concrete."""

    crossing_db: float = parameter(
        5.0, help="loss in each obstacle on the line between two robots", unit="dB", at_least=0, at_most=1000
    )
    inside_db_per_m: float = parameter(
        0.0, help="loss in obstacles per metre of the line inside them", unit="dB/m", at_least=0, at_most=100_000
    )


@dataclass(frozen=True)
class Bodies:
    """What robots take that stand between two others."""

    crossing_db: float = parameter(
        1.0, help="loss in each robot on the line between two others", unit="dB", at_least=0, at_most=1000
    )


@dataclass(frozen=True)
class Fading:
    """How a link's power varies over fractions of a wavelength."""

    distribution: str = parameter("rayleigh", help="how waves arrive", choices=FADINGS)
    k: float = parameter(
        4.0, help="of rician: power of the direct wave over that of all others", at_least=0, at_most=1e6
    )
    m: float = parameter(
        1.5, help="of nakagami: 1 is rayleigh, less is worse, more is milder", at_least=0.5, at_most=200
    )
