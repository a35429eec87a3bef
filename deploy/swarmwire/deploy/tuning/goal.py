"""What a tuning aims at: a response's statistic over the seeds, as small or as large as can be.

The value that Optuna is given is that statistic. A quantile of a time that was not reached has none: it is known to lie
beyond the limit, the longest duration that a run can have. Its value is then limit * (1 + share of runs censored):
beyond any that was reached, and the further, the more runs did not come to it.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.columns import Row
from swarmwire.metrics.campaign.folder import response_sample
from swarmwire.metrics.campaign.spec import Response, Stat, find_statistic
from swarmwire.metrics.statistics.sample import Sample
from swarmwire.metrics.statistics.survival import kaplan_meier

Direction = Literal["min", "max"]
SHARES: dict[Stat, float] = {"q25": 0.25, "q50": 0.5, "q75": 0.75}
EXPECTED = 'expected "min RESPONSE.STAT" or "max RESPONSE.STAT", such as "min aggregation_time_s.q50"'


class Reached(NamedTuple):
    """What a goal makes of the runs of a point; NaN: no run gave a value."""

    value: float  # that Optuna is given
    statistic: float  # NaN also of a quantile of times beyond the limit
    censored: float  # share of the runs, 0 to 1; 0 of numbers
    undefined: int  # runs with nothing to measure


@dataclass(frozen=True)
class Goal:
    """A response's statistic, and which way it is to go."""

    direction: Direction
    response: Response
    stat: Stat
    limit_s: float  # the longest duration of a run at any point that is searched

    @property
    def text(self) -> str:
        """As people write it."""
        return f"{self.direction} {self.response.column}.{self.stat}"

    def reached(self, sample: Sample) -> Reached:
        """What the runs of a point came to."""
        if not len(sample):
            return Reached(math.nan, math.nan, 0.0, sample.undefined)
        statistic, value = self._statistic(sample), math.nan
        value = self.limit_s * (1.0 + sample.censored) if math.isnan(statistic) else statistic
        return Reached(value, statistic, sample.censored, sample.undefined)

    def better(self, value: float, than: float) -> bool:
        """Whether one value is better than another."""
        return value < than if self.direction == "min" else value > than

    def _statistic(self, sample: Sample) -> float:
        if self.stat == "censored":
            return sample.censored
        if sample.kind == "time":
            curve = kaplan_meier(sample)
            if self.stat != "mean":
                return curve.quantile(SHARES[self.stat])
            # Of min(time, limit): every trial's mean is then up to the same time.
            return curve.restricted_mean(float(self.response.watched_s(np.array(self.limit_s))))
        if self.stat == "mean":
            return float(sample.value.mean())
        return float(np.quantile(sample.value, SHARES[self.stat]))


def goal_of(text: str, responses: Iterable[Response], limit_s: float) -> Goal:
    """The goal that a text says; BadInput unless it is one of these responses, with a way to go."""
    direction, _, name = text.strip().partition(" ")
    if direction not in ("min", "max") or not name.strip():
        raise BadInput("--goal", "", f"{EXPECTED}; got {text!r}")
    response, stat = find_statistic(name.strip(), responses, "--goal")
    return Goal("min" if direction == "min" else "max", response, stat, limit_s)


def sample_of(rows: Sequence[Row], response: Response) -> Sample:
    """The values of a response in rows of a point, none of which failed, by seed."""
    value = np.array([_number(row.get(response.column)) for row in rows])
    end_s = np.array([row["sim_time_s"] for row in rows], np.float64)
    return response_sample(response, value, end_s, np.array([row["seed"] for row in rows], np.int64))


def _number(cell: Any) -> float:
    return math.nan if cell is None else float(cell)
