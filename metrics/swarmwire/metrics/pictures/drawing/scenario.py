"""The picture of a scenario at its start: the arena with its axes, the radio's range, and facts."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.pictures.drawing.canvas import (
    FAINT,
    INK,
    LINK,
    PAPER,
    SMALL_PT,
    SOFT,
    TITLE_PT,
    FigureLayout,
    Look,
    add_arena_axes,
    add_facts,
    lay_out,
    new_figure,
    save,
)
from swarmwire.metrics.pictures.drawing.scene import add_legend, draw_scenery, group_entries, light_entry, movable_entry
from swarmwire.metrics.pictures.drawing.swarm import SwarmArtist
from swarmwire.metrics.text import counted

_AXES_IN = 0.26
_PANEL_IN = 1.55
_LEGEND_ROW_IN = 0.2


def draw_scenario(static: Static, pose: FloatArray, duration_s: float, to: Path) -> None:
    """Write the picture of the first arena with initial poses (robots, 3): x, y in m and heading in rad.

    BadInput for a path that cannot be written.
    """
    layout = lay_out(static.arena_size_m, _PANEL_IN, 0, _AXES_IN)
    figure = new_figure(layout.width_in, layout.height_in)
    axes = add_arena_axes(figure, layout, static.arena_size_m)
    _draw_axes(axes, static.arena_size_m)
    draw_scenery(axes, static, 0)
    swarm = SwarmArtist(axes, static)
    swarm.show(pose, np.ones(static.robots, np.bool_))
    entries = group_entries(static, bodies=True)
    if static.movable:
        entries.append(movable_entry())
    if static.lights and static.lights[0]:
        entries.append(light_entry())
    if static.range_m is not None:
        entries.append(_draw_reach(axes, pose, static.range_m, static.arena_size_m))
    figure.text(layout.left, layout.below_top(0.22), static.name, fontsize=TITLE_PT, fontweight="bold", color=INK)
    _fill_panel(figure, layout, entries, _facts(static, duration_s, swarm.enlarged))
    save(figure, to)


def _draw_axes(axes: Any, size_m: tuple[float, float]) -> None:
    """Label both sides of the arena with round numbers of metres."""
    axes.set_axis_on()
    axes.set_facecolor(PAPER)
    axes.spines[:].set_visible(False)
    axes.tick_params(labelsize=SMALL_PT, colors=SOFT, color=FAINT, length=2.5, width=0.7, pad=2)
    for axis, side in ((axes.xaxis, size_m[0]), (axes.yaxis, size_m[1])):
        axis.get_major_locator().set_params(nbins=max(2, round(9 * side / max(size_m))), steps=[1, 2, 5, 10])
    axes.set_xlabel("x in m", fontsize=SMALL_PT, color=SOFT, labelpad=1)
    axes.set_ylabel("y in m", fontsize=SMALL_PT, color=SOFT, labelpad=0)


def _draw_reach(axes: Any, pose: FloatArray, range_m: float, size_m: tuple[float, float]) -> Any:
    """Draw the radio's range of the robot that is nearest to the median position; return its entry of the legend."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Circle, Rectangle

    position = pose[:, :2]
    center = position[np.argmin(np.linalg.norm(position - np.median(position, axis=0), axis=1))]
    look: Look = {"edgecolor": LINK, "linestyle": (0, (4, 3)), "linewidth": 1.1}
    arena = Rectangle((-size_m[0] / 2, -size_m[1] / 2), *size_m, transform=axes.transData)
    area: Look = {"facecolor": LINK, "alpha": 0.08, "zorder": 1.5}
    for circle in (Circle(center, range_m, **area), Circle(center, range_m, fill=False, zorder=1.6, **look)):
        axes.add_patch(circle)
        circle.set_clip_path(arena)
    label = f"radio of one robot, {range_m:g} m"
    return Line2D([], [], color=LINK, linestyle=(0, (4, 3)), lw=1.1, label=label)


def _facts(static: Static, duration_s: float, enlarged: float) -> list[tuple[str, str]]:
    width_m, height_m = static.arena_size_m
    obstacles = _counted(static.obstacles[0])
    facts = [
        ("arena", f"{width_m:.4g} x {height_m:.4g} m, " + static.boundary),
        ("obstacles", obstacles[0] if obstacles else "none"),
        *(("", text) for text in obstacles[1:]),
        ("robots", f"{static.robots}"),
        ("duration", f"{duration_s:g} s at {static.rate_hz} Hz"),
        ("seed", f"{static.seeds[0]}"),
    ]
    return [*facts, ("drawn", f"robots {enlarged:.1f} x as large")] if enlarged > 1.05 else facts


def _counted(obstacles: Sequence[Obstacle]) -> list[str]:
    """Return the number of obstacles of each shape, movable ones separately."""
    kinds = Counter((obstacle.shape, obstacle.movable) for obstacle in obstacles)
    names = {kind: f"{'movable ' if kind[1] else ''}{kind[0]}" for kind in kinds}
    return [
        counted(count, names[kind], f"{names[kind]}{'es' if kind[0] == 'box' else 's'}")
        for kind, count in kinds.items()
    ]


def _fill_panel(figure: Any, layout: FigureLayout, entries: list[Any], facts: list[tuple[str, str]]) -> None:
    """Add legend and facts: stacked right of the arena, or side by side below it."""
    assert layout.panel is not None
    x, y, _, height = layout.panel
    top = y + height
    add_legend(figure, entries, x, top, columns=1)
    value_offset = 0.72 / layout.width_in
    if layout.panel_on_right:
        below = top - (len(entries) * _LEGEND_ROW_IN + 0.15) / layout.height_in
        add_facts(figure, facts, x, below, layout.height_in, value_offset)
        return
    add_facts(figure, facts, x + 2.6 / layout.width_in, top, layout.height_in, value_offset)
