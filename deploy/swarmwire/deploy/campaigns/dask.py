"""`--executor dask://HOST:PORT`: the workers of a dask cluster execute a campaign's tasks. Needs the extra `cluster`.

Dask's scheduler assigns tasks to workers, and reassigns those of a dead worker up to its `allowed-failures`; nannies
replace dead workers. A worker plugin, which later workers get as well, checks code and versions, copies the scenario's
files and what `swarmwire kernels build` has compiled here, and adds a resource that tasks need. So a worker that does
not fit gets no task, and a fitting one has one task at a time, in a process that runs nothing else.
"""

import asyncio
import faulthandler
import logging
import re
import shutil
import sys
import warnings
from collections.abc import Callable, Generator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from queue import Empty, SimpleQueue
from tempfile import TemporaryDirectory
from typing import Any, Protocol, cast
from uuid import uuid4

import distributed
from distributed import Status, WorkerPlugin, get_worker
from distributed.exceptions import WorkerStartTimeoutError
from distributed.protocol import pickle
from distributed.scheduler import KilledWorker
from distributed.versions import VersionMismatchWarning
from distributed.worker import WORKER_ANY_RUNNING, Worker

from swarmwire.comms.base.clock import WallClock, to_ns
from swarmwire.comms.base.errors import BadInput, SwarmwireError
from swarmwire.comms.base.kernel_archive import read_archive, write_archive
from swarmwire.comms.base.printable import LINES, printable
from swarmwire.deploy.campaigns.schedule import OPTION, Finished
from swarmwire.deploy.campaigns.worker import MAX_SILENCE_S, Task, TaskResult, run_task
from swarmwire.deploy.runs.record import provenance
from swarmwire.deploy.runs.record.provenance import module_digests
from swarmwire.metrics.records.campaign.campaign_json import read_campaign
from swarmwire.metrics.records.run_folder.layout import SCENARIO

SCHEME = "dask://"
DEFAULT_PORT = 8786  # the dask scheduler's
CONNECT_S = 10.0
CLOSE_S = 5.0
NO_WORKER_S = 60.0  # longest time without a fitting worker
PREPARE_S = 120.0  # timeout of the answers of all workers, which import swarmwire first
KERNELS = "kernels.zip"  # among the files of a worker
POLL_S = 5.0  # time between two polls of the workers
MAX_MUTE_POLLS = 12  # consecutive polls without an answer, two minutes, after which the scheduler counts as lost
Report = Callable[[str], None]


class ClusterFailed(SwarmwireError):
    """A cluster is out of reach, has gone away, has no workers, or its workers cannot work."""


class Client(Protocol):
    """The used part of `distributed.Client`, which has no types."""

    status: str  # "running" while it is connected
    scheduler: Any
    run: Callable[..., Any]
    run_on_scheduler: Callable[..., Any]
    nthreads: Callable[..., Mapping[str, int]]
    subscribe_topic: Callable[..., None]
    submit: Callable[..., Any]
    sync: Callable[..., Any]
    wait_for_workers: Callable[..., None]
    close: Callable[..., None]


class DaskExecutor:
    """The fitting workers of a dask cluster, also those that come later."""

    records = False

    def __init__(
        self,
        name: str,
        workers: int | None,
        scenario: Path,
        *,
        report: Report | None = None,
        connect_s: float = CONNECT_S,
        no_worker_s: float = NO_WORKER_S,
    ) -> None:
        """Connect, and check the present workers; at most `workers` tasks are executed at a time.

        BadInput for an address of another form or workers of other versions, ClusterFailed if the scheduler is out of
        reach or no worker comes in time.
        """
        self._name, self._limit, self._scenario = name, workers, scenario
        self._report, self._clock, self._no_worker_ns = report or print_line, WallClock(), to_ns(no_worker_s)
        self._campaign = f"swarmwire-{uuid4().hex}"  # name of the plugin, the resource and the topic of events
        self._tasks: dict[str, Task] = {}  # submitted tasks by dask's key
        self._futures = SimpleQueue[Any]()  # filled by callbacks, since as_completed has no timeout
        self._begun, self._mute_polls = False, 0
        self._polled_ns = self._worked_ns = self._clock.now_ns()
        with ExitStack() as stack:
            stack.enter_context(_quiet_client())
            self._client = _connected(name, connect_s)
            stack.callback(self._leave)
            self._workers = self._checked_workers(no_worker_s)
            self._open = stack.pop_all()

    @property
    def slots(self) -> int:
        """One per worker: dask blames a worker's death on all its assigned tasks, also those that have not begun."""
        return min(self._workers, self._limit or self._workers)

    def submit(self, task: Task) -> None:
        """Submit a task to dask."""
        if not self._begun:
            self._begin()
        key = f"{self._campaign}-{uuid4().hex}"
        self._tasks[key] = task
        future = self._client.submit(work, task, self._campaign, key=key, resources={self._campaign: 1})
        future.add_done_callback(self._futures.put)

    def finished(self, timeout_s: float) -> list[Finished]:
        """Return the tasks that have ended; ClusterFailed if the cluster, or all its workers, are gone for good."""
        ended: list[Finished] = []
        with suppress(Empty):
            future = self._futures.get(timeout=timeout_s)
            while True:
                ended.append(self._result(future))
                future = self._futures.get_nowait()
        if not ended:
            self._poll()
        return ended

    def close(self) -> None:
        """Cancel submitted tasks, and remove the plugin from the cluster."""
        self._open.close()

    def _leave(self) -> None:
        if self._begun:
            with suppress(TimeoutError, OSError, RuntimeError):  # the scheduler is gone, or mute
                call = self._client.scheduler.unregister_worker_plugin
                self._client.sync(call, name=self._campaign, callback_timeout=CLOSE_S)
        with suppress(TimeoutError):
            self._client.close(timeout=CLOSE_S)  # this also cancels its tasks

    def _begin(self) -> None:
        """Prepare all workers; called with the first task, since the files do not exist before."""
        modules = tuple(read_campaign(self._scenario.parent).modules)
        self._begun = True
        plugin: bytes = cast(Any, pickle).dumps(
            Preparation(self._campaign, environment(modules), _files(self._scenario) | _kernels())
        )
        call = self._client.scheduler.register_worker_plugin  # `Client.register_plugin` has no time limit
        try:
            answers: dict[str, Any] = self._client.sync(
                call, plugin=plugin, name=self._campaign, idempotent=False, callback_timeout=PREPARE_S
            )
        except (TimeoutError, OSError):
            raise self._failed("the scheduler does not answer") from None
        for worker, answer in answers.items():
            if answer["status"] == "error":
                raise self._failed(f"worker {worker}: {answer['exception_text']}")
        self._client.subscribe_topic(self._campaign, self._worker_came)

    def _worker_came(self, event: tuple[float, Mapping[str, str]]) -> None:
        """Report a worker that came later and does not fit."""
        _, message = event
        if message["fault"]:
            self._report(f"left out: worker {message['worker']}: {message['fault']}")

    def _result(self, future: Any) -> Finished:
        task = self._tasks.pop(future.key)
        if future.status == "finished":
            return Finished(task, cast("TaskResult", future.result()))
        if future.status != "error":
            raise self._failed("the scheduler has gone away, or was restarted")
        error = future.exception()
        if isinstance(error, KilledWorker):
            return Finished(task, None, "the worker died")
        raise self._failed(f"{type(error).__name__}: {error}")

    def _poll(self) -> None:
        """Raise ClusterFailed if no result can come; dask waits forever for a mute scheduler, or for workers."""
        if self._client.status != "running":
            raise self._failed("the scheduler has gone away")
        now_ns = self._clock.now_ns()
        if now_ns - self._polled_ns <= to_ns(POLL_S):
            return
        self._polled_ns = now_ns
        try:
            identity = self._client.sync(self._client.scheduler.identity, n_workers=-1, callback_timeout=POLL_S)
        except (TimeoutError, OSError):
            self._mute_polls += 1
            if self._mute_polls >= MAX_MUTE_POLLS:
                raise self._failed("the scheduler does not answer") from None
            return
        workers = identity["workers"].values()
        self._workers = sum(not self._begun or self._campaign in worker["resources"] for worker in workers)
        self._mute_polls = 0
        if self._workers:
            self._worked_ns = now_ns
        elif now_ns - self._worked_ns > self._no_worker_ns:
            raise self._failed("no worker is left")

    def _failed(self, cause: str) -> ClusterFailed:
        resume = f"--resume {self._scenario.parent}, here or --executor local"
        return ClusterFailed(f"{self._name}: {cause}; finished runs are kept: {resume}")

    def _checked_workers(self, no_worker_s: float) -> int:
        """Return the number of workers that are present, or come in time; BadInput if one does not fit."""
        try:
            self._client.run_on_scheduler(environment)
            if not self._client.nthreads():
                self._report(f"{self._name}: no worker is there; waiting {no_worker_s:g} s for one")
                self._client.wait_for_workers(1, timeout=no_worker_s)
            environments: dict[str, Any] = self._client.run(environment, on_error="return")
        except WorkerStartTimeoutError:
            expected = f"no worker came within {no_worker_s:g} s: dask worker HOST:PORT"
            raise ClusterFailed(f"{self._name}: {expected}") from None
        except ImportError as error:
            fault = "the scheduler lacks this swarmwire, or its extra cluster"
            raise ClusterFailed(f"{self._name}: {fault}: {error}") from error
        fit = 0
        for worker, answer in environments.items():
            if isinstance(answer, OSError):
                continue  # the worker has gone away meanwhile
            if isinstance(answer, Exception):
                raise ClusterFailed(f"worker {worker} lacks this swarmwire, or its extra cluster: {answer}")
            fault = fault_of(environment(), answer)
            if fault:
                raise BadInput(OPTION, self._name, f"expected workers like this machine; worker {worker}: {fault}")
            fit += 1
        return fit


def address_of(name: str) -> str:
    """Return HOST:PORT of `dask://HOST:PORT`, with the default port if it is missing; BadInput for another form."""
    match = re.fullmatch(SCHEME + r"([^\s:/]+|\[[0-9a-fA-F:]+\])(?::(\d{1,5}))?/?", name)
    if match is None or int(match[2] or 0) >= 2**16:
        raise BadInput(OPTION, "", f"expected {SCHEME}HOST:PORT of a dask scheduler, got {name!r}")
    return f"{match[1]}:{match[2] or DEFAULT_PORT}"


def print_line(text: str) -> None:
    """Print to stderr; a terminal that is gone must not end a campaign."""
    with suppress(OSError, ValueError):
        print(printable(text, keep=LINES), file=sys.stderr, flush=True)


def _connected(name: str, timeout_s: float) -> Client:
    address = address_of(name)
    try:
        with warnings.catch_warnings():
            # `fault_of` compares the versions of the packages that matter.
            warnings.simplefilter("ignore", VersionMismatchWarning)
            client = distributed.Client(address, timeout=timeout_s, set_as_default=False, direct_to_workers=False)
    except (OSError, ImportError) as error:
        raise ClusterFailed(f"{name}: the scheduler is out of reach: {error}") from error
    return cast("Client", client)


@contextmanager
def _quiet_client() -> Generator[None]:
    """Keep dask from printing lost connections with tracebacks, since ClusterFailed reports them in one line."""
    loggers = [logging.getLogger(name) for name in ("distributed.client", "distributed.batched")]
    before = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, before, strict=True):
            logger.setLevel(level)


def _files(folder: Path) -> dict[str, bytes]:
    """Return the contents of the files in a campaign's scenario folder, by relative path."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def _kernels() -> dict[str, bytes]:
    """Return an archive of the functions that `swarmwire kernels build` has compiled here; empty if it has not."""
    with TemporaryDirectory() as folder:
        archive = Path(folder, KERNELS)
        return {KERNELS: archive.read_bytes()} if write_archive(archive) else {}


@cache  # imported code does not change if its files are replaced
def environment(modules: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return versions and digests of the code of this process: of these modules, by default of swarmwire's."""
    digests = module_digests([f"{module}:" for module in modules])
    return {"versions": provenance.versions(), "modules": digests}


def fault_of(expected: Mapping[str, Any], actual: Mapping[str, Any]) -> str:
    """Return the first difference of a worker's environment from the campaign's, or ""."""
    for name, version in expected["versions"].items():
        if actual["versions"].get(name) != version:
            return f"{name} is {actual['versions'].get(name, 'not there')}; here it is {version}"
    modules = expected["modules"]
    other = next((name for name, digest in modules.items() if actual["modules"].get(name) != digest), None)
    return f"its module {other} is another version than here" if other else ""


class Preparation(WorkerPlugin):
    """Prepares each worker of a cluster for one campaign."""

    def __init__(self, campaign: str, expected: Mapping[str, Any], files: Mapping[str, bytes]) -> None:
        self.name, self._expected, self._files = campaign, expected, files
        self.scenario = ""  # path of the scenario's file on a worker

    async def setup(self, worker: Worker) -> None:
        """Write the files and add the resource, or raise if the worker does not fit."""
        actual = await asyncio.to_thread(environment, tuple(self._expected["modules"]))
        fault = fault_of(self._expected, actual)
        worker.log_event(self.name, {"worker": worker.address, "fault": fault})
        if fault:
            raise ClusterFailed(f"worker {worker.address}: {fault}")
        folder = Path(worker.local_directory) / self.name
        for name, data in self._files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
        if KERNELS in self._files:
            with suppress(BadInput):  # an older processor, since versions and code are equal: it compiles for itself
                await asyncio.to_thread(read_archive, folder / KERNELS)
        self.scenario = str(folder / SCENARIO)
        await worker.set_resources(**{self.name: 1})
        if worker.status == Status.running:  # dask assigns waiting tasks when a worker's status becomes running
            worker.status = Status.paused
            worker.status = Status.running

    async def teardown(self, worker: Worker) -> None:
        """Remove the resource and the files."""
        await worker.set_resources(**{self.name: 0})
        shutil.rmtree(Path(worker.local_directory) / self.name, ignore_errors=True)


def work(task: Task, campaign: str) -> TaskResult:
    """Execute a task on a worker. A run that stands still ends the worker's process, which dask and its nanny see."""
    worker = get_worker()
    key = worker.get_current_task()

    def is_needed() -> bool:
        """Return True unless the task was cancelled, or the campaign or the scheduler has died."""
        faulthandler.dump_traceback_later(MAX_SILENCE_S, exit=True)
        state = worker.state.tasks.get(key)
        return worker.status in WORKER_ANY_RUNNING and state is not None and state.state != "cancelled"

    is_needed()
    try:
        scenario = cast("Preparation", worker.plugins[campaign]).scenario
        return run_task(replace(task, scenario=scenario), str(worker.name), is_needed)
    finally:
        faulthandler.cancel_dump_traceback_later()
