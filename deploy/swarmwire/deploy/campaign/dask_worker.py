"""What a worker of a dask cluster does for a campaign: functions that its coordinator has called there.

Arguments and results are plain data. Each thread of the worker has its tasks done by a process of its own, so threads
share neither Python's lock nor users' modules, and a task that is cancelled ends at once.
"""

import asyncio
from functools import cache
from pathlib import Path
from typing import Any

import msgpack
from distributed import get_worker
from distributed.worker import WORKER_ANY_RUNNING, Worker

from swarmwire.deploy.campaign.shipped import unpacked
from swarmwire.deploy.campaign.spare_processes import CannotStart, SpareProcesses
from swarmwire.deploy.campaign.task import task_from
from swarmwire.deploy.record import machine
from swarmwire.deploy.record.modules import module_digests


async def about(dask_worker: Worker) -> dict[str, Any]:
    """What a worker is: versions and code, CPU, name, and how many tasks it does at a time."""
    code = await asyncio.to_thread(module_digests, ())
    return {
        "name": str(dask_worker.name),
        "threads": dask_worker.state.nthreads,
        "versions": machine.versions(),
        "cpu": machine.cpu(),
        "modules": code,
    }


def importable() -> None:
    """Nothing: whoever calls it where there is no swarmwire is told so."""


async def receive(files: bytes, modules: list[str], dask_worker: Worker) -> dict[str, Any]:
    """Take a campaign's scenario, in the worker's own folder; tells where, and of which code these modules are here."""
    within = Path(dask_worker.local_directory)  # dask takes it away, of a worker that was killed when another starts
    folder = await asyncio.to_thread(unpacked, msgpack.unpackb(files), within)
    code = await asyncio.to_thread(module_digests, [f"{module}:" for module in modules])
    return {"folder": str(folder), "modules": code}


def work(task: bytes, campaign: str) -> dict[str, Any]:
    """What came of a task: a result as a mapping, {"lost": how the process that was at it died} or {"cannot": why}."""
    worker = get_worker()
    key = worker.get_current_task()

    def wanted() -> bool:
        """Whether dask still waits for this: not after a cancellation, the coordinator's death or the scheduler's."""
        state = worker.state.tasks.get(key)
        return worker.status in WORKER_ANY_RUNNING and state is not None and state.state != "cancelled"

    try:
        return _processes().done(campaign, str(worker.name), task_from(msgpack.unpackb(task)), wanted)
    except CannotStart as error:
        return {"cannot": str(error)}


@cache
def _processes() -> SpareProcesses:
    return SpareProcesses()
