"""What a scenario says of what receivers learn. No kernels here: a scenario is read without a compiler."""

from dataclasses import dataclass

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
class RssiGiven:
    """A receiver learns the strength of the signal, in dBm; only of a radio that knows one."""

    noise_db: float = parameter(0.0, help="standard deviation of the error", unit="dB", at_least=0)


@dataclass(frozen=True)
class Gives:
    """What a receiver learns with a packet, taken when the packet went on air."""

    range: RangeGiven | None = parameter(None, help="the distance to the sender")
    bearing: BearingGiven | None = parameter(None, help="the direction to the sender")
    rssi: RssiGiven | None = parameter(None, help="the strength of the signal; not with the model disk")

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns of `Heard.given`."""
        return tuple(column for _, column, given in self._all() if given is not None)

    @property
    def needs(self) -> tuple[str, ...]:
        """Names under which agents declare that they need these."""
        return tuple(f"radio.{name}" for name, _, given in self._all() if given is not None)

    def _all(self) -> tuple[tuple[str, str, object], ...]:
        columns = (("range", "range_m"), ("bearing", "bearing_rad"), ("rssi", "rssi_dbm"))
        return tuple((name, column, getattr(self, name)) for name, column in columns)
