"""Bodies: kinds of robot, each a TOML data sheet. Those that come with swarmwire lie in `bodies/`.

A sheet with `like = "epuck"` starts from that body's sheet, table by table, and says only what differs.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import MISSING, asdict, dataclass, field, fields, is_dataclass
from functools import cached_property
from importlib.resources import files
from math import isfinite
from typing import Any, TypeVar, cast, get_args, get_origin, get_type_hints

from swarmwire.comms.errors import BadInput
from swarmwire.comms.parameters import fault_of, limits_of, parameter
from swarmwire.comms.sheets import SHEETS, Compass, Light, Odometry, Proximity, Sheet

S = TypeVar("S", bound=Sheet)


@dataclass(frozen=True)
class DifferentialDrive:
    """Two wheels on one axle, driven by bounded force."""

    wheel_base_m: float = parameter(help="distance between the wheels", unit="m", above=0)
    max_wheel_mps: float = parameter(help="fastest speed of a wheel", unit="m/s", above=0)
    max_force_n: float = parameter(help="largest force along the body, or across it before it slips", unit="N", above=0)
    max_torque_nm: float = parameter(help="largest turning moment", unit="N m", above=0)


@dataclass(frozen=True)
class Body:
    """A disc-shaped robot: its size, drive and senses (a sense that is None it does not have)."""

    name: str = parameter(help="name in scenarios")
    source: str = parameter(help="where the figures come from")
    radius_m: float = parameter(help="radius of the body", unit="m", above=0)
    height_m: float = parameter(help="height of the body", unit="m", above=0)
    mass_kg: float = parameter(help="mass", unit="kg", above=0)
    drive: DifferentialDrive = parameter(help="how it moves")
    senses: dict[str, Sheet] = field(default_factory=dict[str, Sheet])

    @cached_property
    def proximity(self) -> Proximity | None:
        """The proximity sensor's sheet."""
        return self._sheet(Proximity)

    @cached_property
    def compass(self) -> Compass | None:
        """The compass's sheet."""
        return self._sheet(Compass)

    @cached_property
    def odometry(self) -> Odometry | None:
        """The wheel encoders' sheet."""
        return self._sheet(Odometry)

    @cached_property
    def light(self) -> Light | None:
        """The photocells' sheet."""
        return self._sheet(Light)

    def _sheet(self, kind: type[S]) -> S | None:
        return next((sheet for sheet in self.senses.values() if isinstance(sheet, kind)), None)

    @property
    def max_linear_mps(self) -> float:
        """The fastest it can drive straight ahead."""
        return self.drive.max_wheel_mps

    @property
    def max_angular_radps(self) -> float:
        """The fastest it can turn on the spot."""
        return 2.0 * self.drive.max_wheel_mps / self.drive.wheel_base_m

    def as_mapping(self) -> dict[str, Any]:
        """The sheet as `body_from` reads it back."""
        return asdict(self)


def body_names() -> list[str]:
    """The bodies that come with swarmwire."""
    return sorted(path.name.removesuffix(".toml") for path in files("swarmwire.comms").joinpath("bodies").iterdir())


def load_body(name: str) -> Body:
    """A body that comes with swarmwire, by name; BadInput if there is none."""
    return body_from(_shipped(name, "", "body"), where=f"{name}.toml")


def body_from(sheet: Mapping[str, Any], where: str) -> Body:
    """The body of a data sheet; BadInput names `where` and the key of what is wrong."""
    like, rest = sheet.get("like"), {key: value for key, value in sheet.items() if key != "like"}
    if like is not None:
        return body_from(_merged(_shipped(like, where, "like"), rest), where)
    senses = _mapping(where, "senses", rest.pop("senses", {}))
    unknown = [name for name in senses if name not in SHEETS]
    if unknown:
        raise BadInput(where, f"senses.{unknown[0]}", f"unknown sense; expected one of {', '.join(SHEETS)}")
    built = {name: _build(SHEETS[name], value, where, f"senses.{name}") for name, value in senses.items()}
    return _build(Body, {**rest, "senses": built}, where, "")


def _shipped(name: object, where: str, key: str) -> dict[str, Any]:
    """The sheet of a body that comes with swarmwire; BadInput names `where` and `key` if there is none."""
    if name not in body_names():
        raise BadInput(where, key, f"expected one of {', '.join(body_names())}; got {name!r}")
    return tomllib.loads(files("swarmwire.comms").joinpath("bodies", f"{name}.toml").read_text(encoding="utf-8"))


def _merged(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """`base` with what `over` says in its place; tables that both have are merged."""
    both = {key for key in over if isinstance(over[key], Mapping) and isinstance(base.get(key), Mapping)}
    return {**base, **over, **{key: _merged(base[key], over[key]) for key in both}}


def _mapping(where: str, key: str, value: object) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise BadInput(where, key, f"expected a table, got {value!r}")
    return {str(name): item for name, item in cast("Mapping[object, Any]", value).items()}


def _build(kind: type[Any], value: object, where: str, key: str) -> Any:
    given = _mapping(where, key, value)
    hints = get_type_hints(kind)
    known = {of.name: of for of in fields(kind)}
    made: dict[str, Any] = {}
    for name in given:
        if name not in known:
            raise BadInput(where, _join(key, name), f"unknown key; expected one of {', '.join(known)}")
    for name, of in known.items():
        if name in given:
            made[name] = _value(hints[name], given[name], where, _join(key, name))
            limits = limits_of(of)
            fault = fault_of(made[name], limits) if isinstance(made[name], float) else None
            if limits.choices and made[name] not in limits.choices:
                fault = f"expected one of {', '.join(limits.choices)}; got {made[name]!r}"
            if fault:
                raise BadInput(where, _join(key, name), fault)
        elif of.default is MISSING and of.default_factory is MISSING:
            raise BadInput(where, _join(key, name), "is missing")
    return kind(**made)


def _value(hint: Any, value: object, where: str, key: str) -> Any:
    if is_dataclass(hint) and isinstance(hint, type):
        return _build(hint, value, where, key)
    if hint is float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise BadInput(where, key, f"expected a number, got {value!r}")
        if not isfinite(value):
            raise BadInput(where, key, f"expected a finite number, got {value!r}")
        return float(value)
    if get_origin(hint) is tuple:
        if not isinstance(value, list | tuple) or not value:
            raise BadInput(where, key, f"expected a list, got {value!r}")
        items = cast("list[object]", value)
        return tuple(_value(get_args(hint)[0], item, where, f"{key}[{i}]") for i, item in enumerate(items))
    if hint is str and not isinstance(value, str):
        raise BadInput(where, key, f"expected a text, got {value!r}")
    return value


def _join(key: str, name: str) -> str:
    return f"{key}.{name}" if key else name
