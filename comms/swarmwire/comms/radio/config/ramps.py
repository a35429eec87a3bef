"""Ramps: changes of a radio's numbers during a run."""

from collections.abc import Iterable, Iterator
from dataclasses import Field, dataclass, fields, is_dataclass, replace
from typing import Any, cast

from swarmwire.comms.base.config import bounds_of, did_you_mean, fault_of
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.radio.config.radio import Radio

# Numbers that stay: when a robot hands its packets over is drawn once for the run.
FIXED = ("radio.send_offset",)
TABLE = "radio"


@dataclass(frozen=True, slots=True)
class ParameterRamp:
    """From `start_ns` on a number of the radio moves to `to`, evenly over `lasts_ns`, and stays there."""

    key: str  # within the scenario: "radio.loss"
    to: float
    start_ns: int
    lasts_ns: int

    def share(self, at_ns: int) -> float:
        """How much of the way is done at a time, 0 to 1."""
        return 1.0 if at_ns >= self.start_ns + self.lasts_ns else (at_ns - self.start_ns) / self.lasts_ns


def radio_at(radio: Radio, slopes: Iterable[ParameterRamp], at_ns: int) -> Radio:
    """The radio at a time under slopes that have begun; each sets out from what those before it make of its number."""
    for slope in slopes:
        before, share = number_of(radio, slope.key), slope.share(at_ns)
        radio = with_number(radio, slope.key, slope.to if share == 1.0 else before + (slope.to - before) * share)
    return radio


def number_of(radio: Radio, key: str) -> float:
    """The number at a key such as "radio.bursts.bad_s"."""
    holder, of = _place(radio, key)
    return float(getattr(holder, of.name))


def numbers_of(radio: Radio) -> dict[str, float]:
    """The numbers of a radio that can change during a run, by their keys within [radio]: "bursts.bad_s"."""
    return dict(_numbers(radio, TABLE))


def with_number(radio: Radio, key: str, value: float) -> Radio:
    """The radio with another number at a key; whole where it must be, rounded."""
    return cast("Radio", _with(radio, key.split(".")[1:], value))


def check_number(radio: Radio, key: str, value: float) -> None:
    """Raise BadInput unless the radio has a number at `key` that can change during a run, to `value`.

    The fault is under "what" if it is the key's, else under "to".
    """
    holder, of = _place(radio, key)
    got = getattr(holder, of.name)
    if key in FIXED:
        raise BadInput("", "what", f"expected a number that may change; {key} holds for the whole run")
    if got is None:
        raise BadInput("", "what", f"expected a number that the scenario gives; {key} is left out")
    if isinstance(got, bool) or not isinstance(got, int | float):
        raise BadInput("", "what", f"expected a number; {key} is {_kind(got)}")
    if isinstance(got, int) and value != round(value):
        raise BadInput("", "to", f"expected a whole number for {key}, got {value!r}")
    if fault := fault_of(value, bounds_of(of)):
        raise BadInput("", "to", f"{fault} for {key}")


def _place(radio: Radio, key: str) -> tuple[object, "Field[Any]"]:
    """The table that holds the key, and its field; BadInput under "what" if there is none."""
    table, *names = key.split(".")
    if table != TABLE or not names:
        raise BadInput("", "what", f"expected a key of [radio], such as radio.loss; got {key!r}")
    holder: object = radio
    for depth, name in enumerate(names):
        path = ".".join((table, *names[:depth]))
        if holder is None:
            raise BadInput("", "what", f"expected a table that the scenario gives; [{path}] is left out")
        if not is_dataclass(holder) or isinstance(holder, type):
            raise BadInput("", "what", f"expected a key of [radio]; {path} holds no keys")
        found = {of.name: of for of in fields(holder)}
        if name not in found:
            raise BadInput("", "what", f"unknown key {key}; expected {did_you_mean(found, key)} in {path}")
        if depth == len(names) - 1:
            return holder, found[name]
        holder = getattr(holder, name)
    raise AssertionError("there is at least one name")


def _numbers(holder: Any, path: str) -> Iterator[tuple[str, float]]:
    for of in fields(holder):
        value, key = getattr(holder, of.name), f"{path}.{of.name}"
        if is_dataclass(value):
            yield from _numbers(value, key)
        elif isinstance(value, int | float) and not isinstance(value, bool) and key not in FIXED:
            yield key.removeprefix(f"{TABLE}."), value


def _with(holder: Any, names: list[str], value: float) -> object:
    name, *below = names
    got = getattr(holder, name)
    new = _with(got, below, value) if below else round(value) if isinstance(got, int) else float(value)
    return replace(holder, **{name: new})


def _kind(value: object) -> str:
    if is_dataclass(value):
        return "a table"
    return "true or false" if isinstance(value, bool) else "a text" if isinstance(value, str) else "a list"
