"""Values made from their types, and the fields of plain values by path."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from types import NoneType, UnionType
from typing import Any, Literal, get_args, get_origin, get_type_hints

from swarmwire.comms.robot.bodies.body import Body, load_body

SHEET = load_body("epuck")  # a body's own keys are the scenario's affair
PLAIN: dict[Any, Any] = {bool: True, int: 1, float: 0.5, str: "", Any: {}, Body: SHEET}
LEFT_OUT = ("nothing", "values", "all")
WORDS = {bool: "true or false", int: "whole number", float: "number", str: "text", bytes: "bytes", NoneType: "null"}


def sample(hint: Any, left_out: str = "nothing") -> Any:
    """A value of this type; what may be None is where `left_out` says "values" (but for records) or "all"."""
    if hint in PLAIN:
        return PLAIN[hint]
    if is_dataclass(hint):
        hints = get_type_hints(hint)
        return hint(**{field.name: sample(hints[field.name], left_out) for field in fields(hint)})
    origin, inner = get_origin(hint), get_args(hint)
    if origin is UnionType:
        is_set = left_out == "nothing" or (left_out == "values" and is_dataclass(inner[0]))
        return sample(inner[0], left_out) if is_set else None
    if origin is Literal:
        return inner[0]
    if origin in (dict, Mapping):
        return {"*": sample(inner[1], left_out)}
    if origin in (tuple, list):
        return origin(sample(item, left_out) for item in inner if item is not ...)
    return None


def paths_of(value: Any, path: str = "") -> dict[str, set[str]]:
    """The kinds of every field of a plain value, by its path; `*` stands for any place in a list."""
    if path.endswith(".body"):
        return {path: {"a body's sheet"}}
    if isinstance(value, Mapping):
        paths = {path: {"table"}} if path else {}
        inner = [(f"{path}.{name}".lstrip("."), item) for name, item in value.items()]
    elif isinstance(value, list | tuple):
        paths = {path: {"list"}}
        inner = [(f"{path}.*", item) for item in value]
    else:
        return {path: {WORDS[type(value)]}}
    return joined(paths, *(paths_of(item, below) for below, item in inner))


def joined(*several: dict[str, set[str]]) -> dict[str, set[str]]:
    """All paths, in the order in which they first come, with all kinds of each."""
    merged: dict[str, set[str]] = {}
    for paths in several:
        for path, kinds in paths.items():
            merged[path] = merged.get(path, set()) | kinds
    return merged


def lines_of(paths: Mapping[str, set[str]]) -> str:
    """A line for each path."""
    return "".join(f"{path}: {' or '.join(sorted(kinds))}\n" for path, kinds in paths.items())
