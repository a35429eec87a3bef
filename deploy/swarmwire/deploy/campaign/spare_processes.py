"""Worker processes that a guest keeps on somebody else's machine: for the tasks of one campaign, ended soon after.

Threads of a process that is not ours take them for a task and give them back: so an agent that dies ends neither that
process nor its neighbours, a task can be ended in the middle, and none shares an interpreter with another.
"""

from collections.abc import Callable
from queue import Empty, SimpleQueue
from threading import Lock, Timer

from swarmwire.comms.errors import SwarmwireError
from swarmwire.deploy.campaign.task import Task
from swarmwire.deploy.campaign.worker_process import Message, WorkerProcess

POLL_S = 0.25  # between looks whether a task is still wanted
IDLE_S = 15.0  # after which a process ends that nobody took again: the campaign is over, or its coordinator is dead


class CannotStart(SwarmwireError):
    """A worker process ended before it was ready."""


class NotWanted(SwarmwireError):
    """Nobody waits for the task any more; its process was ended."""


class SpareProcess:
    """A worker process and what it says."""

    def __init__(self, name: str) -> None:
        self._received = SimpleQueue[Message | None]()
        self._process = WorkerProcess(name, lambda _, message: self._received.put(message))
        self.end = self._process.end

    def done(self, task: Task, wanted: Callable[[], bool]) -> Message:
        """What came of a task: a result as a mapping, or {"lost": how the process died, or that it stands still}.

        CannotStart if it died before it could begin, NotWanted as soon as `wanted()` is not.
        """
        self._process.give(task)
        while wanted():
            try:
                message = self._received.get(timeout=POLL_S)
            except Empty:
                if self._process.silence.too_long():
                    return {"lost": str(self._process.silence)}
                continue
            self._process.silence.broken()
            if message is None:
                how = self._process.how_it_died()
                if not self._process.ready:
                    raise CannotStart(f"no worker process can start: {how} before it was ready")
                return {"lost": how}
            if "rows" in message:
                return message
            self._process.ready = True
        raise NotWanted("the task is not wanted any more")


class SpareProcesses:
    """Those that are at no task, by campaign; for use by several threads."""

    def __init__(self, idle_s: float = IDLE_S) -> None:
        self._idle_s = idle_s
        self._lock = Lock()
        self._spare: dict[str, list[tuple[SpareProcess, Timer]]] = {}

    def done(self, campaign: str, name: str, task: Task, wanted: Callable[[], bool]) -> Message:
        """As `SpareProcess.done`, by a process of this campaign; `name` names one that has to be started."""
        process = self._taken(campaign) or SpareProcess(name)
        try:
            message = process.done(task, wanted)
        except BaseException:  # whatever it was, nobody knows what the process is at; it goes on to the caller
            process.end()
            raise
        if "lost" in message:
            process.end()
        else:
            self._give_back(campaign, process)
        return message

    def _taken(self, campaign: str) -> SpareProcess | None:
        with self._lock:
            spare = self._spare.get(campaign)
            if not spare:
                return None
            process, timer = spare.pop()
        timer.cancel()
        return process

    def _give_back(self, campaign: str, process: SpareProcess) -> None:
        timer = Timer(self._idle_s, self._end, (campaign, process))
        timer.daemon = True  # its process ends with this one in any case
        with self._lock:
            self._spare.setdefault(campaign, []).append((process, timer))
        timer.start()

    def _end(self, campaign: str, process: SpareProcess) -> None:
        """End a process unless it was taken again in this very moment."""
        with self._lock:
            spare = self._spare.get(campaign, [])
            left = [(other, timer) for other, timer in spare if other is not process]
            taken_again = len(left) == len(spare)
            if left:
                self._spare[campaign] = left
            else:
                self._spare.pop(campaign, None)
        if not taken_again:
            process.end()
