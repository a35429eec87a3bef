"""The lines of one plot, of which some appear late and some never."""

from collections.abc import Mapping
from math import isnan
from typing import Any

from swarmwire.metrics.palette import Color
from swarmwire.metrics.viewer.colors import SERIES
from swarmwire.metrics.viewer.rows import RerunRows

_WIDEST = 3.0  # each line is drawn over those before it, and is thinner, so that equal ones are all seen
_OWN_WIDTH = 1.8  # where each has a colour of its own, whenever it comes


class RerunSeries:
    """Lines of a plot, by name: each from the first tick in which it has a value.

    Lines that appear in the same tick are one entity, whose number of lines rerun takes from its first row:
    `<plot>/since_<n>`, where n is how many lines were there before them.
    """

    def __init__(self, plot: str, colors: Mapping[str, Color] | None = None) -> None:
        """Lines of the plot at this path, in these colours by name, or in those of the palette as they come."""
        self._plot, self._colors = plot, colors or {}
        self._names: dict[str, list[str]] = {}  # of each entity's lines
        self._there: set[str] = set()

    def add(self, rows: RerunRows, value: Mapping[str, float]) -> None:
        """Add a tick's numbers by name, NaN for none; the same names in each tick."""
        import rerun as rr

        new = [name for name, number in value.items() if name not in self._there and not isnan(number)]
        if new:
            self._appear(rows.rec, new)
        for entity, names in self._names.items():
            rows.add(entity, rr.Scalars.columns, scalars=[value[name] for name in names])

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
