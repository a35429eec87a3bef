"""Workers of this machine: processes that a campaign starts, watches and replaces."""

import os
from collections.abc import Iterator
from queue import Empty, SimpleQueue

from swarmwire.comms.errors import SwarmwireError
from swarmwire.deploy.campaign.executor import Finished
from swarmwire.deploy.campaign.task import Task, result_from
from swarmwire.deploy.campaign.worker_process import Message, WorkerProcess

MAX_FALSE_STARTS = 3  # in a row: then it is the machine or the installation, and no task


class WorkersFailed(SwarmwireError):
    """Worker processes end before they can take a task."""


class LocalExecutor:
    """A pool of worker processes: each has one task at a time, and another takes its place when it dies."""

    records = True

    def __init__(self, workers: int | None = None) -> None:
        """So many, by default one for each core that this process may use; each starts with its first task."""
        self.slots = workers or usable_cores()
        self._received = SimpleQueue[tuple[WorkerProcess, Message | None]]()
        self._workers: list[WorkerProcess] = []
        self._started = self._false_starts = 0

    @property
    def pids(self) -> list[int]:
        """Of the workers that are there."""
        return [worker.pid for worker in self._workers]

    def submit(self, task: Task) -> None:
        """Give a task to a worker that has none."""
        idle = next((worker for worker in self._workers if worker.task is None), None)
        (idle or self._start()).give(task)

    def finished(self, timeout_s: float) -> list[Finished]:
        """What is over; WorkersFailed if workers cannot start here."""
        found: list[Finished] = []
        for worker, message in self._news(timeout_s):
            if worker not in self._workers:
                continue  # the last words of one that was ended
            worker.silence.broken()
            task = worker.task
            if message is None:
                self._workers.remove(worker)
                worker.end()
                if task is not None:
                    found += self._lost(worker, task)
            elif "ready" in message:
                worker.ready, self._false_starts = True, 0
            elif "rows" in message and task is not None:
                worker.task = None
                found.append(Finished(task, result_from(message)))
        return found + self._standing_still()

    def close(self) -> None:
        """End them all."""
        for worker in self._workers:
            worker.end()
        self._workers.clear()

    def _start(self) -> WorkerProcess:
        worker = WorkerProcess(f"local-{self._started}", lambda of, message: self._received.put((of, message)))
        self._started += 1
        self._workers.append(worker)
        return worker

    def _standing_still(self) -> list[Finished]:
        """The tasks of workers that said nothing for too long, which are ended."""
        still = [worker for worker in self._workers if worker.task is not None and worker.silence.too_long()]
        for worker in still:
            self._workers.remove(worker)
            worker.end()
        return [Finished(worker.task, None, str(worker.silence)) for worker in still if worker.task is not None]

    def _lost(self, worker: WorkerProcess, task: Task) -> list[Finished]:
        """The task of a worker that died of it; one that never began goes to another worker."""
        if worker.ready:
            return [Finished(task, None, worker.how_it_died())]
        self._false_starts += 1
        if self._false_starts >= MAX_FALSE_STARTS:
            raise WorkersFailed(f"no worker can start: {worker.how_it_died()} before it was ready")
        self.submit(task)
        return []

    def _news(self, timeout_s: float) -> Iterator[tuple[WorkerProcess, Message | None]]:
        """All that is there, after waiting for the first."""
        try:
            yield self._received.get(timeout=timeout_s)
            while True:
                yield self._received.get_nowait()
        except Empty:
            return


def usable_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
