"""The types of a message's fields."""

from typing import Any, get_args

import numpy as np

from reference.markdown import code, table
from swarmwire import agent


def field_table() -> str:
    """Every type that `swarmwire.agent` has for the fields of a message: size and range."""
    hints = {name: get_args(getattr(agent, name)) for name in agent.__all__}
    found: dict[str, np.dtype[Any]] = {
        name: hint[-1] for name, hint in hints.items() if hint and isinstance(hint[-1], np.dtype)
    }
    rows = [(code(name), str(of.itemsize), _range(of)) for name, of in found.items()]
    return table(("type", "bytes on air", "holds"), rows)


def _range(of: "np.dtype[Any]") -> str:
    if of.kind == "f":
        return f"a number, to {np.finfo(of).precision} digits"
    span = np.iinfo(of)
    return f"a whole number, {span.min} to {span.max}"
