"""The plots of a recording: which numbers are drawn together, and the packets of the last second."""

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.fates import Fate
from swarmwire.comms.truth import Static, Tally
from swarmwire.metrics.plotted import Plotted

_COLORS = (
    (86, 180, 233),
    (240, 228, 66),
    (0, 200, 140),
    (230, 120, 40),
    (204, 121, 167),
    (180, 180, 190),
)
_WIDEST = 3.0  # of a series' line; each is drawn over those before it, and is thinner, so that equal ones are all seen


class RerunPlots:
    """Four plots, each one entity with a series per number, so that a tick costs one call per plot.

    shares: the metrics within 0 and 1, and `delivery` (heard / in range, over the last second); distances: those
    in m; numbers: the other metrics; packets: receivers per second that heard a packet, and that were in range and did
    not.
    """

    def __init__(self, static: Static, metrics: Sequence[Plotted], arena: int) -> None:
        """Plots of one arena."""
        self._arena, self._rate_hz, self._radio = arena, static.rate_hz, static.range_m is not None
        self._shares = [metric.name for metric in metrics if metric.bounds == (0.0, 1.0)]
        self._distances = [metric.name for metric in metrics if metric.unit == "m"]
        self._numbers = [m.name for m in metrics if m.name not in (*self._shares, *self._distances)]
        self._second: deque[IntArray] = deque(maxlen=static.rate_hz)  # per tick: heard, in range

    def begin(self, rec: Any) -> None:
        """Log names and colours of the series, which do not change."""
        import rerun as rr

        names = {"shares": list(self._shares), "numbers": self._numbers, "distances": self._distances}
        if self._radio:
            names["shares"].append("delivery")
            names["packets"] = ["heard", "in range, not heard"]
        for plot, series in names.items():
            colors = [_COLORS[i % len(_COLORS)] for i in range(len(series))]
            widths = [_WIDEST / (1 + i) ** 0.5 for i in range(len(series))]
            rec.log(f"plots/{plot}", rr.SeriesLines(names=series, colors=colors, widths=widths), static=True)

    def log(self, rec: Any, latest: Mapping[str, FloatArray], tally: Tally | None) -> None:
        """Log the numbers of a tick."""
        import rerun as rr

        shares = [latest[name][self._arena] for name in self._shares]
        if self._radio:
            heard, in_range = self._per_second(tally)
            shares.append(heard / in_range if in_range > 0 else np.nan)
            rec.log("plots/packets", rr.Scalars([heard, in_range - heard]))
        rec.log("plots/shares", rr.Scalars(shares))
        rec.log("plots/distances", rr.Scalars([latest[name][self._arena] for name in self._distances]))
        rec.log("plots/numbers", rr.Scalars([latest[name][self._arena] for name in self._numbers]))

    def _per_second(self, tally: Tally | None) -> FloatArray:
        if tally is not None:
            self._second.append(np.array([tally.fates[self._arena, Fate.HEARD], tally.in_range[self._arena]]))
        return np.sum(self._second, axis=0) * self._rate_hz / len(self._second) if self._second else np.zeros(2)
