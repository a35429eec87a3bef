"""Scenario tables of bursts, delays, and measurements of receivers.

No kernels: a scenario is read without a compiler.
"""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.errors import BadInput

MAX_SOJOURN_S = 1e6
STEPS = ("p", "r", "interval_s")


@dataclass(frozen=True)
class BurstsTable:
    """Bursts by sojourn times, by mean loss, or by transition probabilities p and r between packets.

    p and r are those of netem's `gemodel p r 1-h 1-k`, whose 1-h and 1-k are the losses.
    """

    bad_s: float | None = parameter(
        None, help="mean duration of a burst: 1 / b; default: 0.5 s", unit="s", above=0, at_most=MAX_SOJOURN_S
    )
    good_s: float | None = parameter(
        None, help="mean time between bursts: 1 / a; default: 10 s", unit="s", above=0, at_most=MAX_SOJOURN_S
    )
    mean_loss: float | None = parameter(
        None, help="replaces good_s: share of packets lost in the long run", at_least=0, below=1
    )
    p: float | None = parameter(
        None, help="replaces bad_s and good_s: probability that good turns bad by the next packet", above=0, below=1
    )
    r: float | None = parameter(None, help="with p: probability that bad turns good likewise", above=0, below=1)
    interval_s: float | None = parameter(None, help="with p: interval of the packets of p and r", unit="s", above=0)
    loss_bad: float = parameter(1.0, help="probability that a packet is lost in a burst: 1-h", at_least=0, at_most=1)
    loss_good: float = parameter(0.0, help="probability that a packet is lost otherwise: 1-k", at_least=0, at_most=1)
    symmetric: bool = parameter(False, help="both directions of a link are bad at the same time")

    def resolve(self) -> "Bursts":
        """Return the bursts; raise BadInput with a key of this table if keys contradict or are missing."""
        sojourn, mean, steps = self._set_keys("bad_s", "good_s"), self._set_keys("mean_loss"), self._set_keys(*STEPS)
        losses: dict[str, Any] = {
            "loss_bad": self.loss_bad,
            "loss_good": self.loss_good,
            "symmetric": self.symmetric,
        }
        if steps and (sojourn or mean):
            either = "expected either bad_s with good_s or mean_loss, or p, r and interval_s"
            raise BadInput("", next(iter(steps)), f"{either}; got {' and '.join((*sojourn, *mean, *steps))}")
        if mean and "good_s" in sojourn:
            raise BadInput("", "mean_loss", "expected either good_s or mean_loss, got both")
        if mean:
            return bursts_of_mean(**mean, **sojourn, **losses)
        if not steps:
            return Bursts(**sojourn, **losses)
        for name in STEPS:
            if name not in steps:
                raise BadInput("", name, "is missing; expected p, r and interval_s together")
        if steps["p"] + steps["r"] >= 1.0:
            raise BadInput("", "r", f"expected less than 1 - p, otherwise losses are not bursty; got {steps['r']:g}")
        return bursts_from_steps(**steps, **losses)

    def _set_keys(self, *names: str) -> dict[str, float]:
        """Values of those of these keys that are set."""
        return {name: value for name in names if (value := getattr(self, name)) is not None}


@dataclass(frozen=True)
class Bursts:
    """Mean sojourn times in the bad and the good state, and the loss in each."""

    written_as: ClassVar[type[BurstsTable]] = BurstsTable

    bad_s: float = parameter(0.5, help="mean duration of a burst: 1 / b", unit="s", above=0, at_most=MAX_SOJOURN_S)
    good_s: float = parameter(10.0, help="mean time between bursts: 1 / a", unit="s", above=0, at_most=MAX_SOJOURN_S)
    loss_bad: float = parameter(1.0, help="probability that a packet is lost in a burst", at_least=0, at_most=1)
    loss_good: float = parameter(0.0, help="probability that a packet is lost otherwise", at_least=0, at_most=1)
    symmetric: bool = parameter(False, help="both directions of a link are bad at the same time")

    @property
    def bad_share(self) -> float:
        """Share of time in the bad state: pi."""
        return self.bad_s / (self.bad_s + self.good_s)

    @property
    def loss(self) -> float:
        """Share of packets lost in the long run."""
        return self.bad_share * self.loss_bad + (1.0 - self.bad_share) * self.loss_good


def bursts_of_mean(
    mean_loss: float, loss_bad: float, loss_good: float, bad_s: float = 0.5, symmetric: bool = False
) -> Bursts:
    """Return bursts of `bad_s` whose distance makes this the share of packets lost in the long run.

    The share of time in the bad state is (mean_loss - loss_good) / (loss_bad - loss_good).

    Raises:
        BadInput: `mean_loss` is below `loss_good`, not below `loss_bad`, or so near to `loss_good` that bursts would
            be too seldom.
    """
    if not loss_good <= mean_loss < loss_bad:
        between = f"expected at least loss_good, {loss_good:g}, and less than loss_bad, {loss_bad:g}"
        raise BadInput("", "mean_loss", f"{between}; got {mean_loss:g}")
    if mean_loss == loss_good:
        # The time between bursts would be infinite; a burst with the loss of the good state changes nothing.
        return Bursts(bad_s, MAX_SOJOURN_S, loss_good, loss_good, symmetric)
    good_s = bad_s * (loss_bad - mean_loss) / (mean_loss - loss_good)
    if good_s > MAX_SOJOURN_S:
        seldom = f"bursts of {bad_s:g} s would be more than {MAX_SOJOURN_S:g} s apart"
        raise BadInput("", "mean_loss", f"expected loss_good, {loss_good:g}, or more above it: {seldom}")
    return Bursts(bad_s, good_s, loss_bad, loss_good, symmetric)


def bursts_from_steps(
    p: float, r: float, loss_bad: float, loss_good: float, interval_s: float, symmetric: bool = False
) -> Bursts:
    """Return the continuous chain that equals netem's `gemodel p r 1-h 1-k` for packets `interval_s` apart.

    p and r are the probabilities from one packet to the next that good turns bad and bad turns good, p + r < 1:
    (a + b) interval = -ln(1 - p - r), and a / b = p / r.
    """
    relaxation_s = -interval_s / portable.log1p(-(p + r))
    return Bursts(relaxation_s * (p + r) / r, relaxation_s * (p + r) / p, loss_bad, loss_good, symmetric)


DISTRIBUTIONS = ("uniform", "normal", "lognormal", "pareto")


@dataclass(frozen=True)
class Delays:
    """Distribution of a delay. The normal is truncated at 0, which raises a mean of less than 3 deviations."""

    distribution: str = parameter("lognormal", help="distribution of the delay", choices=DISTRIBUTIONS)
    mean_s: float = parameter(0.01, help="mean delay", unit="s", above=0, at_most=3600)
    deviation_s: float = parameter(0.005, help="standard deviation of the delay", unit="s", above=0, at_most=3600)
    keep_order: bool = parameter(
        False, help="packets of one sender reach a receiver in the order in which they went on air"
    )


def refuse_negative(delays: Delays, where: str, key: str) -> None:
    """Raise `BadInput` for a uniform delay that extends below 0: mean - sqrt(3) deviation."""
    max_s = delays.mean_s / math.sqrt(3.0)
    if delays.distribution == "uniform" and delays.deviation_s > max_s:
        raise BadInput(where, f"{key}.deviation_s", f"expected at most {max_s:g} s for this mean")


@dataclass(frozen=True)
class RangeMeasure:
    """A receiver measures the distance in space to the sender, in m, from antenna to antenna."""

    noise_m: float = parameter(0.0, help="standard deviation of the error", unit="m", at_least=0)


@dataclass(frozen=True)
class BearingMeasure:
    """A receiver measures the direction to the sender in the plane, in its own frame, in rad, positive to the left."""

    noise_rad: float = parameter(0.0, help="standard deviation of the error", unit="rad", at_least=0)


@dataclass(frozen=True)
class RssiMeasure:
    """A receiver measures the strength of the signal, in dBm; PHY only."""

    noise_db: float = parameter(0.0, help="standard deviation of the error", unit="dB", at_least=0)


@dataclass(frozen=True)
class Measures:
    """Measurements of a receiver for each packet, at the time when the packet went on air."""

    range: RangeMeasure | None = parameter(None, help="the distance to the sender")
    bearing: BearingMeasure | None = parameter(None, help="the direction to the sender")
    rssi: RssiMeasure | None = parameter(None, help="the strength of the signal; PHY only")

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns of `ReceivedPackets.measured`."""
        return tuple(column for _, column, measure in self._all() if measure is not None)

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the measures in agents' `needs`."""
        return tuple(f"radio.{name}" for name, _, measure in self._all() if measure is not None)

    def _all(self) -> tuple[tuple[str, str, object], ...]:
        columns = (("range", "range_m"), ("bearing", "bearing_rad"), ("rssi", "rssi_dbm"))
        return tuple((name, column, getattr(self, name)) for name, column in columns)
