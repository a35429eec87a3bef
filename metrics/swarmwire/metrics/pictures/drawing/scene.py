"""The fixed parts of an arena (floor, boundary, obstacles, lights), its scale bar and its legend."""

from collections.abc import Sequence
from itertools import pairwise, product
from typing import Any

import numpy as np

from swarmwire.comms.base.geometry.floor import Floor
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.observe.truth import Group, Static
from swarmwire.metrics.pictures.drawing.canvas import (
    DEAD,
    FLOOR,
    INK,
    LIGHT,
    LIGHT_EDGE,
    LINK,
    MOVABLE,
    MOVABLE_DASHES,
    MOVABLE_EDGE,
    OBSTACLE,
    OBSTACLE_EDGE,
    OTHER_STATE,
    PAPER,
    SMALL_PT,
    SOFT,
    STATE_COLORS,
    TEXT_PT,
    WALL,
    Color,
    Look,
    rgb,
    robot_color,
    shade,
)

DARKEST = 0.45  # brightness of a shade of 0
_BAR_BELOW_IN = 0.1
_GLOW = ((0.045, 0.10), (0.03, 0.16), (0.018, 0.3))  # radius as a share of the arena's longer side, and opacity
_LETTER_IN, _HANDLE_IN = 0.062, 0.4  # approximate widths of a letter and of a symbol in a legend


def draw_floor(axes: Any, floor: Floor, static: Static, outline: Any) -> None:
    """Colour `outline`, the artist of the floor, and draw image and patches clipped to it."""
    from matplotlib.patches import Circle, Polygon

    outline.set_facecolor(str(brightness(floor.shade)))
    width, height = static.arena_size_m
    if floor.image is not None:
        extent = (-width / 2, width / 2, -height / 2, height / 2)
        image_look: Look = {"cmap": "gray", "vmin": 0.0, "vmax": 1.0, "interpolation": "nearest", "zorder": 0.1}
        limits = axes.axis()
        axes.imshow(brightness(floor.image.grey / 255.0), extent=extent, aspect=axes.get_aspect(), **image_look)
        axes.axis(limits)
    shifts = (-1, 0, 1) if static.boundary == "torus" else (0,)
    for patch in floor.patches:
        look: Look = {"facecolor": str(brightness(patch.shade)), "edgecolor": "none", "zorder": 0.2}
        for columns, rows in product(shifts, shifts):
            center = patch.x_m + columns * width, patch.y_m + rows * height
            corners = np.array(patch.points_m) + center if patch.points_m else None
            shape = Circle(center, patch.radius_m, **look) if corners is None else Polygon(corners, **look)
            axes.add_patch(shape)
            shape.set_clip_path(outline)


def brightness(shade: Any) -> Any:
    """Return the brightness at which a shade 0 … 1, or an array of shades, is drawn."""
    return DARKEST + (1.0 - DARKEST) * shade


def draw_scenery(axes: Any, static: Static, arena: int) -> Any:
    """Draw the fixed parts. Boundaries without walls and movable obstacles are dashed.

    Return the collection of the movable obstacles, for `place_movable`.
    """
    from matplotlib.patches import Rectangle

    width, height = static.arena_size_m
    wall: Look = {"linewidth": 1.3, "edgecolor": WALL}
    edge: Look = {"linewidth": 0.8, "edgecolor": OBSTACLE_EDGE, "linestyle": (0, (4, 3))}
    look = wall if static.walled else edge
    floor = Rectangle((-width / 2, -height / 2), width, height, facecolor=FLOOR, zorder=0, **look)
    axes.add_patch(floor)
    if static.floor is not None:
        draw_floor(axes, static.floor, static, floor)
    # The outlines lie below the areas: none is seen between the parts of a map or a building.
    for look in ({"edgecolor": OBSTACLE_EDGE, "linewidth": 1.6}, {"edgecolor": OBSTACLE, "linewidth": 0.2}):
        _add_obstacles(axes, static.fixed(arena), {"facecolor": OBSTACLE, **look}).set_clip_path(floor)
    pushed: Look = {"facecolor": MOVABLE, "edgecolor": MOVABLE_EDGE, "linestyle": MOVABLE_DASHES}
    movable = _add_obstacles(axes, [obstacle for obstacle in static.obstacles[arena] if obstacle.movable], pushed)
    for light in static.lights[arena] if static.lights else ():
        _draw_light(axes, light.x_m, light.y_m, max(width, height))
    return movable


def place_movable(collection: Any, obstacles: Sequence[Obstacle]) -> None:
    """Replace the obstacles of the collection."""
    collection.set_paths([_shape(obstacle) for obstacle in obstacles])


def _add_obstacles(axes: Any, obstacles: Sequence[Obstacle], look: Look) -> Any:
    from matplotlib.collections import PatchCollection

    shapes = [_shape(obstacle) for obstacle in obstacles]
    arguments: dict[str, Any] = {"linewidth": 0.8, "zorder": 1, **look}
    collection: Any = PatchCollection(shapes, **arguments)
    axes.add_collection(collection, autolim=False)
    return collection


def draw_scale_bar(axes: Any, size_m: tuple[float, float], note: str) -> None:
    """Draw a bar of a round length below the arena, with its length and a note."""
    from matplotlib.transforms import ScaledTranslation, blended_transform_factory

    length_m = round_length_m(0.24 * size_m[0])
    below = ScaledTranslation(0.0, -_BAR_BELOW_IN, axes.figure.dpi_scale_trans)
    line: Look = {"transform": blended_transform_factory(axes.transData, axes.transAxes) + below, "clip_on": False}
    left = -size_m[0] / 2
    axes.plot([left, left + length_m], [0.0, 0.0], color=INK, lw=1.6, solid_capstyle="butt", **line)
    text = f"{length_m:g} m" + (f"    {note}" if note else "")
    right_of_bar = line["transform"] + ScaledTranslation(0.06, 0.0, axes.figure.dpi_scale_trans)
    axes.text(left + length_m, 0.0, text, transform=right_of_bar, va="center", fontsize=SMALL_PT, color=SOFT)


def round_length_m(max_m: float) -> float:
    """Return the greatest of 1, 2, 5, 10, … and their decimal fractions that does not exceed `max_m`."""
    power = 1.0
    while power > max_m:
        power /= 10.0
    while 10.0 * power <= max_m:
        power *= 10.0
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= max_m)


def _shape(obstacle: Obstacle) -> Any:
    from matplotlib.patches import Circle, Polygon

    if obstacle.shape == "cylinder":
        return Circle((obstacle.x_m, obstacle.y_m), obstacle.radius_m)
    return Polygon(obstacle.corners_m, closed=True)


def _draw_light(axes: Any, x_m: float, y_m: float, side_m: float) -> None:
    from matplotlib.patches import Circle

    for share, opacity in _GLOW:
        glow = Circle((x_m, y_m), share * side_m, facecolor=LIGHT, edgecolor="none", alpha=opacity, zorder=1.2)
        axes.add_patch(glow)
    core = {"facecolor": LIGHT, "edgecolor": LIGHT_EDGE, "linewidth": 0.8, "zorder": 1.3}
    axes.add_patch(Circle((x_m, y_m), 0.009 * side_m, **core))


def group_entries(static: Static, filled: bool = True, bodies: bool = False) -> list[Any]:
    """Return an entry per group with its count and, for `bodies`, its body; without `filled`, discs are outlines."""
    return [
        _disc(_group_label(g, bodies), robot_color(i) if filled else None, robot_color(i))
        for i, g in enumerate(static.groups)
    ]


def state_entries(names: tuple[str, ...], others: bool) -> list[Any]:
    """Return an entry per state in the colour of its index, and with `others` an entry for other states."""
    entries = [_disc(name, color, color) for name, color in zip(names, STATE_COLORS, strict=False)]
    return [*entries, _disc("other", OTHER_STATE, OTHER_STATE)] if others else entries


def dead_entry() -> Any:
    """Return the entry of dead robots."""
    return _disc("dead", DEAD, DEAD, "X")


def link_entry(range_m: float) -> Any:
    """Return the entry of lines between robots."""
    from matplotlib.lines import Line2D

    return Line2D([], [], color=LINK, lw=1.0, alpha=0.8, label=f"in sight within {range_m:g} m (radio)")


def light_entry() -> Any:
    """Return the entry of lights."""
    from matplotlib.lines import Line2D

    look: Look = {"markerfacecolor": LIGHT, "markeredgecolor": LIGHT_EDGE, "markersize": 4.5}
    return Line2D([], [], linestyle="none", marker="o", label="light", **look)


def movable_entry() -> Any:
    """Return the entry of movable obstacles."""
    from matplotlib.patches import Patch

    return Patch(facecolor=MOVABLE, edgecolor=MOVABLE_EDGE, linestyle=MOVABLE_DASHES, lw=0.8, label="movable")


def columns_in(entries: list[Any], width_in: float) -> int:
    """Return the number of columns that fit in this width; entries fill column after column."""
    letters = [len(entry.get_label()) for entry in entries]
    for columns in range(len(letters), 1, -1):
        rows, longer_columns = divmod(len(letters), columns)
        starts = [column * rows + min(column, longer_columns) for column in range(columns + 1)]
        widths = [max(letters[first:end]) for first, end in pairwise(starts)]
        if sum(_HANDLE_IN + _LETTER_IN * width for width in widths) <= width_in:
            return columns
    return 1


def add_legend(figure: Any, entries: list[Any], left: float, top: float, columns: int) -> None:
    """Add a legend with its upper left corner at these shares of the figure."""
    if not entries:
        return
    figure.legend(
        handles=entries,
        loc="upper left",
        bbox_to_anchor=(left, top),
        ncols=columns,
        frameon=False,
        fontsize=TEXT_PT,
        labelcolor=INK,
        borderpad=0.0,
        borderaxespad=0.0,
        labelspacing=0.55,
        handlelength=1.7,
        handletextpad=0.5,
        columnspacing=1.3,
    )


def _group_label(group: Group, body: bool) -> str:
    count = group.stop - group.start
    altitude = f", {group.body.altitude_m:g} m up" if group.body.altitude_m else ""
    return (f"{group.name}: {count} {group.body.name}" if body else f"{group.name} ({count})") + altitude


def _disc(label: str, fill: Color | None, rim: Color, marker: str = "o") -> Any:
    from matplotlib.lines import Line2D

    face = PAPER if fill is None else rgb(fill)
    look: Look = {"markerfacecolor": face, "markeredgecolor": shade(rim), "markeredgewidth": 1.0, "markersize": 6.0}
    return Line2D([], [], linestyle="none", marker=marker, label=label, **look)
