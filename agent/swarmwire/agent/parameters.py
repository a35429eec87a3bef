"""Parameters of an agent class: its annotated attributes, typed, with defaults, help and bounds.

`Parametrized` is the base of agent classes. `checked_parameters` compares the parameters of a scenario with those that
the class declares; `make_agent` builds an instance with them.
"""

import math
from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass
from types import MappingProxyType
from typing import (
    TYPE_CHECKING,
    Any,
    ClassVar,
    Generic,
    TypeVar,
    cast,
    get_args,
    get_origin,
    get_type_hints,
    overload,
)

import numpy as np

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.config import Bounds, bounds_of, did_you_mean, fault_of

N = TypeVar("N", int, float)
A = TypeVar("A", bound="Parametrized")
TYPES: dict[type, str] = {
    float: "a number",
    int: "a whole number",
    bool: "true or false",
    str: "a text",
}
CLASS_ATTRIBUTES = "needs", "api"  # declared by the class, never parameters
REQUIRED = object()  # default of a parameter without a default
UNEXPLAINED = Bounds(help="")  # bounds of a parameter declared without `parameter`


class Parametrized:
    """Base of agent classes, whose annotated attributes (float, int, bool, str) are their parameters.

    `speed_mps: float = 0.1` declares one with a default. `speed_mps: float = parameter(0.1, help="straight ahead",
    above=0.0)` also explains it for `swarmwire describe` and refuses other values before a run.
    """

    # Names with an underscore can never be those of a user's parameters.
    _bounds: ClassVar[Mapping[str, Bounds]] = MappingProxyType({})
    _is_vector: ClassVar[bool] = False  # True if an instance controls many robots

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        declared: dict[str, Field[Any]] = {name: value for name, value in vars(cls).items() if isinstance(value, Field)}
        cls._bounds = MappingProxyType({**cls._bounds, **{k: bounds_of(value) for k, value in declared.items()}})
        for name, value in declared.items():
            if value.default is MISSING:
                delattr(cls, name)
            else:
                setattr(cls, name, value.default)

    @classmethod
    def check_parameters(cls, params: Mapping[str, Any], robots: int) -> None:
        """Check the parameters of a scenario for `robots` robots, each of its type and bounds, before a run.

        Override it to raise BadParameter for values that contradict each other.
        """


class PerRobot(Generic[N]):
    """A parameter of a VectorAgent with a value per robot: `lane: PerRobot[int] = parameter(0, help="its lane")`.

    Without a default: `lane: PerRobot[int]`. A scenario gives one number for all robots, or a list with one per robot,
    by its index in the group. In `step`, `self.lane` is the array (n,) of the robots that act: int64 or float64.
    """

    if TYPE_CHECKING:

        @overload
        def __get__(self: "PerRobot[int]", agent: object, owner: Any) -> IntArray: ...
        @overload
        def __get__(self: "PerRobot[float]", agent: object, owner: Any) -> FloatArray: ...
        def __get__(self, agent: object, owner: Any) -> Any: ...


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
    bounds: Bounds = UNEXPLAINED


def parameters_of(kind: type[Parametrized]) -> dict[str, Parameter]:
    """Return the parameters of an agent class, those of its bases first.

    TypeError for a type that no scenario has, and for a default outside its bounds.
    """
    parameters: dict[str, Parameter] = {}
    bounds = kind._bounds  # pyright: ignore[reportPrivateUsage] - this module's own class
    for name, hint in get_type_hints(kind).items():
        if name.startswith("_") or name in CLASS_ATTRIBUTES or ClassVar in (hint, get_origin(hint)):
            continue
        per_robot = get_origin(hint) is PerRobot
        if per_robot and not kind._is_vector:  # pyright: ignore[reportPrivateUsage] - this module's own class
            raise TypeError(f"{kind.__name__}.{name}: only a VectorAgent has parameters per robot")
        value_type = get_args(hint)[0] if per_robot else hint
        if value_type not in TYPES:
            raise TypeError(f"{kind.__name__}.{name}: a parameter is a float, int, bool or str")
        parameter = Parameter(name, value_type, getattr(kind, name, REQUIRED), per_robot, bounds.get(name, UNEXPLAINED))
        if value_type in (float, int) and parameter.default is not REQUIRED:
            fault = fault_of(parameter.default, parameter.bounds)
            if fault is not None:
                raise TypeError(f"{kind.__name__}.{name}: default: {fault}")
        parameters[name] = parameter
    for name in bounds:
        if name not in parameters:
            raise TypeError(f"{kind.__name__}.{name}: expected its type: {name}: float = parameter(…)")
    return parameters


def checked_parameters(kind: type[Parametrized], params: dict[str, Any], robots: int = 1) -> dict[str, Any]:
    """Return the parameters of `robots` robots, each of its type; BadParameter names the first wrong parameter."""
    declared = parameters_of(kind)
    for name in params:
        if name not in declared:
            raise BadParameter(name, f"unknown parameter of {kind.__name__}; expected {did_you_mean(declared, name)}")
    for name, parameter in declared.items():
        if name not in params and parameter.default is REQUIRED:
            raise BadParameter(name, f"is missing: expected {TYPES[parameter.type]}")
    values = {name: _checked_values(declared[name], value, robots) for name, value in params.items()}
    kind.check_parameters(values, robots)
    return values


def make_agent(kind: type[A], params: dict[str, Any], robots: int = 1) -> A:
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
    is_number = is_integer or (parameter.type is float and isinstance(value, float))
    if parameter.type in (float, int) and is_number:
        if not math.isfinite(value):
            raise BadParameter(parameter.name, f"expected a finite number, got {value}")
        fault = fault_of(value, parameter.bounds)
        if fault is not None:
            raise BadParameter(parameter.name, fault)
        return parameter.type(value)
    if parameter.type in (bool, str) and type(value) is parameter.type:
        choices = parameter.bounds.choices
        if choices and value not in choices:
            raise BadParameter(parameter.name, f"expected {did_you_mean(choices, value)}, got {value!r}")
        return value
    raise BadParameter(parameter.name, f"expected {expected}, got {value!r}")
