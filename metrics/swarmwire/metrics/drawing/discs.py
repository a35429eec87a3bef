"""Robots on the floor, or those above it, from low to high: discs, headings, and shadows of those that fly."""

from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.metrics.drawing.looks import INK, Look

_HEADING_RADII = 2.0  # length of a heading in radii of its disc, from the centre
_SHADOW_AT = (0.65, -0.8)  # from the centre of a disc, in its radii
_SHADOW_RADII = (1.2, 1.05, 0.85)  # discs over one another make it soft
_SHADOW_OPACITY = 0.13  # of each of them
_FLOOR_ORDER, _AIR_ORDER = 4.0, 5.5


class Discs:
    """The discs of some of a swarm's rows, the first at the bottom, with lines that tell where they head."""

    def __init__(self, axes: Any, rows: IntArray, radius_m: FloatArray, flying: bool, thin: float) -> None:
        """Add the collections, empty, to axes in m; `radius_m` (rows,) and widths of lines `thin` times as wide.

        Those of robots that fly lie above those of others, and cast a shadow.
        """
        from matplotlib.collections import EllipseCollection, LineCollection

        self._rows, self._radius_m = rows, radius_m
        order = _AIR_ORDER if flying else _FLOOR_ORDER

        def ellipses(across: FloatArray, **look: Any) -> Any:
            on_axes: Look = {"units": "xy", "offset_transform": axes.transData, **look}
            return EllipseCollection(across, across, np.zeros(len(across)), **on_axes)

        shadow: Look = {"facecolors": INK, "edgecolors": "none", "alpha": _SHADOW_OPACITY, "zorder": order - 0.1}
        radii = _SHADOW_RADII if flying else ()
        self._shadows = [ellipses(2.0 * share * radius_m, **shadow) for share in radii]
        self._headings: Any = LineCollection([], linewidths=1.5 * thin, zorder=order, capstyle="round")
        self._discs = ellipses(2.0 * radius_m, linewidths=0.9 * thin, zorder=order + 1.0)
        for artist in self.artists:
            axes.add_collection(artist, autolim=False)

    @property
    def artists(self) -> tuple[Any, ...]:
        """Everything that moves, in the order in which it is drawn."""
        return *self._shadows, self._headings, self._discs

    def show(self, position_m: FloatArray, heading_rad: FloatArray) -> None:
        """Put them where their rows of the whole swarm's (n, 2) and (n,) say."""
        position, heading = position_m[self._rows], heading_rad[self._rows]
        radius_m = self._radius_m[:, None]
        for shadow in self._shadows:
            shadow.set_offsets(position + radius_m * np.array(_SHADOW_AT))
        self._discs.set_offsets(position)
        ends = position + _HEADING_RADII * radius_m * np.stack([np.cos(heading), np.sin(heading)], axis=1)
        self._headings.set_segments(np.stack([position, ends], axis=1))

    def color(self, fill: FloatArray, rim: FloatArray) -> None:
        """Give them their rows of the whole swarm's colours (n, 3)."""
        self._discs.set_facecolor(fill[self._rows])
        self._discs.set_edgecolor(rim[self._rows])
        self._headings.set_color(rim[self._rows])
