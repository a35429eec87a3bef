"""Figures without pyplot: made, turned into pixels, and saved."""

from pathlib import Path
from typing import Any, cast

from swarmwire.comms.arrays import ByteArray
from swarmwire.comms.errors import BadInput
from swarmwire.comms.extras import REPORT
from swarmwire.metrics.atomic import check_output_path, output_file
from swarmwire.metrics.drawing.looks import LONG_SIDE_IN, PAPER

MIN_SIZE_PX, GREATEST_SIZE_PX = 100, 8000


def new_figure(width_in: float, height_in: float, size_px: int) -> Any:
    """An empty figure whose longer side has this many pixels; both sides are even, as films need them.

    BadInput without matplotlib, or for a size that nobody could look at.
    """
    REPORT.need("pictures")
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    if not MIN_SIZE_PX <= size_px <= GREATEST_SIZE_PX:
        raise BadInput("--size", "", f"expected {MIN_SIZE_PX} to {GREATEST_SIZE_PX} pixels, got {size_px}")
    dpi = size_px / max(width_in, height_in, LONG_SIDE_IN)
    # A hundredth more, since the canvas cuts off what is after the point.
    even = [(2 * round(side * dpi / 2) + 0.01) / dpi for side in (width_in, height_in)]
    figure = Figure(figsize=(even[0], even[1]), dpi=dpi, facecolor=PAPER)
    FigureCanvasAgg(figure)
    return figure


def pixels(figure: Any) -> ByteArray:
    """What the canvas shows, (height, width, 3); a view that the next drawing overwrites."""
    import numpy as np

    return np.asarray(figure.canvas.buffer_rgba())[:, :, :3]


def check_picture(to: Path) -> None:
    """Return if a picture may be written there, of the kind that the file's name says; else BadInput."""
    check_output_path(to, (".png", ".svg", ".pdf"))


def save(figure: Any, to: Path) -> None:
    """Write a picture; its kind is that of the file's name. BadInput for another kind, or a path that cannot be."""
    import matplotlib as mpl

    fixed = cast("Any", mpl).rc_context

    check_picture(to)
    # Equal pictures are equal bytes: no date, and names within an SVG that do not change.
    undated = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}[to.suffix.lower()]
    with output_file(to) as part, fixed({"svg.hashsalt": "swarmwire"}):
        figure.savefig(part, dpi=figure.dpi, metadata=undated)
