"""The robots of one arena: discs, headings, trails and links as a few collections whose arrays each frame replaces."""

from itertools import pairwise
from typing import Any

import numpy as np

from swarmwire.comms.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.drawing.discs import Discs
from swarmwire.metrics.drawing.looks import DEAD, LINK, OTHER_STATE, STATE_COLORS, rgb, shade
from swarmwire.metrics.palette import robot_color
from swarmwire.metrics.torus import link_lines

_LEAST, _CROWDED = 0.0105, 0.2  # least radius of a disc by the arena's longer side; and that times sqrt(robots)
_FADING = (0.2, 0.4, 0.6, 0.8)  # opacity of a trail's parts, the oldest first
_CROWD = 200  # robots; in greater swarms trails are of one part and few points
_CROWD_POINTS = 7
_NOBODY = np.empty((0, 2, 2))


class Swarm:
    """Robots as discs in the colour of their group, the dead grey; with states, the state's colour and the group's rim.

    Robots too small to be seen are drawn larger, all of an arena by one factor, `enlarged`. Those that fly lie above
    the others, the highest on top, and cast a shadow.
    """

    def __init__(self, axes: Any, static: Static) -> None:
        """Add the collections, empty, to axes in m."""
        from matplotlib.collections import LineCollection

        self._static = static
        by_group = [(robot_color(i), group) for i, group in enumerate(static.groups)]
        count = [group.stop - group.start for group in static.groups]
        radius_m = np.repeat([group.body.radius_m for group in static.groups], count)
        altitude_m = np.repeat([group.body.altitude_m for group in static.groups], count)
        self._fill = np.array([rgb(color) for color, group in by_group for _ in range(group.start, group.stop)])
        self._rim = np.array([shade(color) for color, group in by_group for _ in range(group.start, group.stop)])
        self.enlarged = max(1.0, _least_radius_m(static) / float(radius_m.mean()))
        self._crowd = static.robots > _CROWD
        fading = _FADING[-1:] if self._crowd else _FADING
        self._fading = np.array(fading)
        thin = 0.6 if self._crowd else 1.0
        self._links: Any = LineCollection([], colors=LINK, linewidths=0.6, zorder=2)
        self._trails: Any = LineCollection([], linewidths=1.3 * thin, zorder=3, capstyle="butt")
        rows = np.argsort(altitude_m, kind="stable")
        self._layers = [
            Discs(axes, those, radius_m[those] * self.enlarged, flying, thin)
            for flying, those in ((False, rows[altitude_m[rows] == 0.0]), (True, rows[altitude_m[rows] > 0.0]))
            if len(those)
        ]
        self._shown: tuple[bytes, bytes] | None = None
        for artist in (self._links, self._trails):
            axes.add_collection(artist, autolim=False)

    @property
    def artists(self) -> tuple[Any, ...]:
        """Everything that moves, in the order in which it is drawn."""
        return self._links, self._trails, *(artist for layer in self._layers for artist in layer.artists)

    @property
    def enlargement(self) -> str:
        """What to tell people of it; nothing if robots are drawn to scale."""
        return f"robots drawn {self.enlarged:.1f} x as large" if self.enlarged > 1.05 else ""

    def show(
        self,
        pose: AnyArray,
        alive: BoolArray,
        edges: IntArray | None = None,
        trail: AnyArray | None = None,
        state: IntArray | None = None,
    ) -> None:
        """Show a moment.

        Args:
            pose: (n, 3) x, y in m, heading in rad.
            alive: (n,).
            edges: (e, 2) robots joined by radio.
            trail: (points, n, 2) where the robots were, the oldest first.
            state: (n,) places among the state colours; others, negative ones too, are in no state with a colour.
        """
        position = pose[:, :2].astype(np.float64)
        self._color(alive, state)
        for layer in self._layers:
            layer.show(position, pose[:, 2].astype(np.float64))
        self._links.set_segments(_NOBODY if edges is None else link_lines(position, edges, self._static))
        self._links.set_alpha(_link_opacity(0 if edges is None else len(edges)))
        self._show_trails(trail)

    def _show_trails(self, trail: AnyArray | None) -> None:
        if trail is None or len(trail) < 2:
            self._trails.set_segments(_NOBODY)
            return
        points = min(len(trail), _CROWD_POINTS) if self._crowd else len(trail)
        kept = trail[np.round(np.linspace(0, len(trail) - 1, points)).astype(int)]
        cuts = np.round(np.linspace(0, points - 1, len(self._fading) + 1)).astype(int)
        parts: list[AnyArray] = []
        for first, last in pairwise(cuts):
            parts.extend(kept[first : last + 1].swapaxes(0, 1))
        self._trails.set_segments(parts)

    def _color(self, alive: BoolArray, state: IntArray | None) -> None:
        """Colours change seldom, and setting them costs more than comparing."""
        shown = alive.tobytes(), b"" if state is None else state.tobytes()
        if shown == self._shown:
            return
        self._shown = shown
        fill = self._fill if state is None else _state_fill(state)
        fill = np.where(alive[:, None], fill, rgb(DEAD))
        rim = np.where(alive[:, None], self._rim, shade(DEAD))
        for layer in self._layers:
            layer.color(fill, rim)
        parts = len(self._fading)
        trail = np.concatenate([np.tile(fill, (parts, 1)), np.repeat(self._fading, len(fill))[:, None]], axis=1)
        self._trails.set_color(trail)


def _state_fill(state: IntArray) -> FloatArray:
    colors = np.array([rgb(color) for color in (*STATE_COLORS, OTHER_STATE)])
    last = len(STATE_COLORS)
    return colors[np.where((state >= 0) & (state < last), state, last)]


def _least_radius_m(static: Static) -> float:
    return min(_LEAST, _CROWDED / float(np.sqrt(static.robots))) * max(static.arena_size_m)


def _link_opacity(links: int) -> float:
    """Fainter the more there are, so that they do not cover what they join."""
    return float(np.clip(3.5 / np.sqrt(max(links, 1)), 0.18, 0.55))
