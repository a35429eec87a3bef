"""Conversion of the tables of a body file to frozen dataclasses, with a check of every key, type and bound."""

from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from math import isfinite
from types import UnionType
from typing import Any, cast, get_args, get_origin, get_type_hints

from swarmwire.comms.base.config import bounds_of, did_you_mean, fault_of
from swarmwire.comms.base.errors import BadInput

MAX_NUMBER = 1e9  # larger than any property of a robot in its unit
MAX_ITEMS = 1000  # items of a list, each of which may cost memory for every robot


def mapping_of(where: str, key: str, value: object) -> dict[str, Any]:
    """Return a table as a dict; BadInput with `where` and `key` if the value is no table."""
    if not isinstance(value, Mapping):
        raise BadInput(where, key, f"expected a table, got {value!r}")
    return {str(name): item for name, item in cast("Mapping[object, Any]", value).items()}


def parse_table(kind: type[Any], value: object, where: str, key: str) -> Any:
    """Make an instance of the dataclass `kind` from its table; BadInput names `where` and the key of a fault."""
    table = mapping_of(where, key, value)
    hints = get_type_hints(kind)
    fields_by_name = {field.name: field for field in fields(kind)}
    values: dict[str, Any] = {}
    for name in table:
        if name not in fields_by_name:
            raise BadInput(where, _join(key, name), f"unknown key; expected {did_you_mean(fields_by_name, name)}")
    for name, field in fields_by_name.items():
        if name in table:
            values[name] = _value(hints[name], table[name], where, _join(key, name))
            bounds = bounds_of(field)
            fault = fault_of(values[name], bounds) if isinstance(values[name], float | int) else None
            if bounds.choices and values[name] not in bounds.choices:
                fault = f"expected {did_you_mean(bounds.choices, values[name])}; got {values[name]!r}"
            if fault:
                raise BadInput(where, _join(key, name), fault)
        elif field.default is MISSING and field.default_factory is MISSING:
            raise BadInput(where, _join(key, name), ": ".join(filter(None, ("is missing", bounds_of(field).help))))
    return kind(**values)


def _value(hint: Any, value: object, where: str, key: str) -> Any:
    """Return a value of a table, converted to the type `hint`."""
    if is_dataclass(hint) and isinstance(hint, type):
        return parse_table(hint, value, where, key)
    if isinstance(hint, UnionType) and not is_dataclass(get_args(hint)[0]):
        return _value(get_args(hint)[0], value, where, key)  # X of X | None
    if hint is float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise BadInput(where, key, f"expected a number, got {value!r}")
        if isinstance(value, float) and not isfinite(value):
            raise BadInput(where, key, f"expected a finite number, got {value!r}")
        if abs(value) > MAX_NUMBER:
            raise BadInput(where, key, f"expected a number of at most {MAX_NUMBER:g} in size, got {str(value)[:40]}")
        return float(value)
    if hint is int and type(value) is not int:
        raise BadInput(where, key, f"expected a whole number, got {value!r}")
    if get_origin(hint) is tuple:
        if not isinstance(value, list | tuple):
            raise BadInput(where, key, f"expected a list, got {value!r}")
        items = cast("list[object]", value)
        if not items:
            raise BadInput(where, key, "expected at least one item")
        if len(items) > MAX_ITEMS:
            raise BadInput(where, key, f"expected at most {MAX_ITEMS} items, got {len(items)}")
        if get_args(hint)[-1] is not Ellipsis and len(items) != len(get_args(hint)):
            raise BadInput(where, key, f"expected {len(get_args(hint))} values, got {value!r}")
        return tuple(_value(get_args(hint)[0], item, where, f"{key}[{i}]") for i, item in enumerate(items))
    if hint is str and not isinstance(value, str):
        raise BadInput(where, key, f"expected a text, got {value!r}")
    if hint is bool and not isinstance(value, bool):
        raise BadInput(where, key, f"expected true or false, got {value!r}")
    return value


def _join(key: str, name: str) -> str:
    return f"{key}.{name}" if key else name
