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
    """An observer for `static.json`, and one for each table that the options ask for.

    They are apart so that one that fails leaves the others going.
    """
    made = (table.recorder(options) for table in TABLES.values())
    return [StaticRecorder(options.folder), *(recorder for recorder in made if recorder is not None)]


def record_summary(parts: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The summary's `record`, of the observers' summary parts: of each table the rows written and dropped.

    A table is left out if it was not recorded, or if its recorder failed. The last is the recording for the viewer.
    """
    return {name: parts[f"record_{name}"] for name in (*TABLES, "rrd") if f"record_{name}" in parts}


class StaticRecorder(Observer):
    """Observer that writes `static.json`, before the first tick. No summary part."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def begin(self, static: Static) -> None:
        """Write it."""
        write_static(static, self._folder / STATIC)


def write_static(static: Static, path: Path) -> None:
    """Write it aside, then rename, so that no half of it is ever seen."""
    write_text(path, json.dumps({"format": TABLES_FORMAT, **_finite(static)}, indent=2, allow_nan=False) + "\n")


def read_static(path: Path) -> Static:
    """What `write_static` wrote, equal to it; BadInput if there is no such file, or it holds something else."""
    try:
        read = from_json(path.read_text(encoding="utf-8"))
        check_format(read, TABLES_FORMAT, str(path))
        del read["format"]
        static = _static(read, str(path))
        _check(static)
        return static
    except FileNotFoundError:
        raise BadInput(str(path), "", "expected a file that a run wrote; there is none") from None
    except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
        raise BadInput(str(path), "", f"expected the static part of a run: {error}") from error


def _static(read: Mapping[str, Any], where: str) -> Static:
    fields: dict[str, Any] = {key: _as_tuples(value) for key, value in read.items()}
    fields["obstacles"] = tuple(tuple(Obstacle(**_plain(item)) for item in own) for own in read["obstacles"])
    fields["lights"] = tuple(tuple(Light(**_plain(item)) for item in own) for own in read["lights"])
    fields["floor"] = _floor(read["floor"]) if read["floor"] is not None else None
    fields["groups"] = tuple(_group(item, where) for item in read["groups"])
    return Static(**fields)


def _check(static: Static) -> None:
    """TypeError or ValueError unless what rows of tables are named and counted by is there, and fits."""
    groups = static.groups
    texts = (static.name, static.boundary, *static.robot_names, *(of.name for of in groups))
    wholes = (static.rate_hz, *static.seeds, *(n for of in groups for n in (of.start, of.stop, of.act_every_ticks)))
    numbers = (*static.arena_size_m, *(() if static.range_m is None else (static.range_m,)))
    for kind, values in ((str, texts), (int, wholes), (int | float, numbers)):
        wrong = next((value for value in values if not isinstance(value, kind) or isinstance(value, bool)), None)
        if wrong is not None:
            raise TypeError(f"{str(wrong)[:40]!r} where a run writes {getattr(kind, '__name__', 'a number')}")
    ends = [0, *(of.stop for of in groups)]
    if [of.start for of in groups] != ends[:-1] or ends[-1] != len(static.robot_names) or static.rate_hz < 1:
        raise ValueError("groups that do not hold each robot once, or no rate")
    if len(static.arena_size_m) != 2 or not static.seeds or len(static.obstacles) != len(static.seeds):
        raise ValueError("no size, or not as many obstacles as arenas")


def _finite(static: Static) -> dict[str, Any]:
    """As a mapping without heights that are infinite: JSON has no word for that, and none is read as infinite."""
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
    """JSON has lists where these dataclasses have tuples."""
    return tuple(_as_tuples(item) for item in cast("list[object]", value)) if isinstance(value, list) else value
