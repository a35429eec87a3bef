"""Markdown from values: tables, code, numbers."""

import math
from collections.abc import Iterable, Sequence
from typing import Any, cast

NOTHING = "–"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; a bar within a cell stays one, an empty cell is a dash."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(_cell(cell) for cell in line)} |" for line in lines) + "\n"


def code(text: str) -> str:
    """The text as code."""
    return f"`{text}`"


def number(value: float) -> str:
    """A number as people write it: 0.1, 250000, 1e9."""
    if isinstance(value, float) and not value.is_integer():
        return f"{value:.6g}" if math.isfinite(value) else str(value)
    whole = int(value)
    zeros = len(str(whole)) - len(str(whole).rstrip("0"))
    return f"{whole // 10**zeros}e{zeros}" if zeros >= 6 else str(whole)


def toml(value: Any) -> str:
    """A value as a scenario would give it; a dash for none."""
    if value is None or value in ([], {}):
        return NOTHING
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return number(value)
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml(item)}" for key, item in cast("dict[str, Any]", value).items()) + " }"
    if isinstance(value, list | tuple):
        return f"[{', '.join(toml(item) for item in cast('list[Any]', value))}]"
    return f'"{value}"'


def toml_code(value: object) -> str:
    """`toml` as code, unless it is a dash."""
    text = toml(value)
    return text if text == NOTHING else code(text)


def sentence(text: str) -> str:
    """The text without line breaks, from a capital letter to a full stop."""
    flat = " ".join(text.split())
    return flat[:1].upper() + flat[1:] + ("" if not flat or flat.endswith((".", "?", "!")) else ".")


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ") or NOTHING
