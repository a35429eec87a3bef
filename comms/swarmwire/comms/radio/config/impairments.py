"""Scenario tables of impairments and measurements: bursts, delays, and what a receiver measures.

No kernels here: a scenario is read without a compiler.
"""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.errors import BadInput

MAX_S = 1e6  # mean sojourn time
STEPS = ("p", "r", "interval_s")


@dataclass(frozen=True)
class BurstsTable:
    """Bursts as a scenario writes them: by sojourn times, by mean loss, or by steps p and r between packets.

    The steps are those of netem's `gemodel p r 1-h 1-k`, whose 1-h and 1-k are the losses.
    """

    bad_s: float | None = parameter(
        None, help="mean duration of a burst: 1 / b; 0.5 s without", unit="s", above=0, at_most=MAX_S
    )
    good_s: float | None = parameter(
        None, help="mean time between bursts: 1 / a; 10 s without", unit="s", above=0, at_most=MAX_S
    )
    mean_loss: float | None = parameter(
        None, help="instead of good_s: share of packets lost in the long run", at_least=0, below=1
    )
    p: float | None = parameter(
        None, help="instead of bad_s and good_s: probability that good turns bad by the next packet", above=0, below=1
    )
    r: float | None = parameter(None, help="with p: probability that bad turns good by the next", above=0, below=1)
    interval_s: float | None = parameter(
        None, help="with p: from one to the next of the packets that p and r were stated for", unit="s", above=0
    )
    loss_bad: float = parameter(1.0, help="probability that a packet is lost in a burst: 1-h", at_least=0, at_most=1)
    loss_good: float = parameter(0.0, help="probability that a packet is lost otherwise: 1-k", at_least=0, at_most=1)
    symmetric: bool = parameter(False, help="whether both directions of a link are bad at the same time")

    def made(self) -> "Bursts":
        """The bursts; BadInput, which names the key in this table, if it says too much or too little."""
        spells, mean, steps = self._given("bad_s", "good_s"), self._given("mean_loss"), self._given(*STEPS)
        losses: dict[str, Any] = {
            "loss_bad": self.loss_bad,
            "loss_good": self.loss_good,
            "symmetric": self.symmetric,
        }
        if steps and (spells or mean):
            either = "expected either bad_s with good_s or mean_loss, or p, r and interval_s"
            raise BadInput("", next(iter(steps)), f"{either}; got {' and '.join((*spells, *mean, *steps))}")
        if mean and "good_s" in spells:
            raise BadInput("", "mean_loss", "expected either good_s or mean_loss, got both")
        if mean:
            return bursts_of_mean(**mean, **spells, **losses)
        if not steps:
            return Bursts(**spells, **losses)
        for name in STEPS:
            if name not in steps:
                raise BadInput("", name, "is missing; expected p, r and interval_s together")
        if steps["p"] + steps["r"] >= 1.0:
            raise BadInput("", "r", f"expected less than 1 - p, as losses are bursty only then; got {steps['r']:g}")
        return bursts_from_steps(**steps, **losses)

    def _given(self, *names: str) -> dict[str, float]:
        """The values of these keys that are set."""
        return {name: value for name in names if (value := getattr(self, name)) is not None}


@dataclass(frozen=True)
class Bursts:
    """Mean sojourn times in the bad and the good state, and the loss in each."""

    written_as: ClassVar[type[BurstsTable]] = BurstsTable

    bad_s: float = parameter(0.5, help="mean duration of a burst: 1 / b", unit="s", above=0, at_most=MAX_S)
    good_s: float = parameter(10.0, help="mean time between bursts: 1 / a", unit="s", above=0, at_most=MAX_S)
    loss_bad: float = parameter(1.0, help="probability that a packet is lost in a burst", at_least=0, at_most=1)
    loss_good: float = parameter(0.0, help="probability that a packet is lost otherwise", at_least=0, at_most=1)
    symmetric: bool = parameter(False, help="whether both directions of a link are bad at the same time")

    @property
    def bad_share(self) -> float:
        """The share of time that is bad: pi."""
        return self.bad_s / (self.bad_s + self.good_s)

    @property
    def loss(self) -> float:
        """The share of packets that are lost in the long run."""
        return self.bad_share * self.loss_bad + (1.0 - self.bad_share) * self.loss_good


def bursts_of_mean(
    mean_loss: float, loss_bad: float, loss_good: float, bad_s: float = 0.5, symmetric: bool = False
) -> Bursts:
    """Bursts of `bad_s` that are so far apart that this share of packets is lost in the long run.

    The share of time that is bad is (mean_loss - loss_good) / (loss_bad - loss_good). BadInput for a mean below
    `loss_good`, or not below `loss_bad`, and for one so near to `loss_good` that bursts would be too seldom.
    """
    if not loss_good <= mean_loss < loss_bad:
        between = f"expected at least loss_good, {loss_good:g}, and less than loss_bad, {loss_bad:g}"
        raise BadInput("", "mean_loss", f"{between}; got {mean_loss:g}")
    if mean_loss == loss_good:
        # Never bad is no finite spell; a burst that loses no more than the time between is none.
        return Bursts(bad_s, MAX_S, loss_good, loss_good, symmetric)
    good_s = bad_s * (loss_bad - mean_loss) / (mean_loss - loss_good)
    if good_s > MAX_S:
        seldom = f"bursts of {bad_s:g} s would be more than {MAX_S:g} s apart"
        raise BadInput("", "mean_loss", f"expected loss_good, {loss_good:g}, or more above it: {seldom}")
    return Bursts(bad_s, good_s, loss_bad, loss_good, symmetric)


def bursts_from_steps(
    p: float, r: float, loss_bad: float, loss_good: float, interval_s: float, symmetric: bool = False
) -> Bursts:
    """The chain that packets `interval_s` apart see as the one of netem's `gemodel p r 1-h 1-k`; needs p + r < 1.

    p and r are the probabilities from one packet to the next that good turns bad and bad good: (a + b) interval =
    -ln(1 - p - r), and a / b = p / r.
    """
    relaxation_s = -interval_s / math.log1p(-(p + r))
    return Bursts(relaxation_s * (p + r) / r, relaxation_s * (p + r) / p, loss_bad, loss_good, symmetric)


DISTRIBUTIONS = ("uniform", "normal", "lognormal", "pareto")


@dataclass(frozen=True)
class Delays:
    """Mean and spread of a delay; a normal one is cut off below 0, which lifts a mean of less than 3 deviations."""

    distribution: str = parameter("lognormal", help="how delays are spread", choices=DISTRIBUTIONS)
    mean_s: float = parameter(0.01, help="mean delay", unit="s", above=0, at_most=3600)
    deviation_s: float = parameter(0.005, help="standard deviation of the delay", unit="s", above=0, at_most=3600)
    keep_order: bool = parameter(
        False, help="a packet waits for those that its sender had on air before and that its receiver still has to hear"
    )


def refuse_negative(delays: Delays, where: str, key: str) -> None:
    """Raise `BadInput` for a uniform delay that would reach below 0: mean - sqrt(3) deviation."""
    most_s = delays.mean_s / math.sqrt(3.0)
    if delays.distribution == "uniform" and delays.deviation_s > most_s:
        raise BadInput(where, f"{key}.deviation_s", f"expected at most {most_s:g} s for this mean")


@dataclass(frozen=True)
class RangeMeasure:
    """A receiver learns the distance to the sender, in m, between centres."""

    noise_m: float = parameter(0.0, help="standard deviation of the error", unit="m", at_least=0)


@dataclass(frozen=True)
class BearingMeasure:
    """A receiver learns the direction to the sender in its own frame, in rad, positive to the left."""

    noise_rad: float = parameter(0.0, help="standard deviation of the error", unit="rad", at_least=0)


@dataclass(frozen=True)
class RssiMeasure:
    """A receiver learns the strength of the signal, in dBm; only of a radio that knows one."""

    noise_db: float = parameter(0.0, help="standard deviation of the error", unit="dB", at_least=0)


@dataclass(frozen=True)
class Measures:
    """Measurements of a receiver with each packet, of the time when the packet went on air."""

    range: RangeMeasure | None = parameter(None, help="the distance to the sender")
    bearing: BearingMeasure | None = parameter(None, help="the direction to the sender")
    rssi: RssiMeasure | None = parameter(None, help="the strength of the signal; not with the model disk")

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns of `ReceivedPackets.given`."""
        return tuple(column for _, column, given in self._all() if given is not None)

    @property
    def needs(self) -> tuple[str, ...]:
        """Names under which agents declare that they need these."""
        return tuple(f"radio.{name}" for name, _, given in self._all() if given is not None)

    def _all(self) -> tuple[tuple[str, str, object], ...]:
        columns = (("range", "range_m"), ("bearing", "bearing_rad"), ("rssi", "rssi_dbm"))
        return tuple((name, column, getattr(self, name)) for name, column in columns)
