"""The lines of one plot, of which some appear late and some never."""

from collections.abc import Mapping
from math import isnan
from typing import Any

import numpy as np

from swarmwire.metrics.palette import Color
from swarmwire.metrics.viewer.colors import SERIES

_WIDEST = 3.0  # each line is drawn over those before it, and is thinner, so that equal ones are all seen
_OWN_WIDTH = 1.8  # where each has a colour of its own, whenever it comes


class RerunSeries:
    """Lines of a plot, by name: each from the first tick in which it has a value.

    A call per line and tick would be most of what a recording costs. So the numbers are kept until `flush` sends those
    of some ticks at once, and lines that appear in the same tick are one entity, whose number of lines rerun takes from
    its first row: `<plot>/since_<n>`, where n is how many lines were there before them.
    """

    def __init__(self, plot: str, colors: Mapping[str, Color] | None = None) -> None:
        """Lines of the plot at this path, in these colours by name, or in those of the palette as they come."""
        self._plot, self._colors = plot, colors or {}
        self._names: dict[str, list[str]] = {}  # of each entity's lines
        self._there: set[str] = set()
        self._kept: list[tuple[int, int, Mapping[str, float]]] = []  # tick, time in ns, numbers

    def add(self, rec: Any, tick: int, time_ns: int, value: Mapping[str, float]) -> None:
        """Keep a tick's numbers by name, NaN for none; the same names in each tick."""
        new = [name for name, number in value.items() if name not in self._there and not isnan(number)]
        if new:
            self.flush(rec)
            self._appear(rec, new)
        self._kept.append((tick, time_ns, value))

    def flush(self, rec: Any) -> None:
        """Send what was kept."""
        import rerun as rr

        kept, self._kept = self._kept, []
        if not kept:
            return
        ticks = rr.TimeColumn("tick", sequence=np.array([tick for tick, _, _ in kept]))
        times = np.array([time_ns for _, time_ns, _ in kept], "timedelta64[ns]")
        index = [ticks, rr.TimeColumn("sim_time", duration=times)]
        for entity, names in self._names.items():
            numbers = np.array([[value[name] for name in names] for _, _, value in kept])
            rows = rr.Scalars.columns(scalars=numbers.ravel()).partition([len(names)] * len(kept))
            rec.send_columns(entity, index, rows)

    def _appear(self, rec: Any, names: list[str]) -> None:
        import rerun as rr

        before = len(self._there)
        entity = f"{self._plot}/since_{before}"
        places = range(before, before + len(names))
        colors = [self._colors.get(name, SERIES[at % len(SERIES)]) for at, name in zip(places, names, strict=True)]
        widths = [_OWN_WIDTH if self._colors else _WIDEST / (1 + at) ** 0.5 for at in places]
        rec.log(entity, rr.SeriesLines(names=names, colors=colors, widths=widths), static=True)
        self._names[entity] = names
        self._there.update(names)
