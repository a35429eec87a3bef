"""One worker as its campaign sees it: a process, the task that it is at, and a thread that hears what it says."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from threading import Thread
from typing import Any, BinaryIO, cast

from swarmwire.deploy.campaign.messages import receive, send
from swarmwire.deploy.campaign.silence import Silence
from swarmwire.deploy.campaign.task import Task, task_message

ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "POLARS_MAX_THREADS"), "1")
Message = dict[str, Any]


class WorkerProcess:
    """A worker; it ends with `end`, or with this process, whose pipe is its life line.

    Attributes:
        ready: whether it has said that it can work.
        task: what it is at.
        silence: since it was given that, or said anything.
    """

    def __init__(self, name: str, said: "Callable[[WorkerProcess, Message | None], None]") -> None:
        """Start it. `said` is called, in another thread, with each message, and with None once the process is over."""
        # A session of its own: Ctrl-C is for the campaign alone. Workers share the cores, so each has one thread.
        self._process = subprocess.Popen(
            [sys.executable, "-m", "swarmwire.deploy.campaign.worker", name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
            env={**os.environ, **ONE_THREAD, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )
        self._tasks, self._results = (cast("BinaryIO", of) for of in (self._process.stdin, self._process.stdout))
        self._said = said
        self.ready = False
        self.task: Task | None = None
        self.silence = Silence()
        self._thread = Thread(target=self._hear, name=f"campaign {name}", daemon=True)
        self._thread.start()

    @property
    def pid(self) -> int:
        """Of the process."""
        return self._process.pid

    def give(self, task: Task) -> None:
        """Let it work on a task; if it is dead already, its thread will say so."""
        self.task = task
        self.silence.broken()
        with suppress(BrokenPipeError):
            send(self._tasks, task_message(task))

    def how_it_died(self) -> str:
        """In words, once it is over."""
        code = self._process.wait()
        return f"the worker died, signal {-code}" if code < 0 else f"the worker ended, exit code {code}"

    def end(self) -> None:
        """End the process, whatever it is at, with all that it started."""
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        self._thread.join()
        for stream in (self._tasks, self._results):
            with suppress(BrokenPipeError):  # what it was still to be given
                stream.close()

    def _hear(self) -> None:
        while (message := receive(self._results)) is not None:
            self._said(self, message)
        self._said(self, None)
