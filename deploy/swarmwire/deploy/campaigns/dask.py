"""`--executor dask://HOST:PORT`: the workers of a dask cluster do a campaign's tasks. Needs the extra `cluster`.

Dask's own means do the work. Its scheduler gives tasks to workers, and gives those of a dead worker to others, as often
as its `allowed-failures` says; nannies replace dead workers. A worker plugin, which later workers get as well, checks
code and versions, brings the scenario's files, and adds a resource that tasks need. So a worker that does not fit gets
no task, and one that does has one at a time, in a process that runs nothing else.
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
from typing import Any, Protocol, cast
from uuid import uuid4

import distributed
from distributed import Status, WorkerPlugin, get_worker
from distributed.exceptions import WorkerStartTimeoutError
from distributed.protocol import pickle
from distributed.scheduler import KilledWorker
from distributed.versions import VersionMismatchWarning
from distributed.worker import WORKER_ANY_RUNNING, Worker

from swarmwire.comms.base.clock import Clock, WallClock, to_ns
from swarmwire.comms.base.errors import BadInput, SwarmwireError
from swarmwire.comms.base.printable import LINES, printable
from swarmwire.deploy.campaigns.schedule import OPTION, Finished
from swarmwire.deploy.campaigns.worker import MAX_SILENCE_S, Task, TaskResult, run_task
from swarmwire.deploy.runs.record import provenance
from swarmwire.deploy.runs.record.provenance import module_digests
from swarmwire.metrics.records.campaign.campaign_json import read_campaign
from swarmwire.metrics.records.run_folder.layout import SCENARIO

SCHEME = "dask://"
DEFAULT_PORT = 8786  # of a dask scheduler
CONNECT_S = 10.0
CLOSE_S = 5.0
NO_WORKER_S = 60.0  # without a single worker that fits, at the beginning and in between
PREPARE_S = 120.0  # for the answers of all workers, which import swarmwire first
POLL_S = 5.0  # between two looks at the workers
MUTE_POLLS = 12  # in a row without an answer: with the time between them two minutes, and the scheduler is given up
Say = Callable[[str], None]


class ClusterFailed(SwarmwireError):
    """A cluster is out of reach, has gone away, has no workers, or its workers cannot work."""


class Client(Protocol):
    """What we use of `distributed.Client`, which has no types."""

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
    """The workers of a dask cluster that fit a campaign, also those that come later."""

    records = False

    def __init__(
        self,
        name: str,
        workers: int | None,
        scenario: Path,
        *,
        say: Say | None = None,
        clock: Clock | None = None,
        connect_s: float = CONNECT_S,
        no_worker_s: float = NO_WORKER_S,
    ) -> None:
        """Connect, and check the workers that are there; `workers` tasks at most are done at a time.

        BadInput for an address of another form or workers of other versions, ClusterFailed if the scheduler is out of
        reach or no worker comes in time.
        """
        self._name, self._limit, self._scenario = name, workers, scenario
        self._say, self._clock, self._no_worker_ns = say or print_line, clock or WallClock(), to_ns(no_worker_s)
        self._campaign = f"swarmwire-{uuid4().hex}"  # of the plugin, the resource and the topic of events
        self._tasks: dict[str, Task] = {}  # under way, by dask's key
        self._futures = SimpleQueue[Any]()  # as_completed cannot wait for a limited time; callbacks fill a queue
        self._begun, self._mute_polls, self._cpus = False, 0, {provenance.cpu()}
        self._polled_ns = self._worked_ns = self._clock.now_ns()
        with ExitStack() as stack:
            stack.enter_context(_quiet_client())
            self._client = _connected(name, connect_s)
            stack.callback(self._leave)
            self._workers = self._checked_workers(no_worker_s)
            self._open = stack.pop_all()

    @property
    def slots(self) -> int:
        """One for each worker: dask blames a worker's death on all tasks that it was given, also those that wait."""
        return min(self._workers, self._limit or self._workers)

    def submit(self, task: Task) -> None:
        """Give a task to dask."""
        if not self._begun:
            self._begin()
        key = f"{self._campaign}-{uuid4().hex}"
        self._tasks[key] = task
        future = self._client.submit(work, task, self._campaign, key=key, resources={self._campaign: 1})
        future.add_done_callback(self._futures.put)

    def finished(self, timeout_s: float) -> list[Finished]:
        """Tasks that are over; ClusterFailed if the cluster is gone, or its workers are and stay so."""
        found: list[Finished] = []
        with suppress(Empty):
            future = self._futures.get(timeout=timeout_s)
            while True:
                found.append(self._result(future))
                future = self._futures.get_nowait()
        if not found:
            self._poll()
        return found

    def close(self) -> None:
        """Cancel what is under way, and leave the cluster as it was."""
        self._open.close()

    def _leave(self) -> None:
        if self._begun:
            with suppress(TimeoutError, OSError, RuntimeError):  # the scheduler is gone, or mute
                call = self._client.scheduler.unregister_worker_plugin
                self._client.sync(call, name=self._campaign, callback_timeout=CLOSE_S)
        with suppress(TimeoutError):
            self._client.close(timeout=CLOSE_S)  # its tasks are cancelled with it

    def _begin(self) -> None:
        """Prepare all workers; there are no files, and no campaign.json, before the first task."""
        modules = tuple(read_campaign(self._scenario.parent).modules)
        self._begun = True
        plugin: bytes = cast(Any, pickle).dumps(
            Preparation(self._campaign, environment(modules), _files(self._scenario))
        )
        call = self._client.scheduler.register_worker_plugin  # `Client.register_plugin` has no time limit
        try:
            found: dict[str, Any] = self._client.sync(
                call, plugin=plugin, name=self._campaign, idempotent=False, callback_timeout=PREPARE_S
            )
        except (TimeoutError, OSError):
            raise self._failed("the scheduler does not answer") from None
        for worker, answer in found.items():
            if answer["status"] == "error":
                raise self._failed(f"worker {worker}: {answer['exception_text']}")
        self._client.subscribe_topic(self._campaign, self._worker_came)

    def _worker_came(self, event: tuple[float, Mapping[str, str]]) -> None:
        """Report a worker that came later and does not fit, and another type of CPU."""
        _, message = event
        if message["fault"]:
            self._say(f"left out: worker {message['worker']}: {message['fault']}")
        else:
            self._warn_of_cpu(message["worker"], message["cpu"])

    def _warn_of_cpu(self, worker: str, cpu: str) -> None:
        if cpu not in self._cpus:
            self._cpus.add(cpu)
            same = "runs are the same bit for bit on one type of CPU alone (machine_cpu says)"
            self._say(f"worker {worker} has another CPU: {cpu}: {same}")

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
        """ClusterFailed if nothing more will come. Dask itself waits for ever for a mute scheduler, or for workers."""
        if self._client.status != "running":
            raise self._failed("the scheduler has gone away")
        now_ns = self._clock.now_ns()
        if now_ns - self._polled_ns <= to_ns(POLL_S):
            return
        self._polled_ns = now_ns
        try:
            found = self._client.sync(self._client.scheduler.identity, n_workers=-1, callback_timeout=POLL_S)
        except (TimeoutError, OSError):
            self._mute_polls += 1
            if self._mute_polls >= MUTE_POLLS:
                raise self._failed("the scheduler does not answer") from None
            return
        workers = found["workers"].values()
        self._workers = sum(not self._begun or self._campaign in worker["resources"] for worker in workers)
        self._mute_polls = 0
        if self._workers:
            self._worked_ns = now_ns
        elif now_ns - self._worked_ns > self._no_worker_ns:
            raise self._failed("no worker is left")

    def _failed(self, why: str) -> ClusterFailed:
        resume = f"--resume {self._scenario.parent}, here or --executor local"
        return ClusterFailed(f"{self._name}: {why}; finished runs are kept: {resume}")

    def _checked_workers(self, no_worker_s: float) -> int:
        """The number of workers that are there, or come in time; BadInput if one does not fit."""
        try:
            self._client.run_on_scheduler(environment)
            if not self._client.nthreads():
                self._say(f"{self._name}: no worker is there; waiting {no_worker_s:g} s for one")
                self._client.wait_for_workers(1, timeout=no_worker_s)
            found: dict[str, Any] = self._client.run(environment, on_error="return")
        except WorkerStartTimeoutError:
            expected = f"no worker came within {no_worker_s:g} s: dask worker HOST:PORT"
            raise ClusterFailed(f"{self._name}: {expected}") from None
        except ImportError as error:
            lacks = "the scheduler lacks this swarmwire, or its extra cluster"
            raise ClusterFailed(f"{self._name}: {lacks}: {error}") from error
        here, fit = environment(), 0
        for worker, there in found.items():
            if isinstance(there, OSError):
                continue  # it has gone away meanwhile
            if isinstance(there, Exception):
                raise ClusterFailed(f"worker {worker} lacks this swarmwire, or its extra cluster: {there}")
            fault = fault_of(here, there)
            if fault:
                raise BadInput(OPTION, self._name, f"expected workers like this machine; worker {worker}: {fault}")
            self._warn_of_cpu(worker, there["cpu"])
            fit += 1
        return fit


def address_of(name: str) -> str:
    """HOST:PORT of `dask://HOST:PORT`, where the port may be left out; BadInput if it has another form."""
    found = re.fullmatch(SCHEME + r"([^\s:/]+|\[[0-9a-fA-F:]+\])(?::(\d{1,5}))?/?", name)
    if found is None or int(found[2] or 0) >= 2**16:
        raise BadInput(OPTION, "", f"expected {SCHEME}HOST:PORT of a dask scheduler, got {name!r}")
    return f"{found[1]}:{found[2] or DEFAULT_PORT}"


def print_line(text: str) -> None:
    """Print to stderr; a terminal that is gone must not end a campaign."""
    with suppress(OSError, ValueError):
        print(printable(text, keep=LINES), file=sys.stderr, flush=True)


def _connected(name: str, timeout_s: float) -> Client:
    address = address_of(name)
    try:
        with warnings.catch_warnings():
            # We compare versions ourselves, of the packages that matter.
            warnings.simplefilter("ignore", VersionMismatchWarning)
            found = distributed.Client(address, timeout=timeout_s, set_as_default=False, direct_to_workers=False)
    except (OSError, ImportError) as error:
        raise ClusterFailed(f"{name}: the scheduler is out of reach: {error}") from error
    return cast("Client", found)


@contextmanager
def _quiet_client() -> Generator[None]:
    """Keep dask from printing lost connections with tracebacks: we raise one line."""
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
    """By path within a campaign's scenario folder: the files' contents."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


@cache  # a worker keeps the code that it has imported, also where the files are replaced
def environment(modules: tuple[str, ...] = ()) -> dict[str, Any]:
    """Versions, CPU and digests of the code of this process: of these modules, else of swarmwire's."""
    digests = module_digests([f"{module}:" for module in modules])
    return {"versions": provenance.versions(), "cpu": provenance.cpu(), "modules": digests}


def fault_of(here: Mapping[str, Any], there: Mapping[str, Any]) -> str:
    """The first difference between the environments of campaign and worker; "" if they fit; CPUs may differ."""
    for name, version in here["versions"].items():
        if there["versions"].get(name) != version:
            return f"{name} is {there['versions'].get(name, 'not there')}; here it is {version}"
    other = next((name for name, of in here["modules"].items() if there["modules"].get(name) != of), None)
    return f"its module {other} is another version than here" if other else ""


class Preparation(WorkerPlugin):
    """Prepares each worker of a cluster for one campaign."""

    def __init__(self, campaign: str, here: Mapping[str, Any], files: Mapping[str, bytes]) -> None:
        self.name, self._here, self._files = campaign, here, files
        self.scenario = ""  # on a worker: path of the scenario's file

    async def setup(self, worker: Worker) -> None:
        """Write the files and add the resource, or raise if the worker does not fit."""
        there = await asyncio.to_thread(environment, tuple(self._here["modules"]))
        fault = fault_of(self._here, there)
        worker.log_event(self.name, {"worker": worker.address, "fault": fault, "cpu": there["cpu"]})
        if fault:
            raise ClusterFailed(f"worker {worker.address}: {fault}")
        folder = Path(worker.local_directory) / self.name
        for name, data in self._files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
        self.scenario = str(folder / SCENARIO)
        await worker.set_resources(**{self.name: 1})
        if worker.status == Status.running:  # dask tries tasks again that wait for a worker when one begins to run
            worker.status = Status.paused
            worker.status = Status.running

    async def teardown(self, worker: Worker) -> None:
        """The campaign is over."""
        await worker.set_resources(**{self.name: 0})
        shutil.rmtree(Path(worker.local_directory) / self.name, ignore_errors=True)


def work(task: Task, campaign: str) -> TaskResult:
    """Do a task on a worker. A run that stands still ends the worker's process, which dask sees, and its nanny."""
    worker = get_worker()
    key = worker.get_current_task()

    def wanted() -> bool:
        """Whether dask still waits for this: not after a cancellation, the campaign's death or the scheduler's."""
        faulthandler.dump_traceback_later(MAX_SILENCE_S, exit=True)
        state = worker.state.tasks.get(key)
        return worker.status in WORKER_ANY_RUNNING and state is not None and state.state != "cancelled"

    wanted()
    try:
        scenario = cast("Preparation", worker.plugins[campaign]).scenario
        return run_task(replace(task, scenario=scenario), str(worker.name), wanted)
    finally:
        faulthandler.cancel_dump_traceback_later()
