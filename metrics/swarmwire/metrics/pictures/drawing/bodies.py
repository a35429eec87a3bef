"""The picture of a body: from above, its facts, the response of its proximity sensors, and its source."""

import math
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.bodies.custom import CustomSensorSpec
from swarmwire.comms.robot.bodies.drives import Holonomic, Twist, Wheels
from swarmwire.comms.robot.sensors.camera import CameraSpec
from swarmwire.comms.robot.sensors.imu import ImuSpec
from swarmwire.comms.robot.sensors.light import LightSpec
from swarmwire.comms.robot.sensors.rays import InfraredSpec, ProximitySpec, RayArraySpec
from swarmwire.comms.robot.sensors.scan import ScanSpec
from swarmwire.comms.robot.sensors.sensor import SensorSpec
from swarmwire.comms.robot.sensors.simple import (
    BatterySpec,
    BumperSpec,
    CompassSpec,
    GroundSpec,
    OdometrySpec,
    PositioningSpec,
)
from swarmwire.metrics.pictures.drawing.canvas import (
    CURVE,
    INK,
    LIGHT,
    LIGHT_EDGE,
    LONG_SIDE_IN,
    OBSTACLE_EDGE,
    PAPER,
    ROW_IN,
    SMALL_PT,
    SOFT,
    TITLE_PT,
    Look,
    add_facts,
    new_figure,
    plain_axes,
    rgb,
    robot_color,
    save,
    shade,
)
from swarmwire.metrics.pictures.drawing.scene import round_length_m
from swarmwire.metrics.text import counted

_VIEW_IN, _UNDER_IN, _EDGE_IN, _HEAD_IN = 3.55, 0.25, 0.14, 0.4
_CAPTION_LETTERS, _CAPTION_ROW_IN = 118, 0.14
_CURVE_IN = 0.75
_SIZE_PX = 900
_VALUE_OFFSET_IN = 0.78  # offset of the values of facts from their names
_RAY, _PASSIVE, _SCAN, _LED = "#d1495b", "#7b4fa3", "#3a86a8", "#43aa5b"
_FADE_START, _FADE_STEPS = 0.6, 10  # share of the view at which rays that leave it begin to fade; steps
_NUMBER_OFFSET = 0.055  # distance of numbers from the rays' ends, as a share of the view
_COLOR = robot_color(0)
_VIEW_SCALE = 1.16  # size of the view relative to the drawing, with room for numbers at the ends of rays
_LEGEND_Y = -0.035  # height of legend and bar, as a share of the view's height
_MIN_LINE_PT = 0.9  # width of a line in the legend
_MIN_RADII = 2.0  # least extent of the view in each direction, in radii of the body


def facts_of(body: Body) -> list[tuple[str, str]]:
    """Return names and values of the body's facts; a fact without a name continues the previous one."""
    drive = body.drive
    facts = [
        ("size", f"{_length(2.0 * body.radius_m)} across, {_length(body.height_m)} high"),
        ("mass", f"{body.mass_kg:g} kg"),
        ("wheels", "none, it is holonomic" if isinstance(drive, Holonomic) else _wheel_distance(drive)),
        ("top speed", f"{body.max_linear_mps:.3g} m/s"),
        ("turns", f"{math.degrees(body.max_angular_radps):.0f} degrees/s"),
        ("drive", f"{drive.max_force_n:g} N, {drive.max_torque_nm:g} N m"),
    ]
    if body.altitude_m:
        facts.append(("flies", f"{_length(body.altitude_m)} up"))
    if body.leds:
        facts.append(("LEDs", f"{body.led_count}{', the last a beacon' if body.leds.beacon_height_m else ''}"))
    for name, sheet in body.sensors.items():
        facts.extend(zip((name, *[""] * 9), _sensor_facts(sheet, body.altitude_m), strict=False))
    facts.extend((name, _class_name(sheet.kind)) for name, sheet in body.actuators.items())
    return facts


def _sensor_facts(sheet: SensorSpec, altitude_m: float) -> list[str]:
    match sheet:
        case RayArraySpec():
            return [f"{len(sheet.angles_deg)} rays of {_length(sheet.range_m)}", *_noise(sheet.noise)]
        case ScanSpec():
            errors = [f"error {_length(sheet.noise_m)}"] if sheet.noise_m else []
            errors += [f"error {100 * sheet.noise_relative:.2g} % of the distance"] if sheet.noise_relative else []
            return [f"{counted(sheet.rays, 'ray')} of {_length(sheet.range_m)}", *(errors or ["no error"])]
        case GroundSpec():
            return [f"{len(sheet.points_m)} points under the body", *_noise(sheet.noise)]
        case CameraSpec():
            return [f"LEDs within {_length(sheet.reach_m(altitude_m))}"]
        case LightSpec():
            return [counted(len(sheet.angles_deg), "photocell"), *_noise(sheet.noise)]
        case CompassSpec():
            return [_error(f"{math.degrees(sheet.noise_rad):.2g} degrees", sheet.noise_rad)]
        case OdometrySpec():
            step = f", step {sheet.step_m * 1000:.2g} mm" if sheet.step_m else ""
            return [f"slip {100 * sheet.slip:.2g} %{step}"]
        case PositioningSpec():
            return [_error(_length(sheet.noise_m), sheet.noise_m)]
        case BumperSpec():
            return ["the whole rim"]
        case ImuSpec():
            return [f"noise {sheet.noise_mps2:.2g} m/s²", f"{math.degrees(sheet.noise_radps):.2g} degrees/s"]
        case BatterySpec():
            return [f"{sheet.capacity_wh:g} Wh, {sheet.full_v:g} V"]
        case CustomSensorSpec():
            return [_class_name(sheet.kind)]
        case _:
            return ["yes"]


def _class_name(kind: str) -> str:
    """Return the name of a custom class, without the folders of its file."""
    return f"by {kind.rpartition('/')[2]}"


def _wheel_distance(drive: Wheels | Twist) -> str:
    return f"{_length(drive.wheel_base_m)} apart"


def _noise(half_width: float) -> list[str]:
    return [f"noise ±{half_width:g} of 1"] if half_width else []


def _error(text: str, size: float) -> str:
    return f"error {text}" if size else "no error"


def _length(metres: float) -> str:
    return f"{100.0 * metres:.3g} cm" if metres < 1.0 else f"{metres:.3g} m"


def draw_body(body: Body, to: Path) -> None:
    """Write the picture of a body. BadInput for a path that cannot be written."""
    facts = facts_of(body)
    caption = wrap(f"Source: {body.source}", _CAPTION_LETTERS)
    curve_in = _CURVE_IN + 0.7 if body.proximity else 0.0
    main_in = max(_VIEW_IN + _UNDER_IN, len(facts) * ROW_IN + curve_in)
    foot_in = 0.16 + len(caption) * _CAPTION_ROW_IN
    height_in = _HEAD_IN + main_in + 0.12 + foot_in
    figure = new_figure(LONG_SIDE_IN, height_in, _SIZE_PX)

    def shares(left_in: float, low_in: float, width_in: float, up_in: float) -> tuple[float, float, float, float]:
        return left_in / LONG_SIDE_IN, low_in / height_in, width_in / LONG_SIDE_IN, up_in / height_in

    top = 1.0 - 0.24 / height_in
    figure.text(_EDGE_IN / LONG_SIDE_IN, top, body.name, fontsize=TITLE_PT, fontweight="bold", color=INK)
    view_low_in = foot_in + 0.12 + main_in - _VIEW_IN
    draw_from_above(figure.add_axes(shares(_EDGE_IN, view_low_in, _VIEW_IN, _VIEW_IN)), body)
    left_in = _EDGE_IN + _VIEW_IN + 0.2
    add_facts(
        figure, facts, left_in / LONG_SIDE_IN, 1.0 - _HEAD_IN / height_in, height_in, _VALUE_OFFSET_IN / LONG_SIDE_IN
    )
    if body.proximity:
        low_in = foot_in + 0.42
        box = shares(left_in + 0.22, low_in, LONG_SIDE_IN - _EDGE_IN - left_in - 0.25, _CURVE_IN)
        _draw_response(plain_axes(figure, box, "response of a ray"), body.proximity)
    for i, line in enumerate(reversed(caption)):
        low = (0.14 + i * _CAPTION_ROW_IN) / height_in
        figure.text(_EDGE_IN / LONG_SIDE_IN, low, line, fontsize=SMALL_PT, color=SOFT)
    save(figure, to)


def _draw_response(axes: Any, proximity: ProximitySpec) -> None:
    """Draw the response of a ray over the distance of the nearest object."""
    distance_m = np.linspace(0.0, proximity.range_m, 400)
    axes.plot(100.0 * distance_m, proximity.response.value(distance_m), color=CURVE, lw=1.4)
    axes.set_xlim(0.0, 100.0 * proximity.range_m)
    axes.set_ylim(-0.03, 1.05)
    axes.locator_params(axis="y", nbins=2)
    axes.locator_params(axis="x", nbins=5)
    axes.set_xlabel("distance from the rim in cm", fontsize=SMALL_PT, color=SOFT, labelpad=1)


def draw_parts(axes: Any, body: Body) -> None:
    """Draw the sensors with a position on the body, and its LEDs, into axes with final limits."""
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
                x, y = _rotated(*np.array(sheet.points_m).T)
                look: Look = {"markerfacecolor": PAPER, "markeredgecolor": INK, "markeredgewidth": 0.7}
                axes.plot(x, y, "v", markersize=3.6, zorder=6, label="ground sensor", **look)
            case BumperSpec():
                x, y = _polar(np.linspace(0.0, 2.0 * np.pi, 181), body.radius_m)
                axes.plot(x, y, color=OBSTACLE_EDGE, lw=3.4, zorder=2.5, label="bumper")
            case _:
                pass  # no position on the body, or invisible from above
    if body.leds is not None:
        x, y = _rotated(*body.leds.positions_m(body.radius_m)[:, :2].T)
        axes.plot(x, y, "o", color=_LED, markersize=2.8, zorder=6.5, label="LED")


def _draw_rays(axes: Any, radius_m: float, sheet: RayArraySpec, label: str, color: str, line: Any) -> None:
    from matplotlib.collections import LineCollection

    start, end = (np.stack(_polar(sheet.angle_rad, at), axis=1) for at in (radius_m, radius_m + sheet.range_m))
    look: Look = {"colors": color, "linewidths": 0.9, "linestyles": [line], "zorder": 2 if line == "-" else 2.2}
    axes.add_collection(LineCollection(list(np.stack([start, end], axis=1)), label=label, **look))
    axes.plot(start[:, 0], start[:, 1], "o", color=color, markersize=2.4, zorder=6)


def _number_rays(axes: Any, radius_m: float, sheet: RayArraySpec) -> None:
    """Write the indices that an agent uses."""
    at_m = radius_m + sheet.range_m + _NUMBER_OFFSET * axes.get_xlim()[1]
    for i, (x, y) in enumerate(np.stack(_polar(sheet.angle_rad, at_m), axis=1)):
        axes.text(x, y, str(i), fontsize=SMALL_PT, color=_RAY, ha="center", va="center")


def _draw_scan(axes: Any, sheet: ScanSpec) -> None:
    """Draw rays that end in the view, or fade before they leave it."""
    from matplotlib.collections import LineCollection

    x, y = _rotated(np.array([sheet.at_m]), np.zeros(1))
    half_m = axes.get_xlim()[1]
    is_in_view = sheet.range_m <= half_m
    parts_m = np.array([0.0, sheet.range_m]) if is_in_view else half_m * np.linspace(_FADE_START, 1.0, _FADE_STEPS + 1)
    parts_m[0] = 0.0
    points = np.stack([np.stack(_polar(sheet.angle_rad, at_m), axis=1) for at_m in parts_m], axis=1)
    points += np.stack([x, y], axis=1)[:, None]  # (rays, ends of parts, 2)
    width = max(0.15, min(0.9, 20.0 / sheet.rays))
    label = f"{'scan' if sheet.rays > 1 else 'range finder'}, to {sheet.range_m:g} m"
    for part, opacity in enumerate(np.linspace(1.0, 0.0, len(parts_m) - 1, endpoint=False)):
        look: Look = {"colors": _SCAN, "linewidths": width, "zorder": 1, "alpha": opacity, "capstyle": "butt"}
        if part == 0:
            look["label"] = label
        axes.add_collection(LineCollection(list(points[:, part : part + 2]), **look))


def _draw_photocells(axes: Any, radius_m: float, sheet: LightSpec) -> None:
    x, y = _polar(sheet.angle_rad, 0.86 * radius_m)
    look: Look = {"markerfacecolor": LIGHT, "markeredgecolor": LIGHT_EDGE, "markeredgewidth": 0.7}
    axes.plot(x, y, "s", markersize=3.6, zorder=6, label="photocell", **look)


def _polar(angle_rad: FloatArray, at_m: float) -> tuple[FloatArray, FloatArray]:
    """Return points at this distance, for angles from the heading."""
    return _rotated(at_m * np.cos(angle_rad), at_m * np.sin(angle_rad))


def _rotated(ahead_m: ArrayLike, left_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return points of the body's frame, rotated by 90 degrees, so that the heading is up."""
    c, s = math.cos(math.pi / 2), math.sin(math.pi / 2)
    ahead, left = np.asarray(ahead_m, np.float64), np.asarray(left_m, np.float64)
    return c * ahead - s * left, s * ahead + c * left


def draw_from_above(axes: Any, body: Body) -> None:
    """Draw the body into square axes.

    A data sheet does not contain the size of wheels, so their drawn size is a guess; their distance is exact.
    """
    rims = [sheet.range_m for sheet in body.sensors.values() if isinstance(sheet, RayArraySpec)]
    reach_m = body.radius_m + max(rims, default=0.0)
    half_m = _VIEW_SCALE * max(reach_m, _MIN_RADII * body.radius_m)
    axes.set(xlim=(-half_m, half_m), ylim=(-half_m, half_m), aspect="equal")
    axes.set_axis_off()
    _draw_disc(axes, body)
    if not isinstance(body.drive, Holonomic):
        _draw_wheels(axes, body.radius_m, body.drive.wheel_base_m)
    draw_parts(axes, body)
    _draw_heading(axes, body.radius_m)
    _draw_bar(axes, half_m)
    if axes.get_legend_handles_labels()[0]:
        look: Look = {
            "frameon": False,
            "fontsize": SMALL_PT,
            "labelcolor": SOFT,
            "borderaxespad": 0.0,
            "borderpad": 0.0,
            "handlelength": 1.1,
            "handletextpad": 0.4,
            "columnspacing": 0.8,
        }
        legend = axes.legend(ncols=3, loc="center right", bbox_to_anchor=(1.0, _LEGEND_Y), **look)
        for line in legend.get_lines():  # a single ray of a scan is too thin
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
    """Draw a bar of a round length at the bottom left."""
    length_m = round_length_m(0.4 * half_m)
    low, share = (2.0 * _LEGEND_Y - 1.0) * half_m, 0.04 * half_m
    axes.plot([-half_m, -half_m + length_m], [low, low], color=INK, lw=1.6, solid_capstyle="butt", clip_on=False)
    label = f"{100 * length_m:g} cm"
    axes.text(-half_m + length_m + share, low, label, fontsize=SMALL_PT, color=SOFT, va="center")
