"""The robots of an arena: discs, headings, shadows, trails, and links between robots in radio range."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, cast

import numpy as np
from scipy.spatial import KDTree

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.torus import link_lines
from swarmwire.metrics.pictures.drawing.canvas import (
    DEAD,
    INK,
    LINK,
    OTHER_STATE,
    STATE_COLORS,
    Look,
    rgb,
    robot_color,
    shade,
)

_HEADING_RADII = 2.0  # length of a heading from the centre, in radii of its disc
_SHADOW_OFFSET = (0.65, -0.8)  # offset from the centre of a disc, in its radii
_SHADOW_RADII = (1.2, 1.05, 0.85)  # superposed discs make a soft edge
_SHADOW_OPACITY = 0.13  # opacity of each disc
_FLOOR_ORDER, _AIR_ORDER, _CROSS_ORDER = 4.0, 5.5, 7.0
_CROSS = np.array([[[-1.0, -1.0], [1.0, 1.0]], [[-1.0, 1.0], [1.0, -1.0]]])  # cross of dead robots, in radii
# least radius of a disc relative to the arena's longer side, and its limit times sqrt(robots)
_MIN_RADIUS, _MIN_RADIUS_OF_CROWD = 0.0105, 0.2
_TRAIL_OPACITY = (0.2, 0.4, 0.6, 0.8)  # opacity of a trail's parts, the oldest first
_CROWD = 200  # trails of larger swarms have one part and few points
_CROWD_POINTS = 7
_NO_LINES = np.empty((0, 2, 2))


def in_range(
    position_m: AnyArray,
    alive: BoolArray,
    range_m: float,
    obstacles: Sequence[Obstacle],
    torus_m: tuple[float, float] | None = None,
) -> IntArray:
    """Return pairs (e, 2) of living robots within the range, without an obstacle between their centres.

    This geometry is the radio graph of most runs. It ignores partitions, failed radios and radios without line of
    sight; recorded packets show them (`packets_of`). `torus_m` are the sides of a torus, with shortest distances.
    """
    living = np.flatnonzero(alive)
    living_m = position_m[living].astype(np.float64)
    if torus_m is not None:
        living_m = np.mod(living_m, torus_m)
        living_m[living_m >= torus_m] = 0.0  # rounding error of mod
    tree = cast(Any, KDTree)(living_m, boxsize=torus_m)  # scipy's stubs are incomplete
    pairs: IntArray = living[tree.query_pairs(range_m, output_type="ndarray")]
    start, end = (position_m[pairs[:, side]].astype(np.float64) for side in (0, 1))
    shift = np.zeros_like(start)
    if torus_m is not None:
        shift -= torus_m * np.floor((end - start) / torus_m + 0.5)
    clear = np.ones(len(pairs), np.bool_)
    for obstacle in obstacles:
        clear &= ~_touches(obstacle, start, end + shift) & ~_touches(obstacle, start - shift, end)
    return pairs[clear]


def _touches(obstacle: Obstacle, start: FloatArray, end: FloatArray) -> BoolArray:
    """Return, for each line from (e, 2) to (e, 2), True if the obstacle touches it."""
    if obstacle.shape != "cylinder":
        return _touches_polygon(obstacle.corners_m, start, end)
    center, way = np.array([obstacle.x_m, obstacle.y_m]), end - start
    length2 = np.maximum((way * way).sum(axis=1), np.finfo(np.float64).tiny)
    share = np.clip(((center - start) * way).sum(axis=1) / length2, 0.0, 1.0)
    nearest = start + share[:, None] * way
    return np.hypot(*(nearest - center).T) <= obstacle.radius_m


def _touches_polygon(corners: FloatArray, start: FloatArray, end: FloatArray) -> BoolArray:
    """Return, for each line, True if a polygon touches it, by clipping the line at each side (Cyrus and Beck, 1978)."""
    way = end - start
    enter, leave = np.zeros(len(start)), np.ones(len(start))
    for corner, next_corner in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        outward = np.array([next_corner[1] - corner[1], corner[0] - next_corner[0]])
        outside, speed = (start - corner) @ outward, way @ outward
        crossing = -outside / np.where(speed == 0.0, 1.0, speed)
        enter = np.where(speed < 0.0, np.maximum(enter, crossing), enter)
        leave = np.where(speed > 0.0, np.minimum(leave, crossing), leave)
        leave = np.where((speed == 0.0) & (outside > 0.0), -1.0, leave)
    return enter <= leave


class DiscPatches:
    """The discs of some rows of a swarm, the first at the bottom, with a line for each heading."""

    def __init__(self, axes: Any, rows: IntArray, radius_m: FloatArray, flying: bool, thin: float) -> None:
        """Add empty collections to axes in m, for discs of `radius_m` (rows,); `thin` scales the widths of lines.

        Flying robots are above others, and cast a shadow.
        """
        from matplotlib.collections import EllipseCollection, LineCollection

        self._rows, self._radius_m = rows, radius_m
        order = _AIR_ORDER if flying else _FLOOR_ORDER

        def circles(diameter: FloatArray, **look: Any) -> Any:
            options: Look = {"units": "xy", "offset_transform": axes.transData, **look}
            return EllipseCollection(diameter, diameter, np.zeros(len(diameter)), **options)

        shadow: Look = {"facecolors": INK, "edgecolors": "none", "alpha": _SHADOW_OPACITY, "zorder": order - 0.1}
        radii = _SHADOW_RADII if flying else ()
        self._shadows = [circles(2.0 * share * radius_m, **shadow) for share in radii]
        self._headings: Any = LineCollection([], linewidths=1.5 * thin, zorder=order, capstyle="round")
        self._discs = circles(2.0 * radius_m, linewidths=0.9 * thin, zorder=order + 1.0)
        for artist in self.artists:
            axes.add_collection(artist, autolim=False)

    @property
    def artists(self) -> tuple[Any, ...]:
        """Moving artists in drawing order."""
        return *self._shadows, self._headings, self._discs

    def show(self, position_m: FloatArray, heading_rad: FloatArray) -> None:
        """Move the discs to the swarm's positions (n, 2) and headings (n,)."""
        position, heading = position_m[self._rows], heading_rad[self._rows]
        radius_m = self._radius_m[:, None]
        for shadow in self._shadows:
            shadow.set_offsets(position + radius_m * np.array(_SHADOW_OFFSET))
        self._discs.set_offsets(position)
        ends = position + _HEADING_RADII * radius_m * np.stack([np.cos(heading), np.sin(heading)], axis=1)
        self._headings.set_segments(np.stack([position, ends], axis=1))

    def color(self, fill: FloatArray, rim: FloatArray) -> None:
        """Set the colours of the discs from those of the swarm (n, 3)."""
        self._discs.set_facecolor(fill[self._rows])
        self._discs.set_edgecolor(rim[self._rows])
        self._headings.set_color(rim[self._rows])


class SwarmArtist:
    """Robots as discs in the colour of their group, or of their state with the group's rim; dead robots crossed out.

    Robots too small to be seen are drawn larger, all of an arena by the factor `enlarged`. Flying robots are above
    others, the highest on top, and cast a shadow.
    """

    def __init__(self, axes: Any, static: Static, min_radius: float = _MIN_RADIUS) -> None:
        """Add empty collections to axes in m; `min_radius` is relative to the arena's longer side."""
        from matplotlib.collections import LineCollection

        self._static = static
        by_group = [(robot_color(i), group) for i, group in enumerate(static.groups)]
        count = [group.stop - group.start for group in static.groups]
        radius_m = np.repeat([group.body.radius_m for group in static.groups], count)
        altitude_m = np.repeat([group.body.altitude_m for group in static.groups], count)
        self._fill = np.array([rgb(color) for color, group in by_group for _ in range(group.start, group.stop)])
        self._rim = np.array([shade(color) for color, group in by_group for _ in range(group.start, group.stop)])
        self.enlarged = max(1.0, _min_radius_m(static, min_radius) / float(radius_m.mean()))
        self._crowd = static.robots > _CROWD
        self._trail_opacity = np.array(_TRAIL_OPACITY[-1:] if self._crowd else _TRAIL_OPACITY)
        thin = 0.6 if self._crowd else 1.0
        self._links: Any = LineCollection([], colors=LINK, linewidths=0.6, zorder=2)
        self._trails: Any = LineCollection([], linewidths=1.3 * thin, zorder=3, capstyle="butt")
        self._radius_m = radius_m * self.enlarged
        cross = {"colors": [shade(DEAD)], "linewidths": 1.3 * thin, "zorder": _CROSS_ORDER, "capstyle": "round"}
        self._crosses: Any = LineCollection([], **cast(Look, cross))
        rows = np.argsort(altitude_m, kind="stable")
        self._layers = [
            DiscPatches(axes, layer, radius_m[layer] * self.enlarged, flying, thin)
            for flying, layer in ((False, rows[altitude_m[rows] == 0.0]), (True, rows[altitude_m[rows] > 0.0]))
            if len(layer)
        ]
        self._shown: tuple[bytes, bytes] | None = None
        for artist in (self._links, self._trails, self._crosses):
            axes.add_collection(artist, autolim=False)

    @property
    def artists(self) -> tuple[Any, ...]:
        """Moving artists in drawing order."""
        robots = (artist for layer in self._layers for artist in layer.artists)
        return self._links, self._trails, *robots, self._crosses

    @property
    def enlargement(self) -> str:
        """Note on the enlargement; empty if robots are drawn to scale."""
        return f"robots drawn {self.enlarged:.1f} x as large" if self.enlarged > 1.05 else ""

    def show(
        self,
        pose: AnyArray,
        alive: BoolArray,
        edges: IntArray | None = None,
        trail: AnyArray | None = None,
        state: IntArray | None = None,
    ) -> None:
        """Show the swarm at a time.

        Args:
            pose: (n, 3) x, y in m, heading in rad.
            alive: (n,).
            edges: (e, 2) robots joined by radio.
            trail: (points, n, 2) earlier positions, the oldest first.
            state: (n,) indices of state colours; other indices, also negative ones, have the colour of other states.
        """
        position = pose[:, :2].astype(np.float64)
        self._color(alive, state)
        for layer in self._layers:
            layer.show(position, pose[:, 2].astype(np.float64))
        center_m, radius_m = position[~alive, None, None], self._radius_m[~alive, None, None, None]
        self._crosses.set_segments((center_m + radius_m * _CROSS).reshape(-1, 2, 2))
        self._links.set_segments(_NO_LINES if edges is None else link_lines(position, edges, self._static))
        self._links.set_alpha(_link_opacity(0 if edges is None else len(edges)))
        self._show_trails(trail)

    def _show_trails(self, trail: AnyArray | None) -> None:
        if trail is None or len(trail) < 2:
            self._trails.set_segments(_NO_LINES)
            return
        points = min(len(trail), _CROWD_POINTS) if self._crowd else len(trail)
        thinned = trail[np.round(np.linspace(0, len(trail) - 1, points)).astype(int)]
        cuts = np.round(np.linspace(0, points - 1, len(self._trail_opacity) + 1)).astype(int)
        parts: list[AnyArray] = []
        for first, last in pairwise(cuts):
            parts.extend(thinned[first : last + 1].swapaxes(0, 1))
        self._trails.set_segments(parts)

    def _color(self, alive: BoolArray, state: IntArray | None) -> None:
        """Set the colours if they differ from those shown: comparing is cheaper than setting."""
        shown = alive.tobytes(), b"" if state is None else state.tobytes()
        if shown == self._shown:
            return
        self._shown = shown
        fill = self._fill if state is None else _state_fill(state)
        fill = np.where(alive[:, None], fill, rgb(DEAD))
        rim = np.where(alive[:, None], self._rim, shade(DEAD))
        for layer in self._layers:
            layer.color(fill, rim)
        parts = len(self._trail_opacity)
        trail = np.concatenate([np.tile(fill, (parts, 1)), np.repeat(self._trail_opacity, len(fill))[:, None]], axis=1)
        self._trails.set_color(trail)


def _state_fill(state: IntArray) -> FloatArray:
    colors = np.array([rgb(color) for color in (*STATE_COLORS, OTHER_STATE)])
    last = len(STATE_COLORS)
    return colors[np.where((state >= 0) & (state < last), state, last)]


def _min_radius_m(static: Static, min_radius: float) -> float:
    return min(min_radius, _MIN_RADIUS_OF_CROWD / float(np.sqrt(static.robots))) * max(static.arena_size_m)


def _link_opacity(links: int) -> float:
    """Return the opacity of links, which decreases with their number, so that robots stay visible."""
    return float(np.clip(3.5 / np.sqrt(max(links, 1)), 0.18, 0.55))
