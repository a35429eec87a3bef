"""What stands still in an arena: floor, boundary, obstacles, lights."""

from collections.abc import Sequence
from typing import Any

from swarmwire.comms.truth import Obstacle, Static
from swarmwire.metrics.drawing.looks import (
    FLOOR,
    INK,
    LIGHT,
    LIGHT_EDGE,
    MOVABLE,
    MOVABLE_DASHES,
    MOVABLE_EDGE,
    OBSTACLE,
    OBSTACLE_EDGE,
    SMALL_PT,
    SOFT,
    WALL,
    Look,
)
from swarmwire.metrics.drawing.painted_floor import draw_floor

_BAR_BELOW_IN = 0.1
_GLOW = ((0.045, 0.10), (0.03, 0.16), (0.018, 0.3))  # radius as a share of the arena's longer side, and opacity


def draw_scenery(axes: Any, static: Static, arena: int) -> Any:
    """Draw it once, below everything else. A boundary that is no wall is dashed, and so are obstacles that move.

    Returns the collection of the movable obstacles, which `place_movable` moves.
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
    _add_obstacles(axes, static.fixed(arena), {"facecolor": OBSTACLE, "edgecolor": OBSTACLE_EDGE})
    pushed: Look = {"facecolor": MOVABLE, "edgecolor": MOVABLE_EDGE, "linestyle": MOVABLE_DASHES}
    movable = _add_obstacles(axes, [obstacle for obstacle in static.obstacles[arena] if obstacle.movable], pushed)
    for light in static.lights[arena] if static.lights else ():
        _draw_light(axes, light.x_m, light.y_m, max(width, height))
    return movable


def place_movable(collection: Any, obstacles: Sequence[Obstacle]) -> None:
    """Draw these movable obstacles in the place of those that the collection holds."""
    collection.set_paths([_shape(obstacle) for obstacle in obstacles])


def _add_obstacles(axes: Any, obstacles: Sequence[Obstacle], look: Look) -> Any:
    from matplotlib.collections import PatchCollection

    shapes = [_shape(obstacle) for obstacle in obstacles]
    collection: Any = PatchCollection(shapes, linewidth=0.8, zorder=1, **look)
    axes.add_collection(collection, autolim=False)
    return collection


def draw_scale_bar(axes: Any, size_m: tuple[float, float], note: str) -> None:
    """A bar of a round length below the arena, with its length and, if any, a note beside it."""
    from matplotlib.transforms import ScaledTranslation, blended_transform_factory

    length_m = round_length_m(0.24 * size_m[0])
    below = ScaledTranslation(0.0, -_BAR_BELOW_IN, axes.figure.dpi_scale_trans)
    line: Look = {"transform": blended_transform_factory(axes.transData, axes.transAxes) + below, "clip_on": False}
    left = -size_m[0] / 2
    axes.plot([left, left + length_m], [0.0, 0.0], color=INK, lw=1.6, solid_capstyle="butt", **line)
    text = f"{length_m:g} m" + (f"    {note}" if note else "")
    beside = line["transform"] + ScaledTranslation(0.06, 0.0, axes.figure.dpi_scale_trans)
    axes.text(left + length_m, 0.0, text, transform=beside, va="center", fontsize=SMALL_PT, color=SOFT)


def round_length_m(longest_m: float) -> float:
    """The greatest of 1, 2, 5, 10, … and their tenths that is no longer."""
    power = 1.0
    while power > longest_m:
        power /= 10.0
    while 10.0 * power <= longest_m:
        power *= 10.0
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= longest_m)


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
