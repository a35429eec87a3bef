"""What a scenario says of its radio."""

from dataclasses import dataclass, field

from swarmwire.comms.parameters import parameter


@dataclass(frozen=True)
class RangeGiven:
    """A receiver learns the distance to the sender, in m, between centres."""

    noise_m: float = parameter(0.0, help="standard deviation of the error", unit="m", at_least=0)


@dataclass(frozen=True)
class BearingGiven:
    """A receiver learns the direction to the sender in its own frame, in rad, positive to the left."""

    noise_rad: float = parameter(0.0, help="standard deviation of the error", unit="rad", at_least=0)


@dataclass(frozen=True)
class Gives:
    """What a receiver learns with a packet, taken when the packet went on air."""

    range: RangeGiven | None = parameter(None, help="the distance to the sender")
    bearing: BearingGiven | None = parameter(None, help="the direction to the sender")

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns of `Heard.given`."""
        return tuple(
            name for name, given in (("range_m", self.range), ("bearing_rad", self.bearing)) if given is not None
        )

    @property
    def needs(self) -> tuple[str, ...]:
        """Names under which agents declare that they need these."""
        return tuple(
            f"radio.{name}" for name, given in (("range", self.range), ("bearing", self.bearing)) if given is not None
        )


@dataclass(frozen=True)
class Radio:
    """A radio that reaches to a fixed distance, loses a fixed share and takes its time."""

    range_m: float = parameter(
        help="a packet reaches receivers at this distance or nearer, centre to centre", unit="m", above=0
    )
    model: str = parameter("disk", help="how the signal fades with distance", choices=("disk",))
    line_of_sight: bool = parameter(True, help="obstacles block the signal")
    loss: float = parameter(
        0.0, help="probability that a packet within reach is lost, for each receiver", at_least=0, at_most=1
    )
    latency_s: float = parameter(
        0.0, help="delay of every packet beyond its airtime", unit="s", at_least=0, at_most=3600
    )
    jitter_s: float = parameter(
        0.0, help="further delay, uniform from 0 to this, for each receiver", unit="s", at_least=0, at_most=3600
    )
    bit_rate_bps: int = parameter(250_000, help="bits on air per second", unit="bit/s", at_least=1, at_most=10**12)
    overhead_bytes: int = parameter(
        0, help="bytes on air beyond the payload (preamble, headers)", unit="byte", at_least=0, at_most=65535
    )
    max_payload_bytes: int = parameter(
        100, help="a larger payload is refused by the radio", unit="byte", at_least=2, at_most=65535
    )
    queue_limit: int = parameter(
        20, help="packets that may wait at a sender for its radio to become free", at_least=0, at_most=10**6
    )
    send_offset: str | float = parameter(
        "uniform",
        help='when in its tick a robot sends: "uniform" (keyed phase, jitter), "tick" (its start), or an offset in s',
    )
    min_delivery: float = parameter(
        0.1,
        help="an edge of the radio graph: a lone packet gets through both ways with this probability",
        at_least=0,
        at_most=1,
    )
    gives: Gives = field(default_factory=Gives)
