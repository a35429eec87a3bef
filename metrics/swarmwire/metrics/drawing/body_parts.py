"""What sits on a body, from above and to scale, its front up: rays, scanner, photocells, bumper, LEDs."""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.bodies.body import Body
from swarmwire.comms.sensors.light import LightSpec
from swarmwire.comms.sensors.rays import InfraredSpec, ProximitySpec, RayArraySpec
from swarmwire.comms.sensors.scan import ScanSpec
from swarmwire.comms.sensors.simple import BumperSpec, GroundSpec
from swarmwire.metrics.drawing.looks import INK, LIGHT, LIGHT_EDGE, OBSTACLE_EDGE, PAPER, SMALL_PT, Look

_RAY, _PASSIVE, _SCAN, _LED = "#d1495b", "#7b4fa3", "#3a86a8", "#43aa5b"
_FADES_FROM, _FADING = 0.6, 10  # of the view, where rays that leave it begin to fade; and in so many steps
_NUMBER_AT = 0.055  # beyond the rays' ends, as a share of the view


def draw_parts(axes: Any, body: Body) -> None:
    """Draw the sensors that have a place on the body, and its LEDs, into axes whose limits are set."""
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
