"""What is left of a response when a share is lost, and the two shapes that were fitted to it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.drawing.looks import ACCENT, CURVE, INK, SOFT, Look
from swarmwire.metrics.report.figures.column_axes import column_axes, plain_legend


@dataclass(frozen=True)
class FittedShape:
    """A fit at shares (g,)."""

    label: str
    share: FloatArray
    value: FloatArray
    better: bool  # than the other


def resilience_curve(
    share: FloatArray,
    value: FloatArray,
    low: FloatArray,
    high: FloatArray,
    shapes: Sequence[FittedShape],
    title: str,
    x_label: str,
) -> Any:
    """The figure of values (k,) with their intervals, over shares (k,) that were lost."""
    figure, axes = column_axes(title, x_label)
    axes.axhline(1.0, color=SOFT, lw=0.7, ls=":", zorder=1)
    lines: Look = {"color": CURVE, "lw": 1.0, "zorder": 3, "clip_on": False}
    axes.vlines(share, low, high, **lines)
    axes.plot(share, value, "o", color=CURVE, ms=3.6, zorder=4, clip_on=False)
    for shape in shapes:
        look: Look = {"color": ACCENT, "lw": 1.4} if shape.better else {"color": INK, "lw": 0.9, "ls": (0, (4, 2))}
        axes.plot(shape.share, shape.value, label=shape.label, zorder=2, **look)
    axes.set_ylim(min(0.0, float(low.min())), None)
    axes.set_xlim(-0.03 * float(share[-1]), None)
    plain_legend(axes, loc="best")
    return figure
