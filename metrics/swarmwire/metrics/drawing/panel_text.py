"""Columns of short facts in a panel of a picture."""

from collections.abc import Sequence
from typing import Any

from swarmwire.metrics.drawing.looks import INK, SOFT, TEXT_PT

ROW_IN = 0.185


def add_facts(
    figure: Any, facts: Sequence[tuple[str, str]], left: float, top: float, height_in: float, across: float
) -> float:
    """Write name and value in rows from these shares of the figure down; returns the share below the last row.

    `across` is the share of the figure's width from a name to its value; a fact without a name goes on with the one
    above it.
    """
    step = ROW_IN / height_in
    for name, value in facts:
        figure.text(left, top, name, fontsize=TEXT_PT, color=SOFT, va="top")
        figure.text(left + across, top, value, fontsize=TEXT_PT, color=INK, va="top")
        top -= step
    return top
