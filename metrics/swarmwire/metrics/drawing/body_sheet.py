"""A body on one sheet: from above and to scale, with its wheels and sensors, its figures, and where they come from."""

from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np

from swarmwire.comms.bodies.body import Body
from swarmwire.comms.sensors.rays import ProximitySpec
from swarmwire.metrics.drawing.body_facts import facts_of
from swarmwire.metrics.drawing.canvas import new_figure, save
from swarmwire.metrics.drawing.looks import CURVE, FAINT, GRID, INK, LONG_SIDE_IN, SMALL_PT, SOFT, TEXT_PT, TITLE_PT
from swarmwire.metrics.drawing.panel_text import ROW_IN, add_facts
from swarmwire.metrics.drawing.view_from_above import draw_from_above

_VIEW_IN, _UNDER_IN, _EDGE_IN, _HEAD_IN = 3.55, 0.25, 0.14, 0.4
_CAPTION_LETTERS, _CAPTION_ROW_IN = 118, 0.14
_CURVE_IN = 0.75
_VALUES_AT_IN = 0.95  # of facts, from their names


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
    """What a ray answers to the distance of what it meets."""
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
