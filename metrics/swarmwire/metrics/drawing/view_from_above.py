"""A body from above and to scale, its front up: disc, wheels and axle, and what it senses and shows with."""

from typing import Any

from swarmwire.comms.bodies.body import Body
from swarmwire.comms.bodies.drives import Holonomic
from swarmwire.comms.sensors.rays import RayArraySpec
from swarmwire.metrics.drawing.body_parts import draw_parts
from swarmwire.metrics.drawing.looks import (
    CURVE,
    INK,
    SMALL_PT,
    SOFT,
    Look,
    rgb,
    shade,
)
from swarmwire.metrics.drawing.scenery import round_length_m
from swarmwire.metrics.palette import robot_color

_COLOR = robot_color(0)
_ROOM = 1.16  # of what is seen by what is drawn, so that numbers at the rays' ends fit
_BELOW = -0.035  # where legend and bar are, as a share of the view's height
_MIN_LINE_PT = 0.9  # of a legend
_MIN_RADII = 2.0  # seen in each direction at least, in radii of the body


def draw_from_above(axes: Any, body: Body) -> None:
    """Draw it into axes of equal sides.

    A data sheet has no size of the wheels: theirs is for show, the distance between them is not.
    """
    rims = [sheet.range_m for sheet in body.sensors.values() if isinstance(sheet, RayArraySpec)]
    reach_m = body.radius_m + max(rims, default=0.0)
    half_m = _ROOM * max(reach_m, _MIN_RADII * body.radius_m)
    axes.set(xlim=(-half_m, half_m), ylim=(-half_m, half_m), aspect="equal")
    axes.set_axis_off()
    _draw_disc(axes, body)
    if not isinstance(body.drive, Holonomic):
        _draw_wheels(axes, body.radius_m, body.drive.wheel_base_m)
    draw_parts(axes, body)
    _draw_heading(axes, body.radius_m)
    _draw_bar(axes, half_m)
    if axes.get_legend_handles_labels()[0]:
        plain: Look = {
            "frameon": False,
            "fontsize": SMALL_PT,
            "labelcolor": SOFT,
            "borderaxespad": 0.0,
            "borderpad": 0.0,
        }
        legend = axes.legend(
            ncols=3, loc="center right", bbox_to_anchor=(1.0, _BELOW), handlelength=1.3, columnspacing=1.2, **plain
        )
        for line in legend.get_lines():  # rays of a scan are too fine to be seen alone
            line.set_linewidth(max(line.get_linewidth(), _MIN_LINE_PT))


def _draw_disc(axes: Any, body: Body) -> None:
    from matplotlib.patches import Circle

    look: Look = {"facecolor": (*rgb(_COLOR), 0.35), "edgecolor": shade(_COLOR), "linewidth": 1.4, "zorder": 3}
    axes.add_patch(Circle((0.0, 0.0), body.radius_m, **look))


def _draw_wheels(axes: Any, radius_m: float, wheel_base_m: float) -> None:
    from matplotlib.patches import FancyBboxPatch

    half_m, long_m, wide_m = wheel_base_m / 2, 0.62 * radius_m, 0.13 * radius_m
    axes.plot([-half_m, half_m], [0.0, 0.0], color=INK, lw=1.0, zorder=4)
    for x in (-half_m, half_m):
        style = f"round,pad=0,rounding_size={0.4 * wide_m}"
        corner = x - wide_m / 2, -long_m / 2
        look: Look = {"facecolor": INK, "edgecolor": INK, "linewidth": 0.5, "zorder": 5}
        axes.add_patch(FancyBboxPatch(corner, wide_m, long_m, boxstyle=style, **look))


def _draw_heading(axes: Any, radius_m: float) -> None:
    look: Look = {"arrowstyle": "-|>", "color": CURVE, "lw": 1.8, "mutation_scale": 11, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", xy=(0.0, 0.7 * radius_m), xytext=(0.0, 0.0), arrowprops=look, zorder=7)


def _draw_bar(axes: Any, half_m: float) -> None:
    """A bar of a round length, below at the left."""
    length_m = round_length_m(0.4 * half_m)
    low, share = (2.0 * _BELOW - 1.0) * half_m, 0.04 * half_m
    axes.plot([-half_m, -half_m + length_m], [low, low], color=INK, lw=1.6, solid_capstyle="butt", clip_on=False)
    label = f"{100 * length_m:g} cm"
    axes.text(-half_m + length_m + share, low, label, fontsize=SMALL_PT, color=SOFT, va="center")
