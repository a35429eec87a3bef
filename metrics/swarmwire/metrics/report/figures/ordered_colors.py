"""Colours of curves that stand in an order, told apart by those who cannot tell red from green, and in print."""

from typing import Any

_FROM, _TO = 0.05, 0.82  # of the map: its end is too light for lines on white


def ordered_colors(count: int) -> list[Any]:
    """So many colours, from dark to light."""
    import matplotlib as mpl

    colors = mpl.colormaps["viridis"]
    return [colors(_FROM + (_TO - _FROM) * place / max(count - 1, 1)) for place in range(count)]
