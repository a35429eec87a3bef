"""The bodies that come with swarmwire, from their data sheets."""

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from itertools import pairwise
from typing import Any, cast

from reference.markdown import NOTHING, code, number, table
from reference.parameters import HEAD, parameter_rows
from swarmwire.comms.bodies.body import Body, body_names, load_body
from swarmwire.comms.config import bounds_of

Figure = tuple[str, str, object]  # path within the sheet, unit, value


def body_table() -> str:
    """Every figure that a body's sheet gives, a column for each body; what is at its default is left out."""
    sheets = [{path: (unit, value) for path, unit, value in _figures(load_body(name))} for name in body_names()]
    paths = {path: unit for sheet in sheets for path, (unit, _) in sheet.items()}
    rows = [
        [code(path), unit, *(_value(sheet[path][1]) if path in sheet else NOTHING for sheet in sheets)]
        for path, unit in paths.items()
    ]
    return table(["figure", "unit", *(code(name) for name in body_names())], rows)


def body_sources() -> str:
    """Where each body's figures come from."""
    return "".join(f"- {code(name)}: {load_body(name).source}\n" for name in body_names())


def body_keys() -> str:
    """The keys that stand in a sheet before its first table."""
    tables = ("drive", "leds", "sensors", "actuators")
    rows = [row for row in parameter_rows(Body) if row[0].strip("`").partition(".")[0] not in tables]
    like = (code("like"), "", "a body's name", NOTHING, "Body that this one starts from.")
    return table(HEAD, [like, *rows])


def _figures(body: Body) -> Iterator[Figure]:
    yield from _of(body, "", skipped=("name", "source", "sensors"))
    yield "fastest ahead", "m/s", body.max_linear_mps
    yield "fastest turn", "rad/s", body.max_angular_radps
    for name, sheet in body.sensors.items():
        yield f"sensors.{name}", "", "yes"
        yield from _of(sheet, f"sensors.{name}.")


def _of(sheet: Any, prefix: str, skipped: tuple[str, ...] = ()) -> Iterator[Figure]:
    for of in fields(sheet):
        value = getattr(sheet, of.name)
        if is_dataclass(value):
            yield from _of(value, f"{prefix}{of.name}.")
        elif of.name not in skipped and value not in (of.default, {}):
            yield prefix + of.name, bounds_of(of).unit, value


def _value(value: object) -> str:
    if value is None:
        return NOTHING
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        items = cast("tuple[Any, ...]", value)
        return _points(items) if isinstance(items[0], tuple) else _ring(items)
    return number(value) if isinstance(value, int | float) else str(value)


def _points(points: tuple[tuple[float, ...], ...]) -> str:
    return ", ".join(f"({', '.join(number(at) for at in point)})" for point in points)


def _ring(angles: tuple[float, ...]) -> str:
    """So many sensors and where they look: evenly spaced, or one by one."""
    steps = {round(later - earlier, 6) for earlier, later in pairwise(angles)}
    if len(steps) == 1:
        return f"{len(angles)}, every {number(steps.pop())} from {number(angles[0])}"
    return f"{len(angles)}, at {', '.join(number(angle) for angle in angles)}"
