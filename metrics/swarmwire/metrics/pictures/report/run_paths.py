"""The figure of the robots' paths over a run, with a limited number of lines and points."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, BoolArray, FloatArray, IntArray
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.torus import unwrap_path
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
from swarmwire.metrics.pictures.drawing.film import Film
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
from swarmwire.metrics.pictures.report.run_data import ARENA
from swarmwire.metrics.text import counted, number

MAX_PATHS = 1000
MAX_POINTS = 30_000  # points of all paths together, about half a megabyte of a figure
_MIN_TICKS = 24
TIME_PARTS = 6
_EDGE_IN, _FOOT_IN, _SCALE_IN, _ROW_IN, _MAX_HEIGHT_IN = 0.08, 0.24, 0.16, 0.19, 4.4
_CROWD = 200  # larger swarms have thinner lines
_MAX_VECTOR_ROBOTS = 1000  # more discs are drawn as pixels


@dataclass(frozen=True)
class Paths:
    """Positions of the drawn robots at the drawn ticks."""

    robots: IntArray  # (m,) indices of robots, ascending
    ticks: IntArray  # (k,) indices of ticks, the first and the last among them
    position_m: FloatArray  # (k, m, 2)
    lap: IntArray  # (k, m, 2) crossings of a torus' seam in x and y so far; 0 without a torus

    def line(self, columns: IntArray, first: int, last: int) -> tuple[FloatArray, FloatArray]:
        """Return x and y of the paths of these columns between two indices of `ticks`, with NaN at gaps."""
        position, lap = self.position_m[first : last + 1, columns], self.lap[first : last + 1, columns]
        jump = (np.diff(lap, axis=0) != 0).any(axis=-1)  # (k - 1, m)
        points = np.full((2 * len(position), len(columns), 2), np.nan)
        points[0:-1:2] = position
        # Between two positions: a gap, or the second position again, which is removed below.
        points[1:-1:2] = np.where(jump[..., None], np.nan, position[1:])
        line = points.swapaxes(0, 1).reshape(-1, 2)
        repeated = np.zeros(len(line), np.bool_)
        repeated[1:] = (line[1:] == line[:-1]).all(axis=1)
        return line[~repeated, 0], line[~repeated, 1]


def paths_of(position_m: AnyArray, static: Static) -> Paths:
    """Return the paths to draw of robots at `position_m` (T, n, 2)."""
    tick_count, robot_count = position_m.shape[:2]
    robots = _evenly(robot_count, MAX_PATHS)
    ticks = _evenly(tick_count, max(_MIN_TICKS, MAX_POINTS // max(1, len(robots))))
    path_m = position_m[:, robots].astype(np.float64)
    lap = np.zeros(path_m.shape, np.int64)
    if static.boundary == "torus":
        lap = np.round((unwrap_path(path_m, static) - path_m) / np.array(static.arena_size_m)).astype(np.int64)
    return Paths(robots, ticks, path_m[ticks], lap[ticks])


def _evenly(count: int, limit: int) -> IntArray:
    """Return all indices below `count`, or `limit` of them, evenly spaced, with the first and the last."""
    if count <= limit:
        return np.arange(count)
    return np.unique(np.round(np.linspace(0, count - 1, limit)).astype(np.int64))


@dataclass(frozen=True)
class Ending:
    """The state at the end of a run."""

    pose: AnyArray  # (n, 3)
    alive: BoolArray  # (n,)
    movable: AnyArray | None  # (k, 3) poses of movable obstacles; None: no movable obstacles
    time_s: float


def trajectories(static: Static, arena: int, paths: Paths, ending: Ending) -> Any:
    """Draw the paths of the robots of an arena, and the robots at the end."""
    by_time = len(static.groups) == 1
    entries = _entries(static, arena, bool(ending.alive.all()))
    columns = columns_in(entries, COLUMN_IN - 2 * _EDGE_IN)
    layout = _lay_out(static.arena_size_m, -(-len(entries) // columns), _FOOT_IN + (_SCALE_IN if by_time else 0.0))
    figure = blank_figure(layout.width_in, layout.height_in)
    add_legend(figure, entries, layout.left, layout.below_top(0.06), columns)
    axes = add_arena_axes(figure, layout, static.arena_size_m)
    pushed = draw_scenery(axes, static, arena)
    if ending.movable is not None:
        place_movable(pushed, static.movable_at(arena, ending.movable))
    crowd = len(paths.robots) > _CROWD
    look = {"lw": 0.4 if crowd else 0.8, "solid_joinstyle": "round", "zorder": 2.5}
    if by_time:
        _draw_by_time(axes, paths, look)
        _draw_time_scale(figure, layout, ending.time_s)
    else:
        _draw_by_group(axes, static, paths, look)
    _draw_starts(axes, paths, crowd)
    swarm = SwarmArtist(axes, static)
    swarm.show(ending.pose, ending.alive)
    for artist in swarm.artists if static.robots > _MAX_VECTOR_ROBOTS else ():
        artist.set_rasterized(True)
    draw_scale_bar(axes, static.arena_size_m, swarm.enlargement)
    return figure


def _lay_out(size_m: tuple[float, float], legend_rows: int, foot_in: float) -> FigureLayout:
    pad_m = 2.0 * PAD * max(size_m)
    width_m, height_m = size_m[0] + pad_m, size_m[1] + pad_m
    in_per_m = min((COLUMN_IN - 2 * _EDGE_IN) / width_m, _MAX_HEIGHT_IN / height_m)
    arena_width_in, arena_height_in = width_m * in_per_m, height_m * in_per_m
    head_in = legend_rows * _ROW_IN + 0.08
    height_in = head_in + arena_height_in + foot_in
    left_in = (COLUMN_IN - arena_width_in) / 2
    box = left_in / COLUMN_IN, foot_in / height_in, arena_width_in / COLUMN_IN, arena_height_in / height_in
    return FigureLayout(COLUMN_IN, height_in, box, None, panel_on_right=False)


def time_colors() -> list[Any]:
    """Return matplotlib's colours for the parts of a run, from light to dark."""
    import matplotlib as mpl

    colors = mpl.colormaps["viridis_r"]
    return [colors(float(share)) for share in np.linspace(0.12, 1.0, TIME_PARTS)]


def _draw_by_time(axes: Any, paths: Paths, look: dict[str, Any]) -> None:
    cuts = np.round(np.linspace(0, len(paths.ticks) - 1, TIME_PARTS + 1)).astype(int).tolist()
    columns = np.arange(len(paths.robots))
    for first, last, color in zip(cuts[:-1], cuts[1:], time_colors(), strict=True):
        axes.plot(*paths.line(columns, first, last), color=color, **look)


def _draw_by_group(axes: Any, static: Static, paths: Paths, look: dict[str, Any]) -> None:
    for index, group in enumerate(static.groups):
        columns = np.flatnonzero((paths.robots >= group.start) & (paths.robots < group.stop))
        line = paths.line(columns, 0, len(paths.ticks) - 1)
        axes.plot(*line, color=shade(robot_color(index)), alpha=0.7, label=group.name, **look)


def _draw_starts(axes: Any, paths: Paths, crowd: bool) -> None:
    start = paths.position_m[0]
    look = {"mfc": PAPER, "mec": INK, "mew": 0.3 if crowd else 0.6}
    (marks,) = axes.plot(start[:, 0], start[:, 1], "o", ms=1.2 if crowd else 2.6, zorder=3.5, label="start", **look)
    marks.set_rasterized(len(start) > _MAX_VECTOR_ROBOTS)


def _draw_time_scale(figure: Any, layout: FigureLayout, end_s: float) -> None:
    """Draw the colour scale of time at the bottom."""
    width_in, bar_height_in = 1.6, 0.06
    right_in = layout.width_in - _EDGE_IN - 0.45
    box = (right_in - width_in) / layout.width_in, 0.08 / layout.height_in
    axes = figure.add_axes((*box, width_in / layout.width_in, bar_height_in / layout.height_in))
    axes.set_axis_off()
    axes.set(xlim=(0, TIME_PARTS), ylim=(0, 1))
    for index, color in enumerate(time_colors()):
        axes.axvspan(index, index + 1, color=color, lw=0)
    style = {"fontsize": SMALL_PT, "color": SOFT, "va": "center"}
    axes.text(-0.3, 0.4, "0", ha="right", **style)
    axes.text(TIME_PARTS + 0.3, 0.4, f"{end_s:.4g} s", ha="left", **style)


def _entries(static: Static, arena: int, all_alive: bool) -> list[Any]:
    from matplotlib.lines import Line2D

    start = Line2D([], [], ls="none", marker="o", ms=3.0, mfc=PAPER, mec=INK, mew=0.6, label="start")
    entries = [*group_entries(static), start]
    if not all_alive:
        entries.append(dead_entry())
    if static.lights and static.lights[arena]:
        entries.append(light_entry())
    if static.movable:
        entries.append(movable_entry())
    return entries


def path_figure(film: Film, static: Static) -> Figure:
    """Return the figure of the robots' paths."""
    paths = paths_of(film.pose[:, :, :2], static)
    movable = None if film.movable is None else film.movable[-1]
    end_s = float(film.time_s[-1])
    figure = trajectories(static, ARENA, paths, Ending(film.pose[-1], film.alive[-1], movable, end_s))
    coloring = "by group" if len(static.groups) > 1 else "by time, from light to dark"
    caption = (
        f"Paths of the robots, coloured {coloring}; small circles are starts, discs are robots at {number(end_s)} s."
    )
    if len(paths.robots) < static.robots:
        caption += f" The paths of {len(paths.robots):,} of {counted(static.robots, 'robot')} are drawn."
    if len(paths.ticks) < len(film.time_s):
        caption += f" Of {len(film.time_s):,} ticks {len(paths.ticks):,} are drawn, evenly spaced."
    return drawn_figure("trajectories", figure, caption)
