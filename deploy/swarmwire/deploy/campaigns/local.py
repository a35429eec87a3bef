"""`--executor local`: worker processes of this machine, which a campaign starts, watches and replaces.

A worker reads tasks from standard input and writes results to standard output: a length of 4 bytes, little-endian, and
msgpack. It is a program of its own rather than a child of multiprocessing, which would run the user's script again in
each. Standard input is its life line: when that ends, the campaign is gone, and the worker ends in the middle of a run.
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

MAX_STEP_S = 1.0  # that one look adds to it: a campaign that was frozen itself, by Ctrl-Z, has received nothing, too
MAX_FALSE_STARTS = 3  # in a row: then it is the machine or the installation, and no task
LENGTH_BYTES = 4
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "POLARS_MAX_THREADS"), "1")
Message = dict[str, Any]


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
        self._tried: set[Task] = set()  # whose worker died once
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
        """Tasks that are over; WorkersFailed if workers cannot start here."""
        found: list[Finished] = []
        for worker, message in self._messages(timeout_s):
            if worker not in self._workers:
                continue  # the last message of one that was ended
            worker.silence.broken()
            task = worker.task
            if message is None:
                self._remove(worker)
                if task is not None:
                    found += self._died(worker, task)
            elif "ready" in message:
                worker.ready, self._false_starts = True, 0
            elif "rows" in message and task is not None:
                worker.task = None
                found.append(Finished(task, msgspec.convert(message, TaskResult)))
        for worker in [worker for worker in self._workers if worker.task is not None and worker.silence.too_long()]:
            self._remove(worker)
            if worker.task is not None:
                found += self._lost(worker.task, str(worker.silence))
        return found

    def close(self) -> None:
        """End them all."""
        for worker in self._workers:
            worker.end()
        self._workers.clear()

    def _start(self) -> "WorkerProcess":
        worker = WorkerProcess(f"local-{self._started}", lambda of, message: self._received.put((of, message)))
        self._started += 1
        self._workers.append(worker)
        return worker

    def _remove(self, worker: "WorkerProcess") -> None:
        self._workers.remove(worker)
        worker.end()

    def _died(self, worker: "WorkerProcess", task: Task) -> list[Finished]:
        """The task of a worker that died; one that never began goes to another worker."""
        if worker.ready:
            return self._lost(task, worker.how_it_died())
        self._false_starts += 1
        if self._false_starts >= MAX_FALSE_STARTS:
            raise WorkersFailed(f"no worker can start: {worker.how_it_died()} before it was ready")
        self.submit(task)
        return []

    def _lost(self, task: Task, why: str) -> list[Finished]:
        """Try it once more, then yield it as lost."""
        if task in self._tried:
            return [Finished(task, None, why)]
        self._tried.add(task)
        self.submit(task)
        return []

    def _messages(self, timeout_s: float) -> "Iterator[tuple[WorkerProcess, Message | None]]":
        """All that are there, after waiting for the first."""
        try:
            yield self._received.get(timeout=timeout_s)
            while True:
                yield self._received.get_nowait()
        except Empty:
            return


def usable_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class WorkerProcess:
    """A worker as its campaign sees it; it ends with `end`, or with this process.

    Attributes:
        ready: whether it has reported that it can work.
        task: its task.
        silence: since it was given that, or sent anything.
    """

    def __init__(self, name: str, received: "Callable[[WorkerProcess, Message | None], None]") -> None:
        """Start it. `received` is called, in another thread, with each message, and with None once the process ends."""
        # A session of its own: Ctrl-C is for the campaign alone. Workers share the cores, so each has one thread.
        self._process = subprocess.Popen(
            [sys.executable, "-m", "swarmwire.deploy.campaigns.local", name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
            env={**os.environ, **ONE_THREAD, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )
        self._tasks, self._results = (cast("BinaryIO", of) for of in (self._process.stdin, self._process.stdout))
        self._received = received
        self.ready = False
        self.task: Task | None = None
        self.silence = Silence()
        self._thread = Thread(target=self._listen, name=f"campaign {name}", daemon=True)
        self._thread.start()

    @property
    def pid(self) -> int:
        """Of the process."""
        return self._process.pid

    def give(self, task: Task) -> None:
        """Let it work on a task; if it is dead already, its thread will notice."""
        self.task = task
        self.silence.broken()
        with suppress(BrokenPipeError):
            send(self._tasks, asdict(task))

    def how_it_died(self) -> str:
        """In words, once it is over."""
        code = self._process.wait()
        return f"the worker died, signal {-code}" if code < 0 else f"the worker ended, exit code {code}"

    def end(self) -> None:
        """Kill the process with all that it started."""
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        self._thread.join()
        for stream in (self._tasks, self._results):
            with suppress(BrokenPipeError):  # what it was still to be given
                stream.close()

    def _listen(self) -> None:
        while (message := receive(self._results)) is not None:
            self._received(self, message)
        self._received(self, None)


class Silence:
    """Adds up the time in which a worker sent nothing: it was frozen, or its agent waits for ever.

    Attributes:
        most_s: after which it has lasted too long.
    """

    def __init__(self, clock: Clock | None = None, most_s: float = MAX_SILENCE_S) -> None:
        self.most_s, self._clock = most_s, clock or WallClock()
        self._silent_ns, self._looked_ns = 0, self._clock.now_ns()

    def broken(self) -> None:
        """Something was received."""
        self._silent_ns, self._looked_ns = 0, self._clock.now_ns()

    def too_long(self) -> bool:
        """Whether it has lasted too long; to be called often."""
        now_ns = self._clock.now_ns()
        self._silent_ns += min(now_ns - self._looked_ns, to_ns(MAX_STEP_S))
        self._looked_ns = now_ns
        return self._silent_ns > to_ns(self.most_s)

    def __str__(self) -> str:
        return f"the worker stood still for {self.most_s:g} s"


def send(stream: BinaryIO, message: Message) -> None:
    """Write a message, all of it; OSError if the reader is gone."""
    body = msgpack.packb(message)
    stream.write(len(body).to_bytes(LENGTH_BYTES, "little") + body)
    stream.flush()


def receive(stream: BinaryIO) -> Message | None:
    """The next message; None at the end of the stream, also in the middle of one."""
    head = stream.read(LENGTH_BYTES)
    if len(head) < LENGTH_BYTES:
        return None
    length = int.from_bytes(head, "little")
    body = stream.read(length)
    return cast("Message", msgpack.unpackb(body)) if len(body) == length else None


def main(name: str) -> None:
    """The worker's side: say that it is ready, then work until standard input ends."""
    given, results = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)  # an agent that asks for input must not take tasks, or wait
    os.dup2(2, 1)  # what agents print is for people
    tasks = SimpleQueue[Task]()
    Thread(target=_take_tasks, args=(given, tasks), daemon=True).start()
    send(results, {"ready": name})

    def alive() -> bool:
        with suppress(OSError):  # the campaign is gone: the other thread ends this process
            send(results, {"alive": name})
        return True

    while True:
        send(results, asdict(run_task(tasks.get(), name, alive)))


def _take_tasks(given: BinaryIO, tasks: SimpleQueue[Task]) -> None:
    """Take in tasks; end this process at once when the campaign is gone."""
    while (message := receive(given)) is not None:
        tasks.put(msgspec.convert(message, Task))
    os._exit(0)


if __name__ == "__main__":
    main(sys.argv[1])
