"""Scenario keys, the fields of `summary.json`, and the tables and JSON files beside it in a run folder."""

import json
from collections.abc import Iterable
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import polars as pl

from swarmwire.comms.observe.truth import Static
from swarmwire.comms.robot.bodies.body import Body
from swarmwire.comms.robot.bodies.custom import CustomActuatorSpec
from swarmwire.comms.robot.bodies.drives import DRIVES, Leds
from swarmwire.comms.robot.bodies.ros2_names import Ros2Names
from swarmwire.comms.robot.packets import FATE_NAMES
from swarmwire.comms.robot.sensors import SENSOR_SPECS
from swarmwire.deploy import Recording, Result, run
from swarmwire.deploy.cli.catalogue.scenario import all_keys
from swarmwire.deploy.cli.catalogue.schema import CatalogueParameter, parameters_of_dataclass
from swarmwire.deploy.runs.record.provenance import RunFacts
from swarmwire.metrics.measures.registry import METRICS
from tests.tools.stable.agent import ROOT
from tests.tools.stable.samples import LEFT_OUT, joined, lines_of, paths_of, sample

TYPES = {"run.json": RunFacts, "static.json": Static}  # of what they hold beside `format`
DRONES = ROOT / "scenarios" / "drones.toml"  # drones move sideways, so that there is a column for that
BOX = '{ shape = "box", at = [3.0, 2.0], size_m = [0.2, 0.2], movable = true, mass_kg = 0.1 }'
OVERRIDES = ("duration_s=0.3", "robots.drones.count=3", "robots.floor.count=2", f"arena.obstacles=[{BOX}]")
TELLING = """
from swarmwire.agent import Agent

class Telling(Agent):
    def step(self, robot):
        robot.note(value=1.0)
"""  # so that there is a column for that


def scenario_text() -> str:
    """A key a line, by its path; a body's sheet after the scenario."""
    tables = {f"drive, kind = {name}": kind for name, kind in DRIVES.items()}
    tables |= {"leds": Leds, "ros2": Ros2Names, "actuators.*": CustomActuatorSpec}
    tables |= {f"sensors.{name}": kind for name, kind in SENSOR_SPECS.items()}
    keys = (key for key in parameters_of_dataclass(Body) if key.name.partition(".")[0] not in ("drive", "leds", "ros2"))
    parts = ["# a scenario", *_lines(all_keys()), "# a body's sheet", *_lines(keys)]
    for title, kind in tables.items():
        parts += [f"# a body's sheet: {title}", *_lines(parameters_of_dataclass(kind))]
    return "\n".join(parts) + "\n"


def _lines(keys: Iterable[CatalogueParameter]) -> list[str]:
    return [f"{key.name}: {key.expected}{f' in {key.unit}' if key.unit else ''}; {_default(key)}" for key in keys]


def _default(key: CatalogueParameter) -> str:
    return "required" if key.required else f"default {key.value!r}"


def summary_text() -> str:
    """A field a line; then those that are lists where a run has several arenas, and the metrics that there are."""
    made_up = [[paths_of(_summary(left_out, arenas)) for left_out in LEFT_OUT] for arenas in (1, 2)]
    one = joined(*made_up[0], paths_of({"record": _recorded()["summary.json"]["record"]}))
    several = joined(*made_up[1])
    differ = {path: kinds for path, kinds in several.items() if not kinds <= one.get(path, set())}
    metrics = "".join(f"{name}: {kind.unit or 'no unit'}, {kind.kind}\n" for name, kind in METRICS.items())
    return f"{lines_of(one)}# with several arenas\n{lines_of(differ)}# metrics\n{metrics}"


def _summary(left_out: str, arenas: int) -> dict[str, Any]:
    """The summary of a made-up run."""
    result = sample(Result, left_out)
    [arena] = result.arenas
    if arena.radio:
        arena = replace(arena, radio=replace(arena.radio, fates=dict.fromkeys(FATE_NAMES, 1)))
    events = tuple(replace(event, robots=event.robots * arenas) for event in result.events)
    return replace(result, arenas=(arena,) * arenas, events=events).summary()


def tables_text() -> str:
    """A file a paragraph."""
    parts: list[str] = []
    for name, held in _recorded().items():
        if name in TYPES:
            parts.append(f"# {name}, format {held['format']}\n{lines_of(_fields(TYPES[name]))}")
        elif name.endswith(".parquet"):
            columns = "".join(f"{column}: {kind}\n" for column, kind in held.items())
            parts.append(f"# {name}\n{columns}")
    return "\n".join(parts)


def _fields(kind: type[Any]) -> dict[str, set[str]]:
    made_up = (asdict(sample(kind, left_out)) for left_out in LEFT_OUT)
    return joined({"format": {"whole number"}}, *map(paths_of, made_up))


@cache
def _recorded() -> dict[str, Any]:
    """What each JSON file holds, and of each table the columns with their types."""
    with TemporaryDirectory() as folder:
        record = Recording(packets=1.0, links=True, rrd=False)
        (Path(folder) / "telling.py").write_text(TELLING, encoding="utf-8")
        agent = f"robots.floor.agent={folder}/telling.py:Telling", "robots.floor.params={}"
        run(DRONES, overrides=[*OVERRIDES, *agent], out=Path(folder) / "run", record=record)
        files: dict[str, Any] = {}
        for path in sorted((Path(folder) / "run").iterdir()):
            if path.suffix == ".json":
                files[path.name] = json.loads(path.read_text(encoding="utf-8"))
            elif path.suffix == ".parquet":
                files[path.name] = {name: str(kind) for name, kind in pl.read_parquet_schema(path).items()}
        return files
