"""The workers of a dask cluster at a campaign's tasks: who is there, who is fit for it, and who has which task.

A task goes to a thread of a worker that is free, by the worker's address: dask may not move it, nor try it again. So
one that is lost with its worker is known at once, and what waits is lost with nobody. All runs in the client's loop.
"""

import asyncio
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError
from dataclasses import replace
from pathlib import PurePosixPath
from queue import SimpleQueue
from typing import Any

import msgpack
from distributed.scheduler import KilledWorker

from swarmwire.deploy.campaign.cluster_failed import ClusterFailed
from swarmwire.deploy.campaign.dask_client import Card, Client, Say
from swarmwire.deploy.campaign.dask_fitness import Fitness, code_fault
from swarmwire.deploy.campaign.dask_worker import about, receive, work
from swarmwire.deploy.campaign.executor import Finished
from swarmwire.deploy.campaign.task import Task, result_from, task_message
from swarmwire.metrics.run_folder.layout import SCENARIO

NO_LIMIT = 2**31
News = Finished | ClusterFailed


class DaskCrew:
    """Workers that serve one campaign; `news` hears of each task that is over, and of what ends the campaign.

    Attributes:
        threads: by address of a worker that is fit: how many tasks it does at a time.
    """

    def __init__(
        self, client: Client, campaign: str, fitness: Fitness, limit: int | None, news: SimpleQueue[News], say: Say
    ) -> None:
        self._client, self._campaign, self._fitness, self._news, self._say = client, campaign, fitness, news, say
        self._tasks = asyncio.Queue[Task]()
        self._limit = asyncio.Semaphore(limit or NO_LIMIT)
        self._supplied = asyncio.Event()
        self._files, self._modules = b"", dict[str, str]()
        self._first: set[str] = set()
        self._serving: dict[str, asyncio.Task[None]] = {}
        self.threads: dict[str, int] = {}

    def begin(self, cards: Mapping[str, Card]) -> None:
        """Take in the workers that are there, as they were found fit; others when dask tells of them."""
        self._first.update(cards)
        for address, card in cards.items():
            self.threads[address] = card["threads"]
            self._join(address, card)

    async def look_around(self) -> None:
        """Ask who is there: dask tells nobody twice, nor before it was asked to."""
        if self._client.status != "running":
            return
        there = (await self._client.scheduler.identity(n_workers=-1))["workers"]
        for address in there:
            self._join(address)
        for address in set(self._serving) - set(there):
            self._leave(address)

    def see(self, event: tuple[float, Mapping[str, Any]]) -> None:
        """What dask tells of workers that come and go."""
        _, message = event
        if message.get("action") == "add-worker":
            self._join(message["worker"])
        elif message.get("action") == "remove-worker":
            self._leave(message["worker"])

    def supply(self, files: Mapping[str, bytes], modules: Mapping[str, str]) -> None:
        """With what workers are to work: the scenario's files, and digests of the code that its runs are made from."""
        self._files, self._modules = msgpack.packb(files), dict(modules)
        self._supplied.set()

    def take(self, task: Task) -> None:
        """Have a task done by whoever is free first."""
        self._tasks.put_nowait(task)

    async def end(self) -> None:
        """Let all go, whatever they are at."""
        serving = list(self._serving.values())
        self._serving.clear()
        for of in serving:
            of.cancel()
        await asyncio.gather(*serving, return_exceptions=True)

    def _join(self, address: str, card: Card | None = None) -> None:
        """Take in a worker, unless it is known; without a card it is asked for one."""
        if address not in self._serving:
            self._serving[address] = asyncio.create_task(self._serve(address, card))

    def _leave(self, address: str) -> None:
        self.threads.pop(address, None)
        serving = self._serving.pop(address, None)
        if serving is not None:
            serving.cancel()

    async def _serve(self, address: str, card: Card | None) -> None:
        """All that a worker does for the campaign, until it leaves."""
        try:
            if card is None:
                card = await self._admitted(address)
            await self._supplied.wait()
            told = await self._asked(address, receive, self._files, list(self._modules))
        except OSError:
            return  # it is about to leave
        except Exception as error:  # noqa: BLE001 - of whatever kind: it is on the worker, and ends its service alone
            self._unfit(address, str(error) or type(error).__name__)
            return
        fault = code_fault(self._modules, told["modules"])
        if fault:
            self._unfit(address, fault)
            return
        await asyncio.gather(*(self._thread(address, told["folder"]) for _ in range(card["threads"])))

    async def _admitted(self, address: str) -> Card:
        """The card of a worker that came later, whose threads count from now on; ClusterFailed if it is unfit."""
        card: Card = await self._asked(address, about)
        fault = self._fitness.fault(card)
        if fault:
            raise ClusterFailed(fault)
        warning = self._fitness.warning(card)
        if warning:
            self._say(f"worker {address} has {warning}")
        self.threads[address] = card["threads"]
        return card

    async def _asked(self, address: str, function: Callable[..., Any], *arguments: Any) -> dict[str, Any]:
        return (await self._client.run(function, *arguments, workers=[address]))[address]

    def _unfit(self, address: str, why: str) -> None:
        """A worker that was there when the campaign began ends it; one that came later is left out."""
        self.threads.pop(address, None)
        if address in self._first:
            self._news.put(ClusterFailed(f"worker {address}: {why}"))
        else:
            self._say(f"left out: worker {address}: {why}")

    async def _thread(self, address: str, folder: str) -> None:
        """A thread of a worker: a task, and the next."""
        while True:
            async with self._limit:
                task = await self._tasks.get()
                self._news.put(await self._done(task, address, folder))

    async def _done(self, task: Task, address: str, folder: str) -> News:
        """What came of a task on a worker, where the scenario lies in this folder."""
        there = replace(task, scenario=str(PurePosixPath(folder) / SCENARIO))
        future = self._client.submit(
            work, msgpack.packb(task_message(there)), self._campaign, workers=[address], retries=0, pure=False
        )
        try:
            message: dict[str, Any] = await future
        except asyncio.CancelledError:
            self._news.put(Finished(task, None, f"worker {address} is gone"))
            raise
        except CancelledError:
            return ClusterFailed("the scheduler has gone away, or was restarted")
        except KilledWorker:
            return Finished(task, None, f"worker {address} died")
        except Exception as error:  # noqa: BLE001 - run_task raises nothing: it is the worker, or dask
            return ClusterFailed(f"worker {address}: {type(error).__name__}: {error}")
        finally:
            future.release()
        if "cannot" in message:
            return ClusterFailed(f"worker {address}: {message['cannot']}")
        return Finished(task, None, message["lost"]) if "lost" in message else Finished(task, result_from(message))
