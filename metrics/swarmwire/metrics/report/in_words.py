"""Numbers as people read them in a report."""

import math

_WHOLE = 1000.0  # from which on what is after the point says nothing


def number(value: float | None) -> str:
    """Three digits that count, with commas from a thousand on; a dash for what is undefined."""
    if value is None or math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    text = f"{value:,.0f}" if abs(value) >= _WHOLE else f"{value:.3g}"
    return text.replace("-", "−", 1) if text.startswith("-") else text


def share(value: float | None) -> str:
    """A share in percent."""
    return "–" if value is None or math.isnan(value) else f"{value:.1%}"


def counted(count: int, what: str, many: str = "") -> str:
    """`1 run`, `1,200 runs`."""
    return f"{count:,} {what if count == 1 else many or what + 's'}"


def short(value: float, _place: int = 0) -> str:
    """A number beside an axis: thousands as k, millions as M, so that there is room for it (a formatter of ticks)."""
    for power, letter in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if abs(value) >= power:
            return f"{value / power:g}{letter}".replace("-", "−")
    return f"{value:.6g}".replace("-", "−")


def shortened(text: str, most: int) -> str:
    """A text of so many letters at most: the end of a longer one is left out.

    >>> shortened("kinematic", 9), shortened("kinematic", 5)
    ('kinematic', 'kine…')
    """
    return text if len(text) <= most else f"{text[: most - 1]}…"
