"""`--executor local`: worker processes of this machine, which a campaign starts, watches and replaces.

A worker reads tasks from standard input and writes results to standard output: a length of 4 bytes, little-endian, and
msgpack. It is a separate program, since a child of multiprocessing would run the user's script again. When standard
input ends, the campaign is gone, and the worker exits at once, also within a run.
"""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any, BinaryIO, cast

import msgpack
import msgspec

from swarmwire.comms.base.clock import Clock, WallClock, to_ns
from swarmwire.comms.base.errors import SwarmwireError
from swarmwire.deploy.campaigns.schedule import Finished
from swarmwire.deploy.campaigns.worker import MAX_SILENCE_S, Task, TaskResult, run_task

MAX_STEP_S = 1.0  # largest silence counted per check, since a campaign stopped by Ctrl-Z receives nothing, too
MAX_FALSE_STARTS = 3  # consecutive ones; more mean a fault of the machine or the installation, not of a task
LENGTH_BYTES = 4
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "POLARS_MAX_THREADS"), "1")
Message = dict[str, Any]


class WorkersFailed(SwarmwireError):
    """Worker processes end before they are ready."""


class LocalExecutor:
    """A pool of worker processes: each has one task at a time, and is replaced when it dies."""

    records = True

    def __init__(self, workers: int | None = None) -> None:
        """Use at most `workers` processes, by default one per usable core; each starts with its first task."""
        self.slots = workers or usable_cores()
        self._received = SimpleQueue[tuple[WorkerProcess, Message | None]]()
        self._workers: list[WorkerProcess] = []
        self._retried: set[Task] = set()  # tasks whose worker died once
        self._started = self._false_starts = 0

    @property
    def pids(self) -> list[int]:
        """Process ids of the present workers."""
        return [worker.pid for worker in self._workers]

    def submit(self, task: Task) -> None:
        """Assign a task to an idle worker."""
        idle = next((worker for worker in self._workers if worker.task is None), None)
        (idle or self._start()).assign(task)

    def finished(self, timeout_s: float) -> list[Finished]:
        """Return the tasks that have ended; WorkersFailed if workers cannot start."""
        ended: list[Finished] = []
        for worker, message in self._messages(timeout_s):
            if worker not in self._workers:
                continue  # the last message of a removed worker
            worker.silence.reset()
            task = worker.task
            if message is None:
                self._remove(worker)
                if task is not None:
                    ended += self._reassign(worker, task)
            elif "ready" in message:
                worker.ready, self._false_starts = True, 0
            elif "rows" in message and task is not None:
                worker.task = None
                ended.append(Finished(task, msgspec.convert(message, TaskResult)))
        for worker in [worker for worker in self._workers if worker.task is not None and worker.silence.is_too_long()]:
            self._remove(worker)
            if worker.task is not None:
                ended += self._retry(worker.task, str(worker.silence))
        return ended

    def close(self) -> None:
        """End all workers."""
        for worker in self._workers:
            worker.end()
        self._workers.clear()

    def _start(self) -> "WorkerProcess":
        name = f"local-{self._started}"
        worker = WorkerProcess(name, lambda process, message: self._received.put((process, message)))
        self._started += 1
        self._workers.append(worker)
        return worker

    def _remove(self, worker: "WorkerProcess") -> None:
        self._workers.remove(worker)
        worker.end()

    def _reassign(self, worker: "WorkerProcess", task: Task) -> list[Finished]:
        """Submit the task of a worker that died again; return it if it is lost."""
        if worker.ready:
            return self._retry(task, worker.cause_of_death())
        self._false_starts += 1
        if self._false_starts >= MAX_FALSE_STARTS:
            raise WorkersFailed(f"no worker can start: {worker.cause_of_death()} before it was ready")
        self.submit(task)
        return []

    def _retry(self, task: Task, cause: str) -> list[Finished]:
        """Submit a task a second time; after that return it as lost."""
        if task in self._retried:
            return [Finished(task, None, cause)]
        self._retried.add(task)
        self.submit(task)
        return []

    def _messages(self, timeout_s: float) -> "Iterator[tuple[WorkerProcess, Message | None]]":
        """Yield all received messages, after waiting for the first."""
        try:
            yield self._received.get(timeout=timeout_s)
            while True:
                yield self._received.get_nowait()
        except Empty:
            return


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class WorkerProcess:
    """Handle of a worker process, which ends with `end`, or with this process.

    Attributes:
        ready: True once the worker has reported that it is ready.
        task: the worker's task.
        silence: time since the assignment of the task, or since the last message.
    """

    def __init__(self, name: str, received: "Callable[[WorkerProcess, Message | None], None]") -> None:
        """Start the process; a thread calls `received` with each message, and with None once the process ends."""
        # The separate session keeps Ctrl-C from the workers. They share the cores, so each has one thread.
        self._process = subprocess.Popen(
            [sys.executable, "-m", "swarmwire.deploy.campaigns.local", name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
            env={**os.environ, **ONE_THREAD, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )
        self._tasks, self._results = cast("BinaryIO", self._process.stdin), cast("BinaryIO", self._process.stdout)
        self._received = received
        self.ready = False
        self.task: Task | None = None
        self.silence = Silence()
        self._thread = Thread(target=self._listen, name=f"campaign {name}", daemon=True)
        self._thread.start()

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    def assign(self, task: Task) -> None:
        """Send a task; the listening thread reports a process that has died."""
        self.task = task
        self.silence.reset()
        with suppress(BrokenPipeError):
            send(self._tasks, asdict(task))

    def cause_of_death(self) -> str:
        """Wait for the end of the process, and return its cause in words."""
        code = self._process.wait()
        return f"the worker died, signal {-code}" if code < 0 else f"the worker ended, exit code {code}"

    def end(self) -> None:
        """Kill the process and its children."""
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        self._thread.join()
        for stream in (self._tasks, self._results):
            with suppress(BrokenPipeError):  # unsent bytes of a task
                stream.close()

    def _listen(self) -> None:
        while (message := receive(self._results)) is not None:
            self._received(self, message)
        self._received(self, None)


class Silence:
    """Time without a message from a worker, which is frozen, or whose agent blocks.

    Attributes:
        max_s: longest silence of a working worker.
    """

    def __init__(self, clock: Clock | None = None, max_s: float = MAX_SILENCE_S) -> None:
        self.max_s, self._clock = max_s, clock or WallClock()
        self._silent_ns, self._checked_ns = 0, self._clock.now_ns()

    def reset(self) -> None:
        """Start again at zero, after a message."""
        self._silent_ns, self._checked_ns = 0, self._clock.now_ns()

    def is_too_long(self) -> bool:
        """Return True once the silence exceeds its limit; call it often."""
        now_ns = self._clock.now_ns()
        self._silent_ns += min(now_ns - self._checked_ns, to_ns(MAX_STEP_S))
        self._checked_ns = now_ns
        return self._silent_ns > to_ns(self.max_s)

    def __str__(self) -> str:
        return f"the worker stood still for {self.max_s:g} s"


def send(stream: BinaryIO, message: Message) -> None:
    """Write a message; OSError if the reader is gone."""
    body = msgpack.packb(message)
    stream.write(len(body).to_bytes(LENGTH_BYTES, "little") + body)
    stream.flush()


def receive(stream: BinaryIO) -> Message | None:
    """Read the next message; None at the end of the stream, also within a message."""
    header = stream.read(LENGTH_BYTES)
    if len(header) < LENGTH_BYTES:
        return None
    length = int.from_bytes(header, "little")
    body = stream.read(length)
    return cast("Message", msgpack.unpackb(body)) if len(body) == length else None


def main(name: str) -> None:
    """Run a worker: report that it is ready, then execute tasks until standard input ends."""
    requests, results = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)  # an agent that reads input must neither consume tasks nor block
    os.dup2(2, 1)  # agents' output goes to standard error
    tasks = SimpleQueue[Task]()
    Thread(target=_read_tasks, args=(requests, tasks), daemon=True).start()
    send(results, {"ready": name})

    def alive() -> bool:
        with suppress(OSError):  # the campaign is gone; the other thread ends this process
            send(results, {"alive": name})
        return True

    while True:
        send(results, asdict(run_task(tasks.get(), name, alive)))


def _read_tasks(requests: BinaryIO, tasks: SimpleQueue[Task]) -> None:
    """Queue tasks; end this process at once when the campaign is gone."""
    while (message := receive(requests)) is not None:
        tasks.put(msgspec.convert(message, Task))
    os._exit(0)


if __name__ == "__main__":
    main(sys.argv[1])
