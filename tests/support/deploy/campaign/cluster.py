"""A dask cluster on the loopback, as people start one: a scheduler and workers, each a process."""

import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import psutil


class Cluster:
    """A scheduler, and the workers that were started so far; `on` is what `--on` takes."""

    def __init__(self, folder: Path) -> None:
        self._folder, self.workers = folder, list[psutil.Popen]()
        self._log = (folder / "workers.log").open("w")  # also what agents print
        self.scheduler = psutil.Popen(
            [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0",
             "--no-dashboard", "--dashboard-address", ":0"],
            stderr=subprocess.PIPE, text=True, cwd=folder,
        )  # fmt: skip
        told = next(line for line in self.scheduler.stderr if "Scheduler at:" in line)
        self.address = told.rpartition("tcp://")[2].strip()
        self.on = f"dask://{self.address}"

    def add_worker(self, threads: int = 1, *, preload: Path | None = None) -> psutil.Popen:
        """Start another, which joins when it is ready."""
        odd = ["--preload", str(preload)] if preload else []
        command = [sys.executable, "-m", "distributed.cli.dask_worker", self.address, "--nthreads", str(threads)]
        options = ["--no-nanny", "--no-dashboard", "--local-directory", str(self._folder), *odd]
        worker = psutil.Popen([*command, *options], stderr=self._log, cwd=self._folder)
        self.workers.append(worker)
        return worker

    def end(self) -> None:
        """End all processes, and wait for those that workers started."""
        processes = [self.scheduler, *self.workers]
        started = [child for worker in self.workers for child in children(worker)]
        for process in processes:
            if process.is_running():
                process.kill()
            process.wait()
        self.scheduler.stderr.close()
        self._log.close()
        assert psutil.wait_procs(started, timeout=30)[1] == []


def children(worker: psutil.Popen) -> list[psutil.Process]:
    """The processes that a worker has its tasks done by."""
    return worker.children(recursive=True) if worker.is_running() and worker.status() != psutil.STATUS_ZOMBIE else []


@contextmanager
def cluster(folder: Path, *threads: int) -> Generator[Cluster]:
    """A cluster with workers of so many threads each."""
    found = Cluster(folder)
    try:
        for count in threads:
            found.add_worker(count)
        yield found
    finally:
        found.end()
