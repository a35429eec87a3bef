"""The robots of an arena: discs, headings, shadows, trails, and the links of those in radio range."""

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

_HEADING_RADII = 2.0  # length of a heading in radii of its disc, from the centre
_SHADOW_AT = (0.65, -0.8)  # from the centre of a disc, in its radii
_SHADOW_RADII = (1.2, 1.05, 0.85)  # discs over one another make it soft
_SHADOW_OPACITY = 0.13  # of each of them
_FLOOR_ORDER, _AIR_ORDER, _CROSS_ORDER = 4.0, 5.5, 7.0
_CROSS = np.array([[[-1.0, -1.0], [1.0, 1.0]], [[-1.0, 1.0], [1.0, -1.0]]])  # over the dead, in radii of their discs
_LEAST, _CROWDED = 0.0105, 0.2  # least radius of a disc by the arena's longer side; and that times sqrt(robots)
_FADING = (0.2, 0.4, 0.6, 0.8)  # opacity of a trail's parts, the oldest first
_CROWD = 200  # robots; in greater swarms trails are of one part and few points
_CROWD_POINTS = 7
_NO_LINES = np.empty((0, 2, 2))


def in_range(
    position_m: AnyArray,
    alive: BoolArray,
    range_m: float,
    obstacles: Sequence[Obstacle],
    torus_m: tuple[float, float] | None = None,
) -> IntArray:
    """Pairs (e, 2) of robots alive that are no farther apart than the range, with no obstacle between their centres.

    That is the radio graph of most runs. It is geometry: partitions, failed radios and radios that need no line of
    sight are not regarded; recorded packets show those (`packets_of`). `torus_m` are the
    sides of a torus, whose distances are the shortest.
    """
    living = np.flatnonzero(alive)
    place = position_m[living].astype(np.float64)
    if torus_m is not None:
        place = np.mod(place, torus_m)
        place[place >= torus_m] = 0.0  # by rounding
    tree = cast(Any, KDTree)(place, boxsize=torus_m)  # its stub types the answers in part only
    pairs: IntArray = living[tree.query_pairs(range_m, output_type="ndarray")]
    start, end = (position_m[pairs[:, side]].astype(np.float64) for side in (0, 1))
    over = np.zeros_like(start)
    if torus_m is not None:
        over -= torus_m * np.floor((end - start) / torus_m + 0.5)
    clear = np.ones(len(pairs), np.bool_)
    for obstacle in obstacles:
        clear &= ~_touches(obstacle, start, end + over) & ~_touches(obstacle, start - over, end)
    return pairs[clear]


def _touches(obstacle: Obstacle, start: FloatArray, end: FloatArray) -> BoolArray:
    """Whether an obstacle touches each of the straight lines (e, 2) to (e, 2)."""
    if obstacle.shape != "cylinder":
        return _touches_polygon(obstacle.corners_m, start, end)
    centre, along = np.array([obstacle.x_m, obstacle.y_m]), end - start
    length2 = np.maximum((along * along).sum(axis=1), np.finfo(np.float64).tiny)
    share = np.clip(((centre - start) * along).sum(axis=1) / length2, 0.0, 1.0)
    nearest = start + share[:, None] * along
    return np.hypot(*(nearest - centre).T) <= obstacle.radius_m


def _touches_polygon(corners: FloatArray, start: FloatArray, end: FloatArray) -> BoolArray:
    """The lines are clipped by one side after the other (Cyrus and Beck, 1978)."""
    along = end - start
    enter, leave = np.zeros(len(start)), np.ones(len(start))
    for corner, following in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        outward = np.array([following[1] - corner[1], corner[0] - following[0]])
        outside, speed = (start - corner) @ outward, along @ outward
        at = -outside / np.where(speed == 0.0, 1.0, speed)
        enter = np.where(speed < 0.0, np.maximum(enter, at), enter)
        leave = np.where(speed > 0.0, np.minimum(leave, at), leave)
        leave = np.where((speed == 0.0) & (outside > 0.0), -1.0, leave)
    return enter <= leave


class DiscPatches:
    """The discs of some of a swarm's rows, the first at the bottom, with a line for each heading."""

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
        """Move them to their rows of the swarm's positions (n, 2) and headings (n,)."""
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


class SwarmArtist:
    """Robots as discs in the colour of their group, or of their state with the group's rim; the dead grey, crossed out.

    Robots too small to be seen are drawn larger, all of an arena by one factor, `enlarged`. Those that fly lie above
    the others, the highest on top, and cast a shadow.
    """

    def __init__(self, axes: Any, static: Static, least: float = _LEAST) -> None:
        """Add the collections, empty, to axes in m.

        `least` is the least radius of a disc, as a share of the arena's longer side.
        """
        from matplotlib.collections import LineCollection

        self._static = static
        by_group = [(robot_color(i), group) for i, group in enumerate(static.groups)]
        count = [group.stop - group.start for group in static.groups]
        radius_m = np.repeat([group.body.radius_m for group in static.groups], count)
        altitude_m = np.repeat([group.body.altitude_m for group in static.groups], count)
        self._fill = np.array([rgb(color) for color, group in by_group for _ in range(group.start, group.stop)])
        self._rim = np.array([shade(color) for color, group in by_group for _ in range(group.start, group.stop)])
        self.enlarged = max(1.0, _least_radius_m(static, least) / float(radius_m.mean()))
        self._crowd = static.robots > _CROWD
        fading = _FADING[-1:] if self._crowd else _FADING
        self._fading = np.array(fading)
        thin = 0.6 if self._crowd else 1.0
        self._links: Any = LineCollection([], colors=LINK, linewidths=0.6, zorder=2)
        self._trails: Any = LineCollection([], linewidths=1.3 * thin, zorder=3, capstyle="butt")
        self._radius_m = radius_m * self.enlarged
        cross = {"colors": [shade(DEAD)], "linewidths": 1.3 * thin, "zorder": _CROSS_ORDER, "capstyle": "round"}
        self._crosses: Any = LineCollection([], **cast(Look, cross))
        rows = np.argsort(altitude_m, kind="stable")
        self._layers = [
            DiscPatches(axes, those, radius_m[those] * self.enlarged, flying, thin)
            for flying, those in ((False, rows[altitude_m[rows] == 0.0]), (True, rows[altitude_m[rows] > 0.0]))
            if len(those)
        ]
        self._shown: tuple[bytes, bytes] | None = None
        for artist in (self._links, self._trails, self._crosses):
            axes.add_collection(artist, autolim=False)

    @property
    def artists(self) -> tuple[Any, ...]:
        """Everything that moves, in the order in which it is drawn."""
        robots = (artist for layer in self._layers for artist in layer.artists)
        return self._links, self._trails, *robots, self._crosses

    @property
    def enlargement(self) -> str:
        """A note on the enlargement; empty if robots are drawn to scale."""
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
        at_m, size_m = position[~alive, None, None], self._radius_m[~alive, None, None, None]
        self._crosses.set_segments((at_m + size_m * _CROSS).reshape(-1, 2, 2))
        self._links.set_segments(_NO_LINES if edges is None else link_lines(position, edges, self._static))
        self._links.set_alpha(_link_opacity(0 if edges is None else len(edges)))
        self._show_trails(trail)

    def _show_trails(self, trail: AnyArray | None) -> None:
        if trail is None or len(trail) < 2:
            self._trails.set_segments(_NO_LINES)
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


def _least_radius_m(static: Static, least: float) -> float:
    return min(least, _CROWDED / float(np.sqrt(static.robots))) * max(static.arena_size_m)


def _link_opacity(links: int) -> float:
    """Opacity of the links: fainter the more there are, so that robots stay visible."""
    return float(np.clip(3.5 / np.sqrt(max(links, 1)), 0.18, 0.55))
