"""Responses of a campaign: columns of its table that hold what was measured of each run."""

from dataclasses import dataclass
from typing import get_args

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.statistics.sample import Kind

KINDS: tuple[str, ...] = get_args(Kind)
FINAL = ".final"  # how columns end that hold the last value of a metric, which its bare name means
LINK_PDR = "radio.link_pdr"  # the column of the delivery ratio of links


@dataclass(frozen=True)
class Response:
    """One column. A `number` is what it is; a `time` may lack, since the run ended before it: right-censored."""

    column: str  # in summary.parquet, e.g. order.final
    unit: str  # "" if it has none
    kind: Kind
    help: str  # one line
    listed: bool = False  # of a metric that the scenario asks for, beside those of every run
    hold_s: float = 0.0  # of a time that is known only once something has held so long since

    def watched_s(self, end_s: FloatArray) -> FloatArray:
        """Up to when runs that ended at `end_s` tell of this time: what began later had no time left to hold."""
        return np.maximum(end_s - self.hold_s, 0.0)

    @property
    def is_usual(self) -> bool:
        """Whether it is told of where none is named: a time, the last value of a metric, or the link PDR."""
        return self.kind == "time" or self.column.endswith(FINAL) or self.column == LINK_PDR
