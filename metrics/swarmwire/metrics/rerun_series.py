"""The lines of one plot, of which some appear late and some never."""

from collections.abc import Mapping
from math import isnan
from typing import Any

from swarmwire.metrics.rerun_colors import SERIES, Color

_WIDEST = 3.0  # each line is drawn over those before it, and is thinner, so that equal ones are all seen
_OWN_WIDTH = 1.8  # where each has a colour of its own, whenever it comes


class RerunSeries:
    """Lines of a plot, by name: each from the first tick in which it has a value.

    Rerun takes the number of series of an entity from its first row, and a call per series and tick would be most of
    what a recording costs. So those that appear in the same tick are one entity: `<plot>/since_<n>`, where n is how
    many lines were there before them.
    """

    def __init__(self, plot: str, colors: Mapping[str, Color] | None = None) -> None:
        """Lines of the plot at this path, in these colours by name, or in those of the palette as they come."""
        self._plot, self._colors = plot, colors or {}
        self._entities: dict[str, list[str]] = {}  # names of its series
        self._there: set[str] = set()

    def log(self, rec: Any, value: Mapping[str, float], missing: float = float("nan")) -> None:
        """Log a tick's numbers; NaN is none, drawn as `missing` once the line is there."""
        import rerun as rr

        new = [name for name, number in value.items() if not isnan(number) and name not in self._there]
        if new:
            self._appear(rec, new)
        for entity, names in self._entities.items():
            numbers = [value[name] for name in names]
            rec.log(entity, rr.Scalars([missing if isnan(number) else number for number in numbers]))

    def _appear(self, rec: Any, names: list[str]) -> None:
        import rerun as rr

        before = len(self._there)
        entity = f"{self._plot}/since_{before}"
        places = range(before, before + len(names))
        colors = [self._colors.get(name, SERIES[at % len(SERIES)]) for at, name in zip(places, names, strict=True)]
        widths = [_OWN_WIDTH if self._colors else _WIDEST / (1 + at) ** 0.5 for at in places]
        rec.log(entity, rr.SeriesLines(names=names, colors=colors, widths=widths), static=True)
        self._entities[entity] = names
        self._there.update(names)
