"""Common elements of pictures: colours, sizes of letters, figures without pyplot, plain axes, layout of an arena."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from swarmwire.comms.base.arrays import ByteArray
from swarmwire.comms.base.atomic import check_output_path, output_file
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.extras import REPORT
from swarmwire.comms.robot.packets import Fate

Color = tuple[int, int, int]  # red, green, blue, 0 to 255

ROBOT_COLORS: tuple[Color, ...] = (
    (86, 180, 233),
    (240, 160, 50),
    (0, 200, 140),
    (230, 110, 180),
    (160, 140, 250),
    (150, 210, 60),
    (235, 125, 100),
    (90, 210, 220),
    (200, 165, 125),
    (240, 185, 225),
)
Look = dict[str, Any]  # matplotlib's keyword arguments for colours, widths and the like

LONG_SIDE_IN = 6.4  # pictures are laid out in inches for this long side; pixels only scale them
TITLE_PT, TEXT_PT, SMALL_PT = 9.5, 7.5, 6.5

INK, SOFT, FAINT, GRID = "#20242b", "#69707d", "#b9bfc9", "#e6e9ee"
PAPER, FLOOR = "#ffffff", "#f4f6f9"  # different enough for a GIF's palette
WALL, OBSTACLE, OBSTACLE_EDGE = "#5c6370", "#d3d8df", "#8f97a3"
MOVABLE, MOVABLE_EDGE = "#ead9bd", "#94743c"  # obstacles that robots push
LIGHT, LIGHT_EDGE = "#ffd23f", "#c98f00"
LINK = "#7d8aa5"
MOVABLE_DASHES = (0, (2.5, 1.5))
DEAD: Color = (176, 180, 188)
CURVE = "#2f6fae"
ACCENT = "#c2502e"  # highlights; distinct from the curves' blue also for colour-blind readers
STATE_COLORS: tuple[Color, ...] = (
    (76, 120, 168),
    (245, 133, 24),
    (84, 162, 75),
    (228, 87, 86),
    (178, 121, 162),
    (238, 202, 59),
    (114, 183, 178),
    (157, 117, 93),
)
OTHER_STATE: Color = (205, 208, 214)  # colour of robots in states without an own colour
FATE_COLORS: dict[Fate, Color] = {
    Fate.RECEIVED: (86, 180, 233),
    Fate.BLOCKED: (240, 180, 60),
    Fate.LOST: (235, 85, 75),
    Fate.QUEUE_FULL: (160, 140, 250),
    Fate.TOO_LARGE: (205, 205, 110),
    Fate.IN_FLIGHT: (0, 200, 140),
    Fate.SENDER_DEAD: (125, 125, 135),
    Fate.RECEIVER_DEAD: (175, 175, 185),
    Fate.BLACKOUT: (190, 95, 235),
    Fate.PARTITIONED: (255, 130, 195),
    Fate.TOO_WEAK: (200, 155, 95),
    Fate.COLLIDED: (255, 120, 40),
    Fate.BURST: (175, 45, 85),
    Fate.CHANNEL_BUSY: (150, 170, 60),
    Fate.JAMMED: (120, 85, 205),
    Fate.DUTY_CYCLE: (95, 140, 120),
    Fate.NOT_LISTENING: (110, 130, 175),
}  # out of range has no colour: such receivers are counted, never listed

_SHADE = 0.58  # brightness of an outline relative to its fill
ROW_IN = 0.185
PICTURE_SIZE_PX, MIN_SIZE_PX, MAX_SIZE_PX = 1280, 100, 8000  # longer side
PAD = 0.02  # margin of the arena relative to its longer side, with room for walls and robots at them
_EDGE_IN, _GAP_IN = 0.14, 0.2
_TITLE_IN, _LEGEND_ROW_IN = 0.36, 0.19
_RIGHT_PANEL_IN = 1.95
_FOOT_IN = 0.26  # below the arena: a scale bar, or part of its axes
_MIN_WIDTH_IN = 3.9
_MIN_ASPECT = 0.62  # the panel is right of arenas with at least this ratio of height to width


def robot_color(index: int) -> Color:
    """Return the colour of the group or state with this index; colours repeat after the last."""
    return ROBOT_COLORS[index % len(ROBOT_COLORS)]


def rgb(color: Color) -> tuple[float, float, float]:
    """Return a colour in matplotlib's range, 0 to 1."""
    red, green, blue = color
    return red / 255, green / 255, blue / 255


def shade(color: Color) -> tuple[float, float, float]:
    """Return the darker colour of the same hue, for outlines and thin lines on a light background."""
    red, green, blue = rgb(color)
    return red * _SHADE, green * _SHADE, blue * _SHADE


def plain_axes(figure: Any, box: tuple[float, float, float, float], title: str) -> Any:
    """Add axes in a box (left, bottom, width, height) as shares of the figure."""
    axes = figure.add_axes(box)
    axes.set_facecolor("none")
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.spines["bottom"].set(color=FAINT, linewidth=0.7)
    axes.grid(axis="y", color=GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(which="both", labelsize=SMALL_PT, colors=SOFT, length=0, pad=2)
    axes.set_title(title, loc="left", fontsize=TEXT_PT, color=SOFT, pad=4)
    return axes


def add_facts(
    figure: Any, facts: Sequence[tuple[str, str]], left: float, top: float, height_in: float, across: float
) -> float:
    """Write names and values in rows, downwards from these shares of the figure; return the share below the last row.

    `across` is the share of the figure's width from a name to its value; a fact without a name continues the one
    above it.
    """
    step = ROW_IN / height_in
    for name, value in facts:
        figure.text(left, top, name, fontsize=TEXT_PT, color=SOFT, va="top")
        figure.text(left + across, top, value, fontsize=TEXT_PT, color=INK, va="top")
        top -= step
    return top


def new_figure(width_in: float, height_in: float, size_px: int = PICTURE_SIZE_PX) -> Any:
    """Return an empty figure whose longer side has this many pixels; both sides are even, which films need.

    BadInput without matplotlib, or for a size out of bounds.
    """
    REPORT.need("pictures")
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    if not MIN_SIZE_PX <= size_px <= MAX_SIZE_PX:
        raise BadInput("--size", "", f"expected {MIN_SIZE_PX} to {MAX_SIZE_PX} pixels, got {size_px}")
    dpi = size_px / max(width_in, height_in, LONG_SIDE_IN)
    # A hundredth more, since the canvas rounds down.
    even = [(2 * round(side * dpi / 2) + 0.01) / dpi for side in (width_in, height_in)]
    figure = Figure(figsize=(even[0], even[1]), dpi=dpi, facecolor=PAPER)
    FigureCanvasAgg(figure)
    return figure


def pixels(figure: Any) -> ByteArray:
    """Return the pixels of the canvas, (height, width, 3); a view that the next drawing overwrites."""
    return np.asarray(figure.canvas.buffer_rgba())[:, :, :3]


def check_picture(to: Path) -> None:
    """Raise BadInput unless a picture can be written to this path, and its suffix is .png, .svg or .pdf."""
    check_output_path(to, (".png", ".svg", ".pdf"))


def save(figure: Any, to: Path) -> None:
    """Write a picture in the format of the suffix. BadInput for another suffix, or a path that cannot be written."""
    import matplotlib as mpl

    check_picture(to)
    # Without dates, and with fixed ids in an SVG, equal pictures are equal bytes.
    metadata = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}[to.suffix.lower()]
    with output_file(to) as part, cast("Any", mpl).rc_context({"svg.hashsalt": "swarmwire"}):
        figure.savefig(part, dpi=figure.dpi, metadata=metadata)


@dataclass(frozen=True)
class FigureLayout:
    """Rectangles (left, bottom, width, height) as shares of a figure of this size."""

    width_in: float
    height_in: float
    arena: tuple[float, float, float, float]
    panel: tuple[float, float, float, float] | None
    panel_on_right: bool  # the panel is right of the arena, not below

    @property
    def left(self) -> float:
        """Left end of titles."""
        return _EDGE_IN / self.width_in

    @property
    def right(self) -> float:
        """Right limit of titles."""
        return 1.0 - _EDGE_IN / self.width_in

    def below_top(self, inches: float) -> float:
        """Return the height, as a share, at this distance below the upper edge."""
        return 1.0 - inches / self.height_in


def lay_out(size_m: tuple[float, float], panel_in: float, legend_rows: int, axes_in: float) -> FigureLayout:
    """Return the layout for an arena of this size, with room for its axes left and below.

    `panel_in` is the height of a panel below the arena; 0: no panel.
    """
    pad_m = 2.0 * PAD * max(size_m)
    width_m, height_m = size_m[0] + pad_m, size_m[1] + pad_m
    on_right = panel_in > 0.0 and height_m / width_m >= _MIN_ASPECT
    head_in = _TITLE_IN + legend_rows * _LEGEND_ROW_IN
    left_in = _EDGE_IN + axes_in
    right_in = _EDGE_IN + (_GAP_IN + _RIGHT_PANEL_IN if on_right else 0.0)
    below_in = 0.0 if on_right or not panel_in else _GAP_IN + panel_in
    bottom_in = _FOOT_IN + axes_in / 2 + below_in
    in_per_m = min((LONG_SIDE_IN - left_in - right_in) / width_m, (LONG_SIDE_IN - head_in - bottom_in) / height_m)
    arena_in = width_m * in_per_m, height_m * in_per_m
    width_in = max(left_in + arena_in[0] + right_in, _MIN_WIDTH_IN)
    height_in = head_in + arena_in[1] + bottom_in
    panel = None
    if on_right:  # wider next to a narrow arena
        panel_left_in = left_in + arena_in[0] + _GAP_IN
        panel = panel_left_in, bottom_in, width_in - _EDGE_IN - panel_left_in, arena_in[1]
    elif panel_in:
        panel = _EDGE_IN, _EDGE_IN, width_in - 2 * _EDGE_IN, panel_in

    def shares(rectangle: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
        x, y, width, height = rectangle
        return x / width_in, y / height_in, width / width_in, height / height_in

    arena = shares((left_in, bottom_in, *arena_in))
    return FigureLayout(width_in, height_in, arena, shares(panel) if panel else None, on_right)


def add_arena_axes(figure: Any, layout: FigureLayout, size_m: tuple[float, float]) -> Any:
    """Add axes of the arena in m, to scale, without lines."""
    axes = figure.add_axes(layout.arena)
    pad_m = PAD * max(size_m)
    half_x, half_y = size_m[0] / 2 + pad_m, size_m[1] / 2 + pad_m
    axes.set(xlim=(-half_x, half_x), ylim=(-half_y, half_y), aspect="equal")
    axes.set_axis_off()
    return axes
