"""Ramps: linear changes of a radio's numbers during a run."""

from collections.abc import Iterable, Iterator
from dataclasses import Field, dataclass, fields, is_dataclass, replace
from typing import Any, cast

from swarmwire.comms.base.config import bounds_of, did_you_mean, fault_of
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.radio.config.radio import Radio

# The send offset is drawn once for the run.
FIXED = ("radio.send_offset",)
TABLE = "radio"


@dataclass(frozen=True, slots=True)
class ParameterRamp:
    """A change of one number of the radio to `to`: linear from `start_ns` over `duration_ns`, then constant."""

    key: str  # key of the scenario, such as "radio.loss"
    to: float
    start_ns: int
    duration_ns: int

    def share(self, at_ns: int) -> float:
        """Completed share of the change at a time, 0 to 1."""
        return 1.0 if at_ns >= self.start_ns + self.duration_ns else (at_ns - self.start_ns) / self.duration_ns


def radio_at(radio: Radio, ramps: Iterable[ParameterRamp], at_ns: int) -> Radio:
    """Return the radio at a time after ramps that have begun; each starts from the number that earlier ramps set."""
    for ramp in ramps:
        start, share = number_of(radio, ramp.key), ramp.share(at_ns)
        radio = with_number(radio, ramp.key, ramp.to if share == 1.0 else start + (ramp.to - start) * share)
    return radio


def number_of(radio: Radio, key: str) -> float:
    """Return the number at a key such as "radio.bursts.bad_s"."""
    table, item = _table_and_field(radio, key)
    return float(getattr(table, item.name))


def numbers_of(radio: Radio) -> dict[str, float]:
    """Return the numbers of a radio that can change during a run, by key within `[radio]`, such as "bursts.bad_s"."""
    return dict(_numbers(radio, TABLE))


def with_number(radio: Radio, key: str, value: float) -> Radio:
    """Return the radio with another number at a key, rounded if the key holds integers."""
    return cast("Radio", _with(radio, key.split(".")[1:], value))


def check_number(radio: Radio, key: str, value: float) -> None:
    """Raise BadInput unless the radio has a number at `key` that can change to `value` during a run.

    The error is under "what" if the key is wrong, else under "to".
    """
    table, item = _table_and_field(radio, key)
    got = getattr(table, item.name)
    if key in FIXED:
        raise BadInput("", "what", f"expected a number that can change; {key} is fixed for the run")
    if got is None:
        raise BadInput("", "what", f"expected a number that the scenario gives; {key} is missing")
    if isinstance(got, bool) or not isinstance(got, int | float):
        raise BadInput("", "what", f"expected a number; {key} is {_kind(got)}")
    if isinstance(got, int) and value != round(value):
        raise BadInput("", "to", f"expected a whole number for {key}, got {value!r}")
    if fault := fault_of(value, bounds_of(item)):
        raise BadInput("", "to", f"{fault} for {key}")


def _table_and_field(radio: Radio, key: str) -> tuple[object, "Field[Any]"]:
    """Return the table that contains the key, and its field; raise BadInput under "what" for an unknown key."""
    first, *names = key.split(".")
    if first != TABLE or not names:
        raise BadInput("", "what", f"expected a key of [radio], such as radio.loss; got {key!r}")
    table: object = radio
    for depth, name in enumerate(names):
        path = ".".join((first, *names[:depth]))
        if table is None:
            raise BadInput("", "what", f"expected a table that the scenario gives; [{path}] is missing")
        if not is_dataclass(table) or isinstance(table, type):
            raise BadInput("", "what", f"expected a key of [radio]; {path} holds no keys")
        items = {item.name: item for item in fields(table)}
        if name not in items:
            raise BadInput("", "what", f"unknown key {key}; expected {did_you_mean(items, key)} in {path}")
        if depth == len(names) - 1:
            return table, items[name]
        table = getattr(table, name)
    raise AssertionError("there is at least one name")


def _numbers(table: Any, path: str) -> Iterator[tuple[str, float]]:
    for item in fields(table):
        value, key = getattr(table, item.name), f"{path}.{item.name}"
        if is_dataclass(value):
            yield from _numbers(value, key)
        elif isinstance(value, int | float) and not isinstance(value, bool) and key not in FIXED:
            yield key.removeprefix(f"{TABLE}."), value


def _with(table: Any, names: list[str], value: float) -> object:
    name, *nested = names
    old = getattr(table, name)
    new = _with(old, nested, value) if nested else round(value) if isinstance(old, int) else float(value)
    return replace(table, **{name: new})


def _kind(value: object) -> str:
    if is_dataclass(value):
        return "a table"
    return "true or false" if isinstance(value, bool) else "a text" if isinstance(value, str) else "a list"
