"""Parameters of an agent class: its annotated attributes, typed, with defaults; values are checked when it is made."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar, TypeVar, get_origin, get_type_hints

T = TypeVar("T")
TYPES: dict[type, str] = {float: "a number", int: "a whole number", bool: "true or false", str: "a text"}
REQUIRED = object()


class BadParameter(ValueError):
    """A parameter that the agent does not have, lacks or cannot take; `key` is its name."""

    def __init__(self, key: str, expected: str) -> None:
        self.key, self.expected = key, expected
        super().__init__(f"{key}: {expected}")


@dataclass(frozen=True)
class Parameter:
    """One parameter of an agent class."""

    name: str
    type: type
    default: Any  # REQUIRED where there is none


def parameters_of(kind: type) -> dict[str, Parameter]:
    """The parameters that an agent class declares, bases first; TypeError if a type is one that no scenario gives."""
    found: dict[str, Parameter] = {}
    for name, hint in get_type_hints(kind).items():
        if name.startswith("_") or get_origin(hint) is ClassVar or hint is ClassVar:
            continue
        if hint not in TYPES:
            raise TypeError(f"{kind.__name__}.{name}: a parameter is a float, int, bool or str")
        found[name] = Parameter(name, hint, getattr(kind, name, REQUIRED))
    return found


def checked(kind: type, params: dict[str, Any]) -> dict[str, Any]:
    """The given parameters, each as its type; BadParameter names the first that is unknown, missing or wrong."""
    declared = parameters_of(kind)
    for name in params:
        if name not in declared:
            raise BadParameter(name, f"unknown parameter; {kind.__name__} has {', '.join(declared) or 'none'}")
    for name, parameter in declared.items():
        if name not in params and parameter.default is REQUIRED:
            raise BadParameter(name, f"is missing: expected {TYPES[parameter.type]}")
    return {name: _value(declared[name], value) for name, value in params.items()}


def make(kind: type[T], params: dict[str, Any]) -> T:
    """An instance with these parameters, set before its `__init__` runs."""
    agent = kind.__new__(kind)
    for name, value in checked(kind, params).items():
        setattr(agent, name, value)
    kind.__init__(agent)
    return agent


def _value(parameter: Parameter, value: Any) -> Any:
    whole_number = isinstance(value, int) and not isinstance(value, bool)
    if whole_number and not -(2**63) <= value < 2**63:
        raise BadParameter(parameter.name, f"expected a number of at most 64 bits, got {value}")
    if parameter.type is float and (whole_number or isinstance(value, float)):
        if not math.isfinite(value):
            raise BadParameter(parameter.name, f"expected a finite number, got {value}")
        return float(value)
    if (parameter.type is int and whole_number) or (parameter.type in (bool, str) and type(value) is parameter.type):
        return value
    raise BadParameter(parameter.name, f"expected {TYPES[parameter.type]}, got {value!r}")
