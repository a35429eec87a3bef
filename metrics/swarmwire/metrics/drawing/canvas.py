"""Figures without pyplot: made, turned into pixels, and saved."""

from pathlib import Path
from typing import Any

from swarmwire.comms.arrays import ByteArray
from swarmwire.comms.errors import BadInput
from swarmwire.metrics.drawing.looks import LONG_SIDE_IN, PAPER
from swarmwire.metrics.report_extra import need_report_extra

SUFFIXES = (".png", ".svg", ".pdf")
LEAST_SIZE_PX, GREATEST_SIZE_PX = 100, 8000


def new_figure(width_in: float, height_in: float, size_px: int) -> Any:
    """An empty figure whose longer side has this many pixels; both sides are even, as films need them.

    BadInput without matplotlib, or for a size that nobody could look at.
    """
    need_report_extra("pictures")
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    if not LEAST_SIZE_PX <= size_px <= GREATEST_SIZE_PX:
        raise BadInput("--size", "", f"expected {LEAST_SIZE_PX} to {GREATEST_SIZE_PX} pixels, got {size_px}")
    dpi = size_px / LONG_SIDE_IN
    even = [2 * round(side * dpi / 2) / dpi for side in (width_in, height_in)]
    figure = Figure(figsize=(even[0], even[1]), dpi=dpi, facecolor=PAPER)
    FigureCanvasAgg(figure)
    return figure


def pixels(figure: Any) -> ByteArray:
    """What the canvas shows, (height, width, 3); a view that the next drawing overwrites."""
    import numpy as np

    return np.asarray(figure.canvas.buffer_rgba())[:, :, :3]


def save(figure: Any, to: Path) -> None:
    """Write a picture; its kind is that of the file's name. BadInput for another kind, or a path that cannot be."""
    import matplotlib as mpl

    check_path(to, SUFFIXES)
    # Equal pictures are equal bytes: no date, and names within an SVG that do not change.
    undated = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}[to.suffix.lower()]
    with mpl.rc_context({"svg.hashsalt": "swarmwire"}):
        figure.savefig(to, dpi=figure.dpi, metadata=undated)


def check_path(to: Path, suffixes: tuple[str, ...]) -> None:
    """Return if a file of one of these kinds can be written there; else BadInput."""
    if to.suffix.lower() not in suffixes:
        raise BadInput(str(to), "", f"expected a file name that ends in {' or '.join(suffixes)}")
    if not to.parent.is_dir() or to.is_dir():
        raise BadInput(str(to), "", "expected a path in a folder that exists")
