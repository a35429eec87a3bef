"""What a scenario says of bursts. No kernels here: a scenario is read without a compiler."""

import math
from dataclasses import dataclass
from typing import ClassVar

from swarmwire.comms.errors import BadInput
from swarmwire.comms.parameters import parameter


@dataclass(frozen=True)
class BurstsTable:
    """How a scenario writes bursts: by how long spells last, or by the steps p and r from packet to packet.

    The steps are those of netem's `gemodel p r 1-h 1-k`, whose 1-h and 1-k are the losses.
    """

    bad_s: float | None = parameter(
        None, help="mean duration of a burst: 1 / b; 0.5 s without", unit="s", above=0, at_most=1e6
    )
    good_s: float | None = parameter(
        None, help="mean time between bursts: 1 / a; 10 s without", unit="s", above=0, at_most=1e6
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

    def made(self) -> "Bursts":
        """The bursts; BadInput, which names the key in this table, if it says too much or too little."""
        spells = {name: value for name in ("bad_s", "good_s") if (value := getattr(self, name)) is not None}
        steps = {name: value for name in ("p", "r", "interval_s") if (value := getattr(self, name)) is not None}
        losses = {"loss_bad": self.loss_bad, "loss_good": self.loss_good}
        if not steps:
            return Bursts(**spells, **losses)
        if spells:
            either = "expected either bad_s and good_s, or p, r and interval_s"
            raise BadInput("", next(iter(steps)), f"{either}; got {' and '.join((*spells, *steps))}")
        for name in ("p", "r", "interval_s"):
            if name not in steps:
                raise BadInput("", name, "is missing; expected p, r and interval_s together")
        if steps["p"] + steps["r"] >= 1.0:
            raise BadInput("", "r", f"expected less than 1 - p, as losses are bursty only then; got {steps['r']:g}")
        return bursts_from_steps(**steps, **losses)


@dataclass(frozen=True)
class Bursts:
    """How long bad and good spells last, and what they lose."""

    written_as: ClassVar[type[BurstsTable]] = BurstsTable

    bad_s: float = parameter(0.5, help="mean duration of a burst: 1 / b", unit="s", above=0, at_most=1e6)
    good_s: float = parameter(10.0, help="mean time between bursts: 1 / a", unit="s", above=0, at_most=1e6)
    loss_bad: float = parameter(1.0, help="probability that a packet is lost in a burst", at_least=0, at_most=1)
    loss_good: float = parameter(0.0, help="probability that a packet is lost otherwise", at_least=0, at_most=1)

    @property
    def bad_share(self) -> float:
        """The share of time that is bad: pi."""
        return self.bad_s / (self.bad_s + self.good_s)

    @property
    def loss(self) -> float:
        """The share of packets that are lost in the long run."""
        return self.bad_share * self.loss_bad + (1.0 - self.bad_share) * self.loss_good


def bursts_from_steps(p: float, r: float, loss_bad: float, loss_good: float, interval_s: float) -> Bursts:
    """The chain that packets `interval_s` apart see as the one of netem's `gemodel p r 1-h 1-k`; needs p + r < 1.

    p and r are the probabilities from one packet to the next that good turns bad and bad good: (a + b) interval =
    -ln(1 - p - r), and a / b = p / r.
    """
    relaxation_s = -interval_s / math.log1p(-(p + r))
    return Bursts(relaxation_s * (p + r) / r, relaxation_s * (p + r) / p, loss_bad, loss_good)
