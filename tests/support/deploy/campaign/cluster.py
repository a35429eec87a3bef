"""A dask cluster on the loopback, as people start one: a scheduler, and nannies with a worker process each."""

import os
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import psutil


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
        told = next(line for line in self.scheduler.stderr if "Scheduler at:" in line)
        self.address = told.rpartition("tcp://")[2].strip()
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
    found = Cluster(folder, **settings)
    try:
        for _ in range(workers):
            found.add_worker()
        yield found
    finally:
        found.end()
