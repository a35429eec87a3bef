"""The paths of the robots over a run, as few lines as show them."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.torus import whole_path
from swarmwire.metrics.pictures.drawing.canvas import (
    INK,
    PAD,
    PAPER,
    SMALL_PT,
    SOFT,
    FigureLayout,
    add_arena_axes,
    robot_color,
    shade,
)
from swarmwire.metrics.pictures.drawing.scene import (
    add_legend,
    columns_in,
    dead_entry,
    draw_scale_bar,
    draw_scenery,
    group_entries,
    light_entry,
    movable_entry,
    place_movable,
)
from swarmwire.metrics.pictures.drawing.swarm import SwarmArtist
from swarmwire.metrics.pictures.report.page import COLUMN_IN, Figure, blank_figure, drawn_figure
from swarmwire.metrics.pictures.report.run_data import ARENA, RunData
from swarmwire.metrics.text import counted, number

MAX_PATHS = 1000
MAX_POINTS = 30_000  # of all paths together: half a megabyte of a figure
_MIN_TICKS = 24
TIME_PARTS = 6
_EDGE_IN, _FOOT_IN, _SCALE_IN, _ROW_IN, _MAX_HIGH_IN = 0.08, 0.24, 0.16, 0.19, 4.4
_CROWD = 200  # robots, from which on lines are thinner
_DRAWN_ROBOTS = 1000  # more discs than these are drawn as pixels


@dataclass(frozen=True)
class Paths:
    """Places of robots at some ticks: of all robots and ticks, or of as many as can be drawn."""

    robots: IntArray  # (m,) rising, of all n
    ticks: IntArray  # (k,) places among the T ticks, the first and the last among them
    place_m: FloatArray  # (k, m, 2)
    lap: IntArray  # (k, m, 2) how often the seam of a torus was crossed, along and across; 0 without one

    def line(self, columns: IntArray, first: int, last: int) -> tuple[FloatArray, FloatArray]:
        """The paths, x and y, of these columns from one index of `ticks` to another, with NaN at gaps."""
        place, lap = self.place_m[first : last + 1, columns], self.lap[first : last + 1, columns]
        jump = (np.diff(lap, axis=0) != 0).any(axis=-1)  # (k - 1, m)
        drawn = np.full((2 * len(place), len(columns), 2), np.nan)
        drawn[0:-1:2] = place
        # Between two places stands the second again, which changes nothing, or a gap.
        drawn[1:-1:2] = np.where(jump[..., None], np.nan, place[1:])
        along = drawn.swapaxes(0, 1).reshape(-1, 2)
        twice = np.zeros(len(along), np.bool_)
        twice[1:] = (along[1:] == along[:-1]).all(axis=1)
        return along[~twice, 0], along[~twice, 1]


def paths_of(place_m: AnyArray, static: Static) -> Paths:
    """The paths to draw of robots at `place_m` (T, n, 2)."""
    ticks, robots = place_m.shape[:2]
    drawn = _evenly(robots, MAX_PATHS)
    kept = _evenly(ticks, max(_MIN_TICKS, MAX_POINTS // max(1, len(drawn))))
    own = place_m[:, drawn].astype(np.float64)
    lap = np.zeros(own.shape, np.int64)
    if static.boundary == "torus":
        lap = np.round((whole_path(own, static) - own) / np.array(static.arena_size_m)).astype(np.int64)
    return Paths(drawn, kept, own[kept], lap[kept])


def _evenly(count: int, most: int) -> IntArray:
    """All indices below `count`, or `most` of them evenly, with the first and the last."""
    if count <= most:
        return np.arange(count)
    return np.unique(np.round(np.linspace(0, count - 1, most)).astype(np.int64))


def trajectories(
    static: Static, arena: int, paths: Paths, pose: AnyArray, alive: BoolArray, movable: AnyArray | None, end_s: float
) -> Any:
    """The figure.

    Args:
        static: what does not change.
        arena: which one.
        paths: to draw.
        pose: (n, 3) of all robots at the end.
        alive: (n,) at the end.
        movable: (k, 3) poses of movable obstacles at the end; None: no movable obstacles.
        end_s: the last tick's time.
    """
    by_time = len(static.groups) == 1
    entries = _entries(static, arena, bool(alive.all()))
    columns = columns_in(entries, COLUMN_IN - 2 * _EDGE_IN)
    layout = _lay_out(static.arena_size_m, -(-len(entries) // columns), _FOOT_IN + (_SCALE_IN if by_time else 0.0))
    figure = blank_figure(layout.width_in, layout.height_in)
    add_legend(figure, entries, layout.left, layout.below_top(0.06), columns)
    axes = add_arena_axes(figure, layout, static.arena_size_m)
    pushed = draw_scenery(axes, static, arena)
    if movable is not None:
        place_movable(pushed, static.movable_at(arena, movable))
    crowd = len(paths.robots) > _CROWD
    look = {"lw": 0.4 if crowd else 0.8, "solid_joinstyle": "round", "zorder": 2.5}
    if by_time:
        _draw_by_time(axes, paths, look)
        _draw_time_scale(figure, layout, end_s)
    else:
        _draw_by_group(axes, static, paths, look)
    _draw_starts(axes, paths, crowd)
    swarm = SwarmArtist(axes, static)
    swarm.show(pose, alive)
    for artist in swarm.artists if static.robots > _DRAWN_ROBOTS else ():
        artist.set_rasterized(True)
    draw_scale_bar(axes, static.arena_size_m, swarm.enlargement)
    return figure


def _lay_out(size_m: tuple[float, float], legend_rows: int, foot_in: float) -> FigureLayout:
    pad_m = 2.0 * PAD * max(size_m)
    across_m, up_m = size_m[0] + pad_m, size_m[1] + pad_m
    in_per_m = min((COLUMN_IN - 2 * _EDGE_IN) / across_m, _MAX_HIGH_IN / up_m)
    wide_in, high_in = across_m * in_per_m, up_m * in_per_m
    head_in = legend_rows * _ROW_IN + 0.08
    height_in = head_in + high_in + foot_in
    left_in = (COLUMN_IN - wide_in) / 2
    place = left_in / COLUMN_IN, foot_in / height_in, wide_in / COLUMN_IN, high_in / height_in
    return FigureLayout(COLUMN_IN, height_in, place, None, beside=False)


def time_colors() -> list[Any]:
    """The colours of the parts of a run, from light to dark, as matplotlib has them."""
    import matplotlib as mpl

    of_all = mpl.colormaps["viridis_r"]
    return [of_all(float(at)) for at in np.linspace(0.12, 1.0, TIME_PARTS)]


def _draw_by_time(axes: Any, paths: Paths, look: dict[str, Any]) -> None:
    cuts = np.round(np.linspace(0, len(paths.ticks) - 1, TIME_PARTS + 1)).astype(int).tolist()
    everyone = np.arange(len(paths.robots))
    for first, last, color in zip(cuts[:-1], cuts[1:], time_colors(), strict=True):
        axes.plot(*paths.line(everyone, first, last), color=color, **look)


def _draw_by_group(axes: Any, static: Static, paths: Paths, look: dict[str, Any]) -> None:
    for index, group in enumerate(static.groups):
        own = np.flatnonzero((paths.robots >= group.start) & (paths.robots < group.stop))
        line = paths.line(own, 0, len(paths.ticks) - 1)
        axes.plot(*line, color=shade(robot_color(index)), alpha=0.7, label=group.name, **look)


def _draw_starts(axes: Any, paths: Paths, crowd: bool) -> None:
    start = paths.place_m[0]
    rim = {"mfc": PAPER, "mec": INK, "mew": 0.3 if crowd else 0.6}
    (drawn,) = axes.plot(start[:, 0], start[:, 1], "o", ms=1.2 if crowd else 2.6, zorder=3.5, label="start", **rim)
    drawn.set_rasterized(len(start) > _DRAWN_ROBOTS)


def _draw_time_scale(figure: Any, layout: FigureLayout, end_s: float) -> None:
    """Which colour is which time, at the foot."""
    width_in, high_in = 1.6, 0.06
    right_in = layout.width_in - _EDGE_IN - 0.45
    box = (right_in - width_in) / layout.width_in, 0.08 / layout.height_in
    axes = figure.add_axes((*box, width_in / layout.width_in, high_in / layout.height_in))
    axes.set_axis_off()
    axes.set(xlim=(0, TIME_PARTS), ylim=(0, 1))
    for place, color in enumerate(time_colors()):
        axes.axvspan(place, place + 1, color=color, lw=0)
    style = {"fontsize": SMALL_PT, "color": SOFT, "va": "center"}
    axes.text(-0.3, 0.4, "0", ha="right", **style)
    axes.text(TIME_PARTS + 0.3, 0.4, f"{end_s:.4g} s", ha="left", **style)


def _entries(static: Static, arena: int, everybody_alive: bool) -> list[Any]:
    from matplotlib.lines import Line2D

    start = Line2D([], [], ls="none", marker="o", ms=3.0, mfc=PAPER, mec=INK, mew=0.6, label="start")
    entries = [*group_entries(static), start]
    if not everybody_alive:
        entries.append(dead_entry())
    if static.lights and static.lights[arena]:
        entries.append(light_entry())
    if static.movable:
        entries.append(movable_entry())
    return entries


def where(run: RunData) -> list[Figure]:
    """The figure; none without a tick."""
    if isinstance(run.film, str):
        return []
    film, static = run.film, run.static
    paths = paths_of(film.pose[:, :, :2], static)
    movable = None if film.movable is None else film.movable[-1]
    end_s = float(film.time_s[-1])
    figure = trajectories(static, ARENA, paths, film.pose[-1], film.alive[-1], movable, end_s)
    colored = "by group" if len(static.groups) > 1 else "by time, from light to dark"
    caption = (
        f"Ways of the robots, coloured {colored}; small circles are starts, discs where they were at {number(end_s)} s."
    )
    left_out = _left_out(paths, len(film.time_s), static.robots)
    return [drawn_figure("trajectories", figure, caption + left_out)]


def _left_out(paths: Paths, ticks: int, robots: int) -> str:
    note = ""
    if len(paths.robots) < robots:
        note += f" The ways of {len(paths.robots):,} of {counted(robots, 'robot')} are drawn."
    if len(paths.ticks) < ticks:
        note += f" Of {ticks:,} ticks {len(paths.ticks):,} are drawn, evenly spread."
    return note
