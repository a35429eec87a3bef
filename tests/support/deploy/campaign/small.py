"""A scenario of two robots and few ticks, for campaigns of many runs, and what of their folders tells of no machine."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import msgpack
import msgspec
import polars as pl

from swarmwire.deploy.campaign.schedule import Finished
from swarmwire.deploy.campaign.store import CampaignFolder
from swarmwire.deploy.campaign.worker import Task, TaskResult, run_task
from swarmwire.metrics.campaign.spec import read_campaign

FLOCKING = "swarmwire.agent.behaviours:Flocking"
SCENARIO = """
format = 1
name = "two robots"
duration_s = 0.5
[arena]
size_m = [4.0, 4.0]
[robots.pair]
body = "epuck"
count = 2
agent = "AGENT"
[radio]
range_m = 3.0
loss = 0.2
measures = { range = {}, bearing = {} }
"""
# An agent that does what it was asked to where its robot draws a low number in its first tick: for some seeds.
STUMBLING = """
import os
from swarmwire.agent import Agent
class Stumbling(Agent):
    share: float = 0.2
    how: str = "raise"
    def __init__(self): self.began = False
    def step(self, robot):
        print("words of an agent", flush=True)
        if not self.began and robot.draw.uniform("stumble") < self.share:
            if self.how == "raise":
                raise ValueError("stumbled")
            if self.how == "exit":
                os._exit(3)
            os.kill(os.getpid(), 9)
        self.began = True
        robot.drive(0.05, 0.0)
"""


def scenario_in(folder: Path, agent: str = FLOCKING) -> Path:
    """The scenario's file in this folder."""
    (folder / "stumbling.py").write_text(STUMBLING)
    path = folder / "two.toml"
    path.write_text(SCENARIO.replace("AGENT", agent))
    return path


def rows_in(folder: Path) -> list[dict[str, Any]]:
    """The rows of a campaign that are there, without what tells of machines and times."""
    rows = CampaignFolder(folder, read_campaign(folder)).rows()
    return rows.drop([name for name in rows.columns if name.startswith(("timing_", "machine_"))]).to_dicts()


def series_in(folder: Path) -> pl.DataFrame:
    """The tick series of a campaign, as they are there."""
    return pl.read_parquet(folder / "series" / "*.parquet").sort("run", "tick")


class InThisProcess:
    """An executor without processes, which hands over what is done last first, as messages would bring it."""

    def __init__(self, slots: int = 3) -> None:
        self.slots, self.records = slots, True
        self.tasks: list[Task] = []
        self.closed = False

    def submit(self, task: Task) -> None:
        self.tasks.append(_sent(task, Task))

    def finished(self, timeout_s: float) -> list[Finished]:
        tasks, self.tasks = self.tasks[::-1], []
        return [Finished(task, _sent(run_task(task, "here"), TaskResult)) for task in tasks]

    def close(self) -> None:
        self.closed = True


def _sent(message: Any, kind: type[Any]) -> Any:
    """A task or a result after it went through a pipe."""
    return msgspec.convert(msgpack.unpackb(msgpack.packb(asdict(message))), kind)
