"""Design of a campaign: varied paths of the scenario, their values, and the design points that combine them."""

import json
import math
import tomllib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from math import floor, isinf, prod
from typing import Any, cast

import numpy as np

from swarmwire.agent.agent import load_agent
from swarmwire.agent.parameters import parameters_of
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.config import did_you_mean, from_toml
from swarmwire.comms.base.draws import derive_key, uniform
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.runs.scenario_parts import agent_specs
from swarmwire.world.scenario.scenario import Scenario, mapping_of
from swarmwire.world.scenario.schema import Node, plain
from swarmwire.world.scenario_file import scenario_schema

EXPECTED = (
    "expected PATH=FIRST:LAST:COUNT, such as radio.loss=0:0.8:9, or PATH=5,10,20; "
    "for random and latin designs PATH=FIRST:LAST; a range may end in :log"
)
LOG = "log"
MAX_VALUES = 100_000
RANGE_KEYS = ("from", "to", "count", "scale")
Point = dict[str, Any]  # path: value
GRID, LIST, RANDOM, LATIN = KINDS = ("grid", "list", "random", "latin")
DRAWN = (RANDOM, LATIN)
MAX_POINTS = 100_000


@dataclass(frozen=True)
class ParameterRange:
    """Numbers from `first` to `last`, at equal distances or in equal ratios (log)."""

    first: Fraction
    last: Fraction
    count: int | None  # None: a design draws numbers from the range
    log: bool = False

    def number_at(self, share: Fraction) -> float:
        """Return the number at a share of the range, from 0 to 1."""
        if not self.log or share in (0, 1):
            return float(self.first + (self.last - self.first) * share)
        first, last, part = float(self.first), float(self.last), float(share)
        return float(f"{first ** (1.0 - part) * last**part:.12g}")  # 10.0, not 9.999999999999998

    def values(self) -> list[float]:
        """Return all `count` numbers, from the first to the last."""
        count = self.count or 1
        return [self.number_at(Fraction(index, max(count - 1, 1))) for index in range(count)]


@dataclass(frozen=True)
class Vary:
    """A varied path of the scenario."""

    path: str
    values: tuple[Any, ...] | ParameterRange
    where: str  # the option, or file and key, for messages

    def refused(self, expected: str) -> BadInput:
        """Return an error about this path."""
        return BadInput(self.where, "", expected)


def vary_of(text: str) -> Vary:
    """Parse `PATH=…` of the option `--vary`; BadInput for any other form."""
    where = f"--vary {text}"
    path, equals, values = text.partition("=")
    path = ".".join(key.strip() for key in path.split("."))
    if not equals or not all(path.split(".")) or not values.strip():
        raise BadInput(where, "", EXPECTED)
    return _checked(Vary(path, _range_of(values, where) or tuple(_list_of(values)), where))


def vary_from(path: str, values: object, where: str) -> Vary:
    """Parse values of a campaign's file: a list, a table with from, to, count and scale, or a text as for `--vary`."""
    if isinstance(values, str):
        return vary_of(f"{path}={values}")
    if isinstance(values, Mapping):
        return _checked(Vary(path, _range_from(cast("Mapping[str, Any]", values), where), where))
    if isinstance(values, list | tuple):
        return _checked(Vary(path, tuple(cast("list[Any]", values)), where))
    raise BadInput(where, "", f"expected a list of values, or {{ from = 0.0, to = 0.8, count = 9 }}; got {values!r}")


def _range_of(text: str, where: str) -> ParameterRange | None:
    """Parse a range; return None for a list of values."""
    parts = [part.strip() for part in text.split(":")]
    first = _number(parts[0])
    if len(parts) == 1 or first is None:
        return None
    log = parts[-1] == LOG
    parts = parts[: len(parts) - log]
    last = _number(parts[1]) if len(parts) in (2, 3) else None
    if last is None or (len(parts) == 3 and not parts[2].isdecimal()):
        raise BadInput(where, "", EXPECTED)
    return ParameterRange(first, last, int(parts[2]) if len(parts) == 3 else None, log)


def _range_from(table: Mapping[str, Any], where: str) -> ParameterRange:
    ends = [_number(str(table.get(key))) for key in ("from", "to")]
    count, scale = table.get("count"), table.get("scale", "linear")
    is_valid = set(table) <= set(RANGE_KEYS) and scale in ("linear", LOG)
    if not is_valid or None in ends or not (count is None or type(count) is int):
        expected = 'expected { from = 0.0, to = 0.8, count = 9 }, with scale = "log" for equal ratios'
        raise BadInput(where, "", f"{expected}; got {dict(table)}")
    first, last = (cast("Fraction", end) for end in ends)
    return ParameterRange(first, last, count, scale == LOG)


def _list_of(text: str) -> list[Any]:
    """Parse TOML values between commas; any other item is a text."""
    with suppress(tomllib.TOMLDecodeError):  # an item that is no TOML value
        table = from_toml(f"value = [{text}]")
        if len(table) == 1:
            return cast("list[Any]", table["value"])
    return [_value(part.strip()) for part in text.split(",") if part.strip()]


def _value(text: str) -> Any:
    try:
        table = from_toml(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text
    return table["value"] if len(table) == 1 else text


def _number(text: str) -> Fraction | None:
    """Parse a number exactly, so that 0.1 is a tenth; None for texts that are no finite float, such as 1e400."""
    try:
        near = float(text)  # checked first, since the fraction of 1e999999999 would exhaust the memory
        return None if isinf(near) else Fraction(text) if near else Fraction(0)
    except (ValueError, OverflowError):
        return None


def _checked(vary: Vary) -> Vary:
    if isinstance(vary.values, ParameterRange):
        _check_range(vary, vary.values)
    elif not 0 < len(vary.values) <= MAX_VALUES:
        raise vary.refused(f"expected 1 to {MAX_VALUES} values, got {len(vary.values)}")
    return vary


def _check_range(vary: Vary, values: ParameterRange) -> None:
    if values.count is not None and not 0 < values.count <= MAX_VALUES:
        raise vary.refused(f"expected a COUNT from 1 to {MAX_VALUES}, got {values.count}")
    if values.first == values.last and values.count != 1:
        raise vary.refused("expected FIRST and LAST to differ")
    if values.log and not (values.first > 0 and values.last > 0):
        raise vary.refused("expected FIRST and LAST above 0 for equal ratios (log)")


def toml_value(value: object) -> str:
    """Format a text, a number, true or false, a list or a table as a TOML value.

    >>> toml_value([1, 0.5, "a", True])
    '[1, 0.5, "a", true]'
    """
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)  # inf, -inf, nan
    if isinstance(value, Mapping):
        table = cast("Mapping[str, object]", value)
        return "{" + ", ".join(f"{toml_value(key)} = {toml_value(item)}" for key, item in table.items()) + "}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return "[" + ", ".join(toml_value(item) for item in cast("Sequence[object]", value)) + "]"
    # JSON escapes characters beyond 16 bits as two, which TOML refuses; DEL is the one that TOML needs escaped.
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def points_of(
    kind: str, varied: Sequence[Vary], count: int | None, seed: int, is_whole: Callable[[str], bool]
) -> list[Point]:
    """Return the design's points, in order; a grid without varied paths has one point, the scenario itself.

    `grid` combines all values, with the last path varying fastest; `list` combines them one to one; `random` and
    `latin` draw `count` points from ranges (and lists) by `seed`. Ranges of paths with `is_whole(path)` have whole
    numbers. BadInput names the wrong argument.
    """
    if kind not in KINDS:
        raise BadInput("design", "", f"expected {did_you_mean(KINDS, kind)}; got {kind!r}")
    for index, vary in enumerate(varied):
        if vary.path in [other.path for other in varied[:index]]:
            raise vary.refused("expected each path once")
        if replaced := [other.path for other in varied[:index] if other.path.startswith(f"{vary.path}.")]:
            raise vary.refused(f"expected it before {replaced[0]}, which lies within it: it would replace that value")
    if kind != LIST:
        _refuse_repeated_values(varied)
    if kind in DRAWN:
        return _drawn(kind, varied, count, seed, is_whole)
    if count is not None:
        raise BadInput("points", "", f"expected it with `design` {RANDOM} or {LATIN}: the values say how many")
    values = [_values(vary, is_whole(vary.path)) for vary in varied]
    if kind == LIST:
        return _one_to_one(varied, values)
    if prod(map(len, values)) > MAX_POINTS:
        raise BadInput("vary", "", f"expected at most {MAX_POINTS} points, got {prod(map(len, values))}")
    return [_point(varied, combined) for combined in product(*values)]


def _one_to_one(varied: Sequence[Vary], values: Sequence[Sequence[Any]]) -> list[Point]:
    if not varied:
        raise BadInput("design", "", f"expected `vary` with {LIST}: the design is empty")
    for vary, listed in zip(varied, values, strict=True):
        if len(listed) != len(values[0]):
            raise vary.refused(f"expected {len(values[0])} values, as of {varied[0].path}; got {len(listed)}")
    points = [_point(varied, combined) for combined in zip(*values, strict=True)]
    texts = list(map(toml_value, points))
    if repeated := [text for text, count in Counter(texts).items() if count > 1]:
        raise BadInput("vary", "", f"expected different points, got {repeated[0]} more than once")
    return points


def _refuse_repeated_values(varied: Sequence[Vary]) -> None:
    for vary in varied:
        values = () if isinstance(vary.values, ParameterRange) else vary.values
        if any(value in values[:index] for index, value in enumerate(values)):
            raise vary.refused("expected different values: one is there twice")


def _values(vary: Vary, is_whole: bool) -> list[Any]:
    if not isinstance(vary.values, ParameterRange):
        return list(vary.values)
    if vary.values.count is None:
        raise vary.refused(f"expected FIRST:LAST:COUNT; FIRST:LAST is for `design` {RANDOM} and {LATIN}")
    numbers = vary.values.values()
    if not is_whole:
        return list(numbers)
    rounded = [floor(number + 0.5) for number in numbers]
    if len(set(rounded)) < len(rounded):
        raise vary.refused("expected a smaller COUNT: rounded to whole numbers some values are the same")
    return list(rounded)


def _drawn(
    kind: str, varied: Sequence[Vary], count: int | None, seed: int, is_whole: Callable[[str], bool]
) -> list[Point]:
    if not varied:
        raise BadInput("design", "", f"expected `vary` with {kind}: the design is empty")
    if count is None or not 0 < count <= MAX_POINTS:
        raise BadInput("points", "", f"expected 1 to {MAX_POINTS} points with `design` {kind}, got {count}")
    if seed < 0:
        raise BadInput("design_seed", "", f"expected a whole number of at least 0, got {seed}")
    shares = _random(varied, count, seed) if kind == RANDOM else _latin(len(varied), count, seed)
    columns = [
        [_value_at(vary, float(share), is_integer) for share in column]
        for vary, column, is_integer in zip(varied, shares.T, [is_whole(vary.path) for vary in varied], strict=True)
    ]
    return [_point(varied, values) for values in zip(*columns, strict=True)]


def _random(varied: Sequence[Vary], count: int, seed: int) -> FloatArray:
    """Draw shares in [0, 1), (points, paths), of each path independently of the other paths."""
    columns = [uniform(derive_key("design", seed, vary.path), np.arange(count), 0, 0, 0) for vary in varied]
    return np.stack(columns, axis=1)


def _latin(paths: int, count: int, seed: int) -> FloatArray:
    """Draw shares in [0, 1), (points, paths), one in each of `count` equal slices of each path's range."""
    from scipy.stats import qmc

    return np.asarray(qmc.LatinHypercube(paths, rng=seed).random(count), np.float64)


def _value_at(vary: Vary, share: float, is_whole: bool) -> Any:
    """Return the value at a share of the range; whole numbers and items of lists have equal parts of it."""
    values = vary.values
    if not isinstance(values, ParameterRange):
        return values[int(share * len(values))]
    if values.count is not None:
        raise vary.refused("expected FIRST:LAST without COUNT: `points` says how many")
    if not is_whole:
        return values.number_at(Fraction(share))
    if values.log:
        return floor(values.number_at(Fraction(share)) + 0.5)
    low, high = sorted((floor(values.first + Fraction(1, 2)), floor(values.last + Fraction(1, 2))))
    return low + int(share * (high - low + 1))


def _point(varied: Sequence[Vary], values: Sequence[Any]) -> Point:
    return {vary.path: value for vary, value in zip(varied, values, strict=True)}


def whole_numbers(scenario: Scenario) -> Callable[[str], bool]:
    """Return a function of a path that returns True if its value must be a whole number; False for unknown paths."""
    schema, mapping = scenario_schema(), mapping_of(scenario)

    def is_whole(path: str) -> bool:
        keys = path.split(".")
        if len(keys) == 4 and keys[0] == "robots" and keys[2] == "params":
            return _is_whole_parameter(scenario, keys[1], keys[3])
        return _node_at(keys, mapping, schema).get("type") == "integer"

    return is_whole


def _is_whole_parameter(scenario: Scenario, group: str, name: str) -> bool:
    """Return True for an agent's parameter that its class declares as int."""
    if group not in scenario.robots:
        return False
    declared = parameters_of(load_agent(agent_specs(scenario)[group])).get(name)
    return declared is not None and declared.type is int


def _node_at(keys: list[str], mapping: object, schema: Node) -> Node:
    """Return the schema's node at a path; of alternative tables, the one that the scenario's mapping has."""
    node, value = schema, mapping
    for key in keys:
        node = _alternative(plain(node, schema), value, schema)
        if key.isdecimal():
            items: list[Node] = node.get("prefixItems", [])
            node = items[int(key)] if int(key) < len(items) else node.get("items") or Node()
        else:
            named: Node = node.get("properties", {})
            patterned: Node = node.get("patternProperties", {})
            node = named.get(key) or next(iter(patterned.values()), Node())
        value = _item(value, key)
    return plain(node, schema)


def _alternative(node: Node, value: object, schema: Node) -> Node:
    """Return the node for the value's tag if the node lists alternatives."""
    if "discriminator" not in node or not isinstance(value, dict):
        return node
    tables: dict[str, str] = node["discriminator"]["mapping"]
    tag = cast("dict[str, Any]", value).get(node["discriminator"]["propertyName"])
    return plain({"$ref": tables[tag]}, schema) if tag in tables else node


def _item(value: object, key: str) -> object:
    if isinstance(value, dict):
        return cast("dict[str, object]", value).get(key)
    if isinstance(value, list) and key.isdecimal():
        items = cast("list[object]", value)
        return items[int(key)] if int(key) < len(items) else None
    return None
