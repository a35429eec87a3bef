"""Small campaigns, in this process or on a cluster."""

import os
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import msgpack
import msgspec
import polars as pl
import psutil
import pytest

from swarmwire.deploy.campaigns import sweep as sweeping
from swarmwire.deploy.campaigns.schedule import Finished
from swarmwire.deploy.campaigns.store import CampaignWriter
from swarmwire.deploy.campaigns.worker import Task, TaskResult, run_task
from swarmwire.metrics.records.campaign.campaign_json import read_campaign

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
    rows = CampaignWriter(folder, read_campaign(folder)).rows()
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


class Cluster:
    """A scheduler, and the nannies that were started so far; `name` is what `--executor` takes."""

    def __init__(self, folder: Path, **settings: str) -> None:
        """`settings` are environment variables."""
        self._folder, self.nannies = folder, list[psutil.Popen]()
        self._settings = {**os.environ, **settings}
        self._log = (folder / "workers.log").open("w")  # also what agents print
        self.scheduler = psutil.Popen(
            [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0",
             "--no-dashboard", "--dashboard-address", ":0"],
            stderr=subprocess.PIPE, text=True, cwd=folder, env=self._settings,
        )  # fmt: skip
        printed = next(line for line in self.scheduler.stderr if "Scheduler at:" in line)
        self.address = printed.rpartition("tcp://")[2].strip()
        self.name = f"dask://{self.address}"

    def add_worker(self, *, preload: Path | None = None) -> psutil.Popen:
        """Start another nanny, whose worker joins when it is ready."""
        odd = ["--preload", str(preload)] if preload else []
        command = [sys.executable, "-m", "distributed.cli.dask_worker", self.address, "--nthreads", "1"]
        options = ["--no-dashboard", "--local-directory", str(self._folder), *odd]
        nanny = psutil.Popen([*command, *options], stdout=self._log, stderr=self._log, cwd=self._folder)
        self.nannies.append(nanny)
        return nanny

    def end(self) -> None:
        """End all processes, and wait for the workers."""
        processes = [self.scheduler, *self.nannies]
        started = [child for nanny in self.nannies for child in children(nanny)]
        for process in processes:
            if process.is_running():
                process.kill()
            process.wait()
        self.scheduler.stderr.close()
        self._log.close()
        for child in started:
            if child.is_running() and child.status() == psutil.STATUS_STOPPED:
                child.kill()
        assert psutil.wait_procs(started, timeout=30)[1] == []


def children(nanny: psutil.Popen) -> list[psutil.Process]:
    """The processes of a nanny, its worker among them."""
    return nanny.children(recursive=True) if nanny.is_running() and nanny.status() != psutil.STATUS_ZOMBIE else []


@contextmanager
def cluster(folder: Path, workers: int, **settings: str) -> Generator[Cluster]:
    """A cluster with so many workers."""
    cluster = Cluster(folder, **settings)
    try:
        for _ in range(workers):
            cluster.add_worker()
        yield cluster
    finally:
        cluster.end()


@pytest.fixture
def scenario(tmp_path):
    return scenario_in(tmp_path)


@pytest.fixture
def stumbling(tmp_path):
    return scenario_in(tmp_path, "stumbling.py:Stumbling")


@pytest.fixture
def executors(monkeypatch):
    """Campaigns of this test need no processes: a second less for each."""
    opened: list[InThisProcess] = []

    def open_executor(on, workers, scenario):
        opened.append(InThisProcess())
        return opened[-1]

    monkeypatch.setattr(sweeping, "open_executor", open_executor)
    return opened
