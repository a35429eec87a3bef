"""A body from above and to scale, its front up: disc, wheels, sensors and LEDs."""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.body import Body
from swarmwire.comms.bodies.drives import Holonomic
from swarmwire.comms.sensors.light import LightSpec
from swarmwire.comms.sensors.rays import InfraredSpec, ProximitySpec, RayArraySpec
from swarmwire.comms.sensors.scan import ScanSpec
from swarmwire.comms.sensors.simple import BumperSpec, GroundSpec
from swarmwire.metrics.drawing.scene import round_length_m
from swarmwire.metrics.drawing.style import (
    CURVE,
    INK,
    LIGHT,
    LIGHT_EDGE,
    OBSTACLE_EDGE,
    PAPER,
    SMALL_PT,
    SOFT,
    Look,
    rgb,
    shade,
)
from swarmwire.metrics.palette import robot_color

_RAY, _PASSIVE, _SCAN, _LED = "#d1495b", "#7b4fa3", "#3a86a8", "#43aa5b"
_FADES_FROM, _FADING = 0.6, 10  # of the view, where rays that leave it begin to fade; and in so many steps
_NUMBER_AT = 0.055  # beyond the rays' ends, as a share of the view
_COLOR = robot_color(0)
_ROOM = 1.16  # view over drawing, so that numbers at the ends of rays fit
_BELOW = -0.035  # where legend and bar are, as a share of the view's height
_MIN_LINE_PT = 0.9  # of a legend
_MIN_RADII = 2.0  # seen in each direction at least, in radii of the body


def draw_parts(axes: Any, body: Body) -> None:
    """Draw the sensors that have a place on the body, and its LEDs; the limits of the axes are set before."""
    for sheet in body.sensors.values():
        match sheet:
            case ProximitySpec():
                _draw_rays(axes, body.radius_m, sheet, "proximity ray", _RAY, "-")
                _number_rays(axes, body.radius_m, sheet)
            case InfraredSpec():
                _draw_rays(axes, body.radius_m, sheet, "passive infrared", _PASSIVE, (0, (2.0, 4.0)))
            case ScanSpec():
                _draw_scan(axes, sheet)
            case LightSpec():
                _draw_photocells(axes, body.radius_m, sheet)
            case GroundSpec():
                x, y = _turned(*np.array(sheet.points_m).T)
                look: Look = {"markerfacecolor": PAPER, "markeredgecolor": INK, "markeredgewidth": 0.7}
                axes.plot(x, y, "v", markersize=3.6, zorder=6, label="ground sensor", **look)
            case BumperSpec():
                x, y = _around(np.linspace(0.0, 2.0 * np.pi, 181), body.radius_m)
                axes.plot(x, y, color=OBSTACLE_EDGE, lw=3.4, zorder=2.5, label="bumper")
            case _:
                pass  # the others have no place, or one that nobody sees from above
    if body.leds is not None:
        x, y = _turned(*body.leds.places_m(body.radius_m)[:, :2].T)
        axes.plot(x, y, "o", color=_LED, markersize=2.8, zorder=6.5, label="LED")


def _draw_rays(axes: Any, radius_m: float, sheet: RayArraySpec, label: str, color: str, line: Any) -> None:
    from matplotlib.collections import LineCollection

    start, end = (np.stack(_around(sheet.angle_rad, at), axis=1) for at in (radius_m, radius_m + sheet.range_m))
    look: Look = {"colors": color, "linewidths": 0.9, "linestyles": [line], "zorder": 2 if line == "-" else 2.2}
    axes.add_collection(LineCollection(list(np.stack([start, end], axis=1)), label=label, **look))
    axes.plot(start[:, 0], start[:, 1], "o", color=color, markersize=2.4, zorder=6)


def _number_rays(axes: Any, radius_m: float, sheet: RayArraySpec) -> None:
    """As an agent has them."""
    at_m = radius_m + sheet.range_m + _NUMBER_AT * axes.get_xlim()[1]
    for i, (x, y) in enumerate(np.stack(_around(sheet.angle_rad, at_m), axis=1)):
        axes.text(x, y, str(i), fontsize=SMALL_PT, color=_RAY, ha="center", va="center")


def _draw_scan(axes: Any, sheet: ScanSpec) -> None:
    """Rays that end in the view, or fade where they would leave it."""
    from matplotlib.collections import LineCollection

    x, y = _turned(np.array([sheet.at_m]), np.zeros(1))
    half_m = axes.get_xlim()[1]
    whole = sheet.range_m <= half_m
    parts_m = np.array([0.0, sheet.range_m]) if whole else half_m * np.linspace(_FADES_FROM, 1.0, _FADING + 1)
    parts_m[0] = 0.0
    points = np.stack([np.stack(_around(sheet.angle_rad, at_m), axis=1) for at_m in parts_m], axis=1)
    points += np.stack([x, y], axis=1)[:, None]  # (rays, ends of parts, 2)
    width = max(0.15, min(0.9, 20.0 / sheet.rays))
    label = f"{'scan' if sheet.rays > 1 else 'range finder'}, to {sheet.range_m:g} m"
    for part, opacity in enumerate(np.linspace(1.0, 0.0, len(parts_m) - 1, endpoint=False)):
        look: Look = {"colors": _SCAN, "linewidths": width, "zorder": 1, "alpha": opacity, "capstyle": "butt"}
        named: Look = {} if part else {"label": label}
        axes.add_collection(LineCollection(list(points[:, part : part + 2]), **look, **named))


def _draw_photocells(axes: Any, radius_m: float, sheet: LightSpec) -> None:
    x, y = _around(sheet.angle_rad, 0.86 * radius_m)
    look: Look = {"markerfacecolor": LIGHT, "markeredgecolor": LIGHT_EDGE, "markeredgewidth": 0.7}
    axes.plot(x, y, "s", markersize=3.6, zorder=6, label="photocell", **look)


def _around(angle_rad: FloatArray, at_m: float) -> tuple[FloatArray, FloatArray]:
    """Points at this distance, for angles from ahead."""
    return _turned(at_m * np.cos(angle_rad), at_m * np.sin(angle_rad))


def _turned(ahead_m: ArrayLike, left_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Points of the body's frame in the picture, where ahead is up: turned by a quarter."""
    c, s = math.cos(math.pi / 2), math.sin(math.pi / 2)
    ahead, left = np.asarray(ahead_m, np.float64), np.asarray(left_m, np.float64)
    return c * ahead - s * left, s * ahead + c * left


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
