"""A body from above and to scale, its front up: disc, wheels and axle, and whatever sits around its rim."""

import math
from typing import Any

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.body import Body
from swarmwire.comms.drives import Holonomic
from swarmwire.comms.sheets import Bumper, Light, Proximity
from swarmwire.metrics.drawing.looks import (
    CURVE,
    INK,
    LIGHT,
    LIGHT_EDGE,
    OBSTACLE_EDGE,
    SMALL_PT,
    SOFT,
    Look,
    rgb,
    shade,
)
from swarmwire.metrics.drawing.scenery import round_length_m
from swarmwire.metrics.palette import robot_color

_RAY = "#d1495b"
_LED = "#7fd14a"
_COLOR = robot_color(0)
_ROOM = 1.16  # of what is seen by what is drawn, so that numbers at the rays' ends fit
_BELOW = -0.035  # where legend and bar are, as a share of the view's height
_LEAST_RADII = 2.0  # seen in each direction at least, in radii of the body


def draw_from_above(axes: Any, body: Body) -> None:
    """Draw it into axes of equal sides.

    A data sheet has no size of the wheels: theirs is for show, the distance between them is not.
    """
    reach_m = body.radius_m + (body.proximity.range_m if body.proximity else 0.0)
    half_m = _ROOM * max(reach_m, _LEAST_RADII * body.radius_m)
    axes.set(xlim=(-half_m, half_m), ylim=(-half_m, half_m), aspect="equal")
    axes.set_axis_off()
    _draw_disc(axes, body)
    if not isinstance(body.drive, Holonomic):
        _draw_wheels(axes, body.radius_m, body.drive.wheel_base_m)
    if body.led_count:
        _draw_leds(axes, body.led_places_m)
    for sheet in body.senses.values():
        match sheet:
            case Proximity():
                _draw_rays(axes, body.radius_m, sheet)
            case Light():
                x, y = _around(sheet.angle_rad, 0.86 * body.radius_m)
                look: Look = {"markerfacecolor": LIGHT, "markeredgecolor": LIGHT_EDGE, "markeredgewidth": 0.7}
                axes.plot(x, y, "s", markersize=3.6, zorder=6, label="photocell", **look)
            case Bumper():
                _draw_bumper(axes, body.radius_m)
            case _:
                pass  # compass, odometry and positioning have no place on the body
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
        axes.legend(
            ncols=3, loc="center right", bbox_to_anchor=(1.0, _BELOW), handlelength=1.3, columnspacing=1.2, **plain
        )


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


def _draw_leds(axes: Any, places_m: FloatArray) -> None:
    look: Look = {"markerfacecolor": _LED, "markeredgecolor": INK, "markeredgewidth": 0.5}
    axes.plot(-places_m[:, 1], places_m[:, 0], "o", markersize=3.2, zorder=8, label="LED", **look)


def _draw_rays(axes: Any, radius_m: float, sheet: Proximity) -> None:
    """From the rim outwards, numbered as an agent has them."""
    from matplotlib.collections import LineCollection

    start, end = (np.stack(_around(sheet.angle_rad, at), axis=1) for at in (radius_m, radius_m + sheet.range_m))
    label = "proximity ray"
    rays = LineCollection(list(np.stack([start, end], axis=1)), colors=_RAY, linewidths=0.9, zorder=2, label=label)
    axes.add_collection(rays)
    axes.plot(start[:, 0], start[:, 1], "o", color=_RAY, markersize=2.4, zorder=6)
    number_at = radius_m + sheet.range_m + 0.055 * axes.get_xlim()[1]
    for i, (x, y) in enumerate(np.stack(_around(sheet.angle_rad, number_at), axis=1)):
        axes.text(x, y, str(i), fontsize=SMALL_PT, color=_RAY, ha="center", va="center")


def _draw_bumper(axes: Any, radius_m: float) -> None:
    x, y = _around(np.linspace(0.0, 2.0 * np.pi, 181), radius_m)
    axes.plot(x, y, color=OBSTACLE_EDGE, lw=3.4, zorder=2.5, label="bumper")


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


def _around(angle_rad: FloatArray, at_m: float) -> tuple[FloatArray, FloatArray]:
    """Points at this distance, for angles from ahead, which is up: the body's frame turned by a quarter."""
    turned = angle_rad + math.pi / 2
    return at_m * np.cos(turned), at_m * np.sin(turned)
