"""Parameters made by `swarmwire.comms.config.parameter`, as rows of tables."""

from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any, get_type_hints

from reference.markdown import NOTHING, code, number, sentence, toml_code
from swarmwire.comms.config import Bounds, bounds_of

HEAD = ("key", "unit", "allowed", "default", "meaning")


def parameter_rows(kind: type[Any], prefix: str = "") -> list[tuple[str, str, str, str, str]]:
    """A row for each parameter of a dataclass, those of dataclasses within it under their path."""
    hints, rows = get_type_hints(kind), list[tuple[str, str, str, str, str]]()
    for of in fields(kind):
        limits, path = bounds_of(of), prefix + of.name
        rows.append((code(path), limits.unit, _allowed(limits), _default(of), sentence(limits.help)))
        if is_dataclass(hints[of.name]):
            rows += parameter_rows(hints[of.name], f"{path}.")
    return rows


def _default(of: "Field[Any]") -> str:
    if of.default is MISSING:
        return "required" if of.default_factory is MISSING else NOTHING
    return NOTHING if is_dataclass(of.default) else toml_code(of.default)  # keys of a table have their own


def _allowed(limits: Bounds) -> str:
    words = {"at least": limits.at_least, "at most": limits.at_most, "above": limits.above, "below": limits.below}
    bounds = [f"{word} {number(bound)}" for word, bound in words.items() if bound is not None]
    return ", ".join([*(code(f'"{choice}"') for choice in limits.choices), *bounds])
