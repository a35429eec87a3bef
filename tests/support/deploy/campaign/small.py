"""A scenario of two robots and few ticks, for campaigns of many runs, and what of their folders tells of no machine."""

from pathlib import Path
from typing import Any

import polars as pl

from swarmwire.deploy.campaign.campaign import read_campaign
from swarmwire.deploy.campaign.campaign_folder import CampaignFolder
from swarmwire.deploy.campaign.executor import Finished
from swarmwire.deploy.campaign.run_task import run_task
from swarmwire.deploy.campaign.task import Task, result_from, result_message, task_from, task_message

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
        self.tasks.append(task_from(task_message(task)))

    def finished(self, timeout_s: float) -> list[Finished]:
        tasks, self.tasks = self.tasks[::-1], []
        return [Finished(task, result_from(result_message(run_task(task, "here")))) for task in tasks]

    def close(self) -> None:
        self.closed = True
