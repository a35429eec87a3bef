"""What a short run with everything recorded leaves in its folder."""

import json
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import polars as pl

from swarmwire.deploy import Recording, run
from tests.tools.stable.sources import ROOT

SCENARIO = ROOT / "scenarios" / "drones.toml"  # drones move sideways, so that there is a column for that
BOX = '{ shape = "box", at = [3.0, 2.0], size_m = [0.2, 0.2], movable = true, mass_kg = 0.1 }'
OVERRIDES = ("duration_s=0.3", "robots.drones.count=3", "robots.floor.count=2", f"arena.obstacles=[{BOX}]")
TELLING = """
from swarmwire.agent import Agent

class Telling(Agent):
    def step(self, robot):
        robot.note(value=1.0)
"""  # so that there is a column for that


@cache
def recorded() -> dict[str, Any]:
    """What each JSON file holds, and of each table the columns with their types."""
    with TemporaryDirectory() as folder:
        record = Recording(packets=1.0, links=True, rrd=False)
        (Path(folder) / "telling.py").write_text(TELLING, encoding="utf-8")
        agent = f"robots.floor.agent={folder}/telling.py:Telling", "robots.floor.params={}"
        run(SCENARIO, overrides=[*OVERRIDES, *agent], out=Path(folder) / "run", record=record)
        found: dict[str, Any] = {}
        for path in sorted((Path(folder) / "run").iterdir()):
            if path.suffix == ".json":
                found[path.name] = json.loads(path.read_text(encoding="utf-8"))
            elif path.suffix == ".parquet":
                found[path.name] = {name: str(kind) for name, kind in pl.read_parquet_schema(path).items()}
        return found
