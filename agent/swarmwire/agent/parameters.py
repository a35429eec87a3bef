"""Parameters of an agent class: its annotated attributes, typed, with defaults.

`checked_parameters` compares the parameters of a scenario with those that the class declares; `make_agent` builds an
instance with them.
"""

import math
from dataclasses import dataclass
from typing import Any, ClassVar, TypeVar, cast, get_args, get_origin, get_type_hints

import numpy as np

from swarmwire.agent.vector_agent import PerRobot, PerRobotDefault, VectorAgent
from swarmwire.comms.base.config import did_you_mean

T = TypeVar("T")
TYPES: dict[type, str] = {
    float: "a number",
    int: "a whole number",
    bool: "true or false",
    str: "a text",
}
CLASS_ATTRIBUTES = "needs", "api"  # declared by the class, never parameters
REQUIRED = object()  # default of a parameter without a default


class BadParameter(ValueError):
    """A parameter that is unknown, missing or of a wrong value; `key` is its name."""

    def __init__(self, key: str, expected: str) -> None:
        self.key, self.expected = key, expected
        super().__init__(f"{key}: {expected}")


@dataclass(frozen=True)
class Parameter:
    """One parameter of an agent class."""

    name: str
    type: type
    default: Any  # or REQUIRED
    per_robot: bool = False


def parameters_of(kind: type) -> dict[str, Parameter]:
    """Return the parameters of an agent class, those of its bases first; TypeError for a type that no scenario has."""
    parameters: dict[str, Parameter] = {}
    for name, hint in get_type_hints(kind).items():
        if name.startswith("_") or name in CLASS_ATTRIBUTES or ClassVar in (hint, get_origin(hint)):
            continue
        per_robot = get_origin(hint) is PerRobot
        if per_robot and VectorAgent not in kind.__mro__:
            raise TypeError(f"{kind.__name__}.{name}: only a VectorAgent has parameters per robot")
        value_type = get_args(hint)[0] if per_robot else hint
        if value_type not in TYPES:
            raise TypeError(f"{kind.__name__}.{name}: a parameter is a float, int, bool or str")
        default = getattr(kind, name, REQUIRED)
        if isinstance(default, PerRobotDefault):
            default = default.value
        parameters[name] = Parameter(name, value_type, default, per_robot)
    return parameters


def checked_parameters(kind: type, params: dict[str, Any], robots: int = 1) -> dict[str, Any]:
    """Return the parameters of `robots` robots, each of its type; BadParameter names the first wrong parameter."""
    declared = parameters_of(kind)
    for name in params:
        if name not in declared:
            raise BadParameter(name, f"unknown parameter of {kind.__name__}; expected {did_you_mean(declared, name)}")
    for name, parameter in declared.items():
        if name not in params and parameter.default is REQUIRED:
            raise BadParameter(name, f"is missing: expected {TYPES[parameter.type]}")
    values = {name: _checked_values(declared[name], value, robots) for name, value in params.items()}
    if issubclass(kind, VectorAgent):
        kind.check_parameters(values, robots)
    return values


def make_agent(kind: type[T], params: dict[str, Any], robots: int = 1) -> T:
    """Make an instance with these parameters, set before its `__init__` runs; those per robot are arrays (robots,)."""
    agent, values = kind.__new__(kind), checked_parameters(kind, params, robots)
    for name, parameter in parameters_of(kind).items():
        if parameter.per_robot:
            value = values.get(name, parameter.default)
            setattr(agent, name, np.array(np.broadcast_to(value, robots), parameter.type))
        elif name in values:
            setattr(agent, name, values[name])
    kind.__init__(agent)
    return agent


def _checked_values(parameter: Parameter, value: Any, robots: int) -> Any:
    if not parameter.per_robot:
        return _checked_value(parameter, value, TYPES[parameter.type])
    expected = f"{TYPES[parameter.type]}, or a list with one for each of the {robots} robots"
    if not isinstance(value, list):
        return _checked_value(parameter, value, expected)
    items = cast("list[Any]", value)
    if len(items) != robots:
        raise BadParameter(parameter.name, f"expected {expected}, got a list of {len(items)}")
    return [_checked_value(parameter, item, expected) for item in items]


def _checked_value(parameter: Parameter, value: Any, expected: str) -> Any:
    is_integer = isinstance(value, int) and not isinstance(value, bool)
    if is_integer and not -(2**63) <= value < 2**63:
        raise BadParameter(parameter.name, f"expected a number of at most 64 bits, got {value}")
    if parameter.type is float and (is_integer or isinstance(value, float)):
        if not math.isfinite(value):
            raise BadParameter(parameter.name, f"expected a finite number, got {value}")
        return float(value)
    if (parameter.type is int and is_integer) or (parameter.type in (bool, str) and type(value) is parameter.type):
        return value
    raise BadParameter(parameter.name, f"expected {expected}, got {value!r}")
