"""A value as TOML, in one line: for overrides of design points, which are text."""

import json
import math
from collections.abc import Mapping, Sequence
from typing import cast


def toml_value(value: object) -> str:
    """The text that TOML reads as this value: a text, a number, true or false, a list or a table of such.

    >>> toml_value([1, 0.5, "a", True])
    '[1, 0.5, "a", true]'
    """
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)  # inf, -inf, nan
    if isinstance(value, Mapping):
        table = cast("Mapping[str, object]", value)
        return "{" + ", ".join(f"{json.dumps(key)} = {toml_value(item)}" for key, item in table.items()) + "}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return "[" + ", ".join(toml_value(item) for item in cast("Sequence[object]", value)) + "]"
    return json.dumps(value)
