"""Numbers and names as text, for pages, figures, tables, terminals and JSON."""

import math
from collections.abc import Sequence

UNKNOWN_TEXT = "–"  # text of a missing number
_NO_DECIMALS = 1000.0  # least number that is written without decimals


def json_number(number: float) -> float | None:
    """Return a Python float, or None for NaN, which JSON lacks."""
    value = float(number)
    return None if math.isnan(value) else value


def number(value: float | None) -> str:
    """Write a number for a page: three significant digits, commas from a thousand on, a true minus; a dash for NaN."""
    if value is None or math.isnan(value):
        return UNKNOWN_TEXT
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    return _minus(f"{value:,.0f}" if abs(value) >= _NO_DECIMALS else f"{value:.3g}")


def number_text(value: float, sign: bool = False) -> str:
    """Write a number for a table of a terminal or a CSV file: three significant digits, or all before the point.

    >>> number_text(0.12345), number_text(12345.6), number_text(0.5, sign=True), number_text(-0.0)
    ('0.123', '12346', '+0.5', '0')
    """
    if math.isnan(value):
        return UNKNOWN_TEXT
    if value == 0.0:
        return "0"
    signed = "+" if sign else ""
    return f"{value:{signed}.0f}" if _NO_DECIMALS <= abs(value) < 1e9 else f"{value:{signed}.3g}"


def short(value: float, _tick: int = 0) -> str:
    """Write a number for an axis, as short as possible: k for thousands, M for millions (a formatter of ticks)."""
    for power, letter in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if abs(value) >= power:
            return f"{value / power:g}{letter}".replace("-", "−")
    return f"{value:.6g}".replace("-", "−")


def share(value: float | None) -> str:
    """Write a share in percent."""
    return UNKNOWN_TEXT if value is None or math.isnan(value) else f"{value:.1%}"


def counted(count: int, noun: str, plural: str = "") -> str:
    """Write a number and its noun, such as `1 run` or `1,200 runs`."""
    return f"{count:,} {noun if count == 1 else plural or noun + 's'}"


def shortened(text: str, most: int) -> str:
    """Cut a text to at most `most` letters; a longer text ends in an ellipsis.

    >>> shortened("kinematic", 9), shortened("kinematic", 5)
    ('kinematic', 'kine…')
    """
    return text if len(text) <= most else f"{text[: most - 1]}…"


def listed(words: Sequence[str]) -> str:
    """Join words to a list such as `a, b and c`."""
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1]))) if words else ""


def abbreviate(words: Sequence[str], most: int) -> str:
    """Join the first words, and the number of the others.

    >>> abbreviate(["a", "b", "c", "d"], 2), abbreviate(["a"], 2)
    ('a, b and 2 more', 'a')
    """
    return ", ".join(words[:most]) + (f" and {len(words) - most} more" if len(words) > most else "")


def sentence(text: str) -> str:
    """Return the text with a capital letter at its start."""
    return text[:1].upper() + text[1:]


def _minus(text: str) -> str:
    return text.replace("-", "−", 1) if text.startswith("-") else text
