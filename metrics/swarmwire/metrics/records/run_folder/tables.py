"""The recorded tables by name (a new one is a line here), `static.json`, and the observers that fill a run folder."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from math import inf
from pathlib import Path
from typing import Any, cast

from swarmwire.comms.base.atomic import write_text
from swarmwire.comms.base.config import check_format, from_json
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.geometry.floor import Floor, FloorImage, Patch
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Group, Light, Static
from swarmwire.comms.robot.bodies.body import body_from_mapping
from swarmwire.metrics.records.run_folder.distances import RadioDistances
from swarmwire.metrics.records.run_folder.events import Events
from swarmwire.metrics.records.run_folder.layout import STATIC, TABLES_FORMAT
from swarmwire.metrics.records.run_folder.packets import PacketsTable
from swarmwire.metrics.records.run_folder.radio_totals import RadioLinks, RadioRobots
from swarmwire.metrics.records.run_folder.table import RecordedTable, RecordOptions
from swarmwire.metrics.records.run_folder.ticks import Ticks

TABLES: dict[str, RecordedTable] = {
    table.name: table for table in (Ticks(), PacketsTable(), Events(), RadioRobots(), RadioDistances(), RadioLinks())
}


def recorders(options: RecordOptions) -> list[Observer]:
    """Return an observer for `static.json`, and one for each table that the options include.

    They are separate, so that a failing one does not stop the others.
    """
    table_recorders = (table.recorder(options) for table in TABLES.values())
    return [StaticRecorder(options.folder), *(recorder for recorder in table_recorders if recorder is not None)]


def record_summary(parts: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the summary's `record`, from the observers' summary parts: rows written and dropped of each table.

    Tables that were not recorded, or whose recorder failed, are left out. "rrd" is the recording for the viewer.
    """
    return {name: parts[f"record_{name}"] for name in (*TABLES, "rrd") if f"record_{name}" in parts}


class StaticRecorder(Observer):
    """Observer that writes `static.json`, before the first tick. No summary part."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def begin(self, static: Static) -> None:
        """Write the file."""
        write_static(static, self._folder / STATIC)


def write_static(static: Static, path: Path) -> None:
    """Write `static.json` atomically."""
    write_text(path, json.dumps({"format": TABLES_FORMAT, **_finite(static)}, indent=2, allow_nan=False) + "\n")


def read_static(path: Path) -> Static:
    """Read the file that `write_static` wrote; BadInput if it is missing or has another content."""
    try:
        content = from_json(path.read_text(encoding="utf-8"))
        check_format(content, TABLES_FORMAT, str(path))
        del content["format"]
        static = _static(content, str(path))
        _check(static)
        return static
    except FileNotFoundError:
        raise BadInput(str(path), "", "expected a file that a run wrote; there is none") from None
    except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
        raise BadInput(str(path), "", f"expected the static part of a run: {error}") from error


def _static(content: Mapping[str, Any], where: str) -> Static:
    fields: dict[str, Any] = {key: _as_tuples(value) for key, value in content.items()}
    fields["obstacles"] = tuple(tuple(Obstacle(**_plain(item)) for item in arena) for arena in content["obstacles"])
    fields["lights"] = tuple(tuple(Light(**_plain(item)) for item in arena) for arena in content["lights"])
    fields["floor"] = _floor(content["floor"]) if content["floor"] is not None else None
    fields["groups"] = tuple(_group(item, where) for item in content["groups"])
    return Static(**fields)


def _check(static: Static) -> None:
    """Raise TypeError or ValueError if a field that tables refer to is missing or inconsistent."""
    groups = static.groups
    texts = (static.name, static.boundary, *static.robot_names, *(group.name for group in groups))
    indices = (n for group in groups for n in (group.start, group.stop, group.act_every_ticks))
    integers = (static.rate_hz, *static.seeds, *indices)
    numbers = (*static.arena_size_m, *(() if static.range_m is None else (static.range_m,)))
    for kind, values in ((str, texts), (int, integers), (int | float, numbers)):
        wrong = next((value for value in values if not isinstance(value, kind) or isinstance(value, bool)), None)
        if wrong is not None:
            raise TypeError(f"{str(wrong)[:40]!r} where a run writes {getattr(kind, '__name__', 'a number')}")
    ends = [0, *(group.stop for group in groups)]
    if [group.start for group in groups] != ends[:-1] or ends[-1] != len(static.robot_names) or static.rate_hz < 1:
        raise ValueError("groups that do not contain each robot once, or no rate")
    if len(static.arena_size_m) != 2 or not static.seeds or len(static.obstacles) != len(static.seeds):
        raise ValueError("no size, or not as many obstacles as arenas")


def _finite(static: Static) -> dict[str, Any]:
    """Return a mapping without infinite heights: JSON has none, and a missing height is read as infinite."""
    return asdict(static, dict_factory=lambda items: {key: value for key, value in items if value != inf})


def _floor(item: Mapping[str, Any]) -> Floor:
    image = FloorImage(**item["image"]) if item["image"] else None
    return Floor(item["shade"], tuple(Patch(**_plain(patch)) for patch in item["patches"]), image)


def _group(item: Mapping[str, Any], where: str) -> Group:
    fields: dict[str, Any] = {**item, "body": body_from_mapping(item["body"], where)}
    return Group(**fields)


def _plain(item: Mapping[str, object]) -> dict[str, Any]:
    return {key: _as_tuples(value) for key, value in item.items()}


def _as_tuples(value: object) -> object:
    """Convert JSON's lists to the tuples of the dataclasses."""
    return tuple(_as_tuples(item) for item in cast("list[object]", value)) if isinstance(value, list) else value
