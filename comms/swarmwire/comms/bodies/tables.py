"""Tables of a data sheet as the frozen dataclasses that they describe, checked key by key."""

from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from math import isfinite
from types import UnionType
from typing import Any, cast, get_args, get_origin, get_type_hints

from swarmwire.comms.config import bounds_of, did_you_mean, fault_of
from swarmwire.comms.errors import BadInput

GREATEST = 1e9  # of any number of a sheet: nothing on a robot is that large in its unit
MAX_ITEMS = 1000  # of a list: what is told of each is kept for every robot


def mapping_of(where: str, key: str, value: object) -> dict[str, Any]:
    """A table; BadInput names `where` and `key` if it is none."""
    if not isinstance(value, Mapping):
        raise BadInput(where, key, f"expected a table, got {value!r}")
    return {str(name): item for name, item in cast("Mapping[object, Any]", value).items()}


def built(kind: type[Any], value: object, where: str, key: str) -> Any:
    """An instance of the dataclass `kind` from its table; BadInput names `where` and the key of what is wrong."""
    given = mapping_of(where, key, value)
    hints = get_type_hints(kind)
    known = {of.name: of for of in fields(kind)}
    made: dict[str, Any] = {}
    for name in given:
        if name not in known:
            raise BadInput(where, _join(key, name), f"unknown key; expected {did_you_mean(known, name)}")
    for name, of in known.items():
        if name in given:
            made[name] = _value(hints[name], given[name], where, _join(key, name))
            limits = bounds_of(of)
            fault = fault_of(made[name], limits) if isinstance(made[name], float | int) else None
            if limits.choices and made[name] not in limits.choices:
                fault = f"expected {did_you_mean(limits.choices, made[name])}; got {made[name]!r}"
            if fault:
                raise BadInput(where, _join(key, name), fault)
        elif of.default is MISSING and of.default_factory is MISSING:
            raise BadInput(where, _join(key, name), ": ".join(filter(None, ("is missing", bounds_of(of).help))))
    return kind(**made)


def _value(hint: Any, value: object, where: str, key: str) -> Any:
    if is_dataclass(hint) and isinstance(hint, type):
        return built(hint, value, where, key)
    if isinstance(hint, UnionType) and not is_dataclass(get_args(hint)[0]):
        return _value(get_args(hint)[0], value, where, key)  # X | None: given, it is an X
    if hint is float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise BadInput(where, key, f"expected a number, got {value!r}")
        if isinstance(value, float) and not isfinite(value):
            raise BadInput(where, key, f"expected a finite number, got {value!r}")
        if abs(value) > GREATEST:
            raise BadInput(where, key, f"expected a number of at most {GREATEST:g} in size, got {str(value)[:40]}")
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
