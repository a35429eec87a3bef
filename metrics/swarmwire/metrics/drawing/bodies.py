"""The picture of a body: the view from above, its figures, the response of its proximity sensors, and its source."""

import math
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np

from swarmwire.comms.bodies.body import Body
from swarmwire.comms.bodies.custom import CustomSensorSpec
from swarmwire.comms.bodies.drives import Holonomic, Twist, Wheels
from swarmwire.comms.sensors.camera import CameraSpec
from swarmwire.comms.sensors.imu import ImuSpec
from swarmwire.comms.sensors.light import LightSpec
from swarmwire.comms.sensors.rays import ProximitySpec, RayArraySpec
from swarmwire.comms.sensors.scan import ScanSpec
from swarmwire.comms.sensors.sensor import SensorSpec
from swarmwire.comms.sensors.simple import (
    BatterySpec,
    BumperSpec,
    CompassSpec,
    GroundSpec,
    OdometrySpec,
    PositioningSpec,
)
from swarmwire.metrics.drawing.body_view import draw_from_above
from swarmwire.metrics.drawing.canvas import new_figure, save
from swarmwire.metrics.drawing.style import (
    CURVE,
    FAINT,
    GRID,
    INK,
    LONG_SIDE_IN,
    ROW_IN,
    SMALL_PT,
    SOFT,
    TEXT_PT,
    TITLE_PT,
    add_facts,
)

_VIEW_IN, _UNDER_IN, _EDGE_IN, _HEAD_IN = 3.55, 0.25, 0.14, 0.4
_CAPTION_LETTERS, _CAPTION_ROW_IN = 118, 0.14
_CURVE_IN = 0.75
_VALUES_AT_IN = 0.95  # of facts, from their names


def facts_of(body: Body) -> list[tuple[str, str]]:
    """Name and value of each; a fact without a name goes on with the one above."""
    drive = body.drive
    facts = [
        ("size", f"{_length(2.0 * body.radius_m)} across, {_length(body.height_m)} high"),
        ("mass", f"{body.mass_kg:g} kg"),
        ("wheels", "none, it is holonomic" if isinstance(drive, Holonomic) else _apart(drive)),
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
    facts.extend((name, _own(sheet.kind)) for name, sheet in body.actuators.items())
    return facts


def _sensor_facts(sheet: SensorSpec, altitude_m: float) -> list[str]:
    match sheet:
        case RayArraySpec():
            return [f"{len(sheet.angles_deg)} rays of {_length(sheet.range_m)}", *_noise(sheet.noise)]
        case ScanSpec():
            return [
                f"{_count(sheet.rays, 'ray')} of {_length(sheet.range_m)}",
                _error(_length(sheet.noise_m), sheet.noise_m),
            ]
        case GroundSpec():
            return [f"{len(sheet.points_m)} points under the body", *_noise(sheet.noise)]
        case CameraSpec():
            return [f"LEDs within {_length(sheet.reach_m(altitude_m))}"]
        case LightSpec():
            return [_count(len(sheet.angles_deg), "photocell"), *_noise(sheet.noise)]
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
            return [_own(sheet.kind)]
        case _:
            return ["yes"]


def _own(kind: str) -> str:
    """The name of a custom class, without the folders of its file."""
    return f"by {kind.rpartition('/')[2]}"


def _apart(drive: Wheels | Twist) -> str:
    return f"{_length(drive.wheel_base_m)} apart"


def _noise(half_width: float) -> list[str]:
    return [f"noise ±{half_width:g} of 1"] if half_width else []


def _error(text: str, size: float) -> str:
    return f"error {text}" if size else "no error"


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def _length(metres: float) -> str:
    return f"{100.0 * metres:.3g} cm" if metres < 1.0 else f"{metres:.3g} m"


def draw_body(body: Body, to: Path, size_px: int) -> None:
    """Write the picture of a body. BadInput for a path or a size that cannot be."""
    facts = facts_of(body)
    caption = wrap(f"Source: {body.source}", _CAPTION_LETTERS)
    curve_in = _CURVE_IN + 0.7 if body.proximity else 0.0
    main_in = max(_VIEW_IN + _UNDER_IN, len(facts) * ROW_IN + curve_in)
    foot_in = 0.16 + len(caption) * _CAPTION_ROW_IN
    height_in = _HEAD_IN + main_in + 0.12 + foot_in
    figure = new_figure(LONG_SIDE_IN, height_in, size_px)

    def place(left_in: float, low_in: float, width_in: float, up_in: float) -> tuple[float, float, float, float]:
        return left_in / LONG_SIDE_IN, low_in / height_in, width_in / LONG_SIDE_IN, up_in / height_in

    top = 1.0 - 0.24 / height_in
    figure.text(_EDGE_IN / LONG_SIDE_IN, top, body.name, fontsize=TITLE_PT, fontweight="bold", color=INK)
    view_low_in = foot_in + 0.12 + main_in - _VIEW_IN
    draw_from_above(figure.add_axes(place(_EDGE_IN, view_low_in, _VIEW_IN, _VIEW_IN)), body)
    left_in = _EDGE_IN + _VIEW_IN + 0.2
    add_facts(
        figure, facts, left_in / LONG_SIDE_IN, 1.0 - _HEAD_IN / height_in, height_in, _VALUES_AT_IN / LONG_SIDE_IN
    )
    if body.proximity:
        low_in = foot_in + 0.42
        at = place(left_in + 0.22, low_in, LONG_SIDE_IN - _EDGE_IN - left_in - 0.25, _CURVE_IN)
        _draw_response(figure.add_axes(at), body.proximity)
    for i, line in enumerate(reversed(caption)):
        low = (0.14 + i * _CAPTION_ROW_IN) / height_in
        figure.text(_EDGE_IN / LONG_SIDE_IN, low, line, fontsize=SMALL_PT, color=SOFT)
    save(figure, to)


def _draw_response(axes: Any, proximity: ProximitySpec) -> None:
    """The response of a ray over the distance of the nearest thing."""
    distance_m = np.linspace(0.0, proximity.range_m, 400)
    axes.plot(100.0 * distance_m, proximity.response.value(distance_m), color=CURVE, lw=1.4)
    axes.set_xlim(0.0, 100.0 * proximity.range_m)
    axes.set_ylim(-0.03, 1.05)
    axes.set_facecolor("none")
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.spines["bottom"].set(color=FAINT, linewidth=0.7)
    axes.grid(axis="y", color=GRID, linewidth=0.6)
    axes.tick_params(labelsize=SMALL_PT, colors=SOFT, length=0, pad=2)
    axes.locator_params(axis="y", nbins=2)
    axes.locator_params(axis="x", nbins=5)
    axes.set_title("a ray's answer", loc="left", fontsize=TEXT_PT, color=SOFT, pad=4)
    axes.set_xlabel("distance from the rim in cm", fontsize=SMALL_PT, color=SOFT, labelpad=1)
