"""`--on dask://HOST:PORT`: the workers of a dask cluster do a campaign's tasks.

Each worker's thread has one task at a time; as many again wait here, for whoever is free first. The scenario is sent to
each worker once. Needs the extra `cluster`.
"""

import sys
from contextlib import ExitStack, suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from uuid import uuid4

from swarmwire.comms.clock import Clock, WallClock, to_ns
from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.campaign import read_campaign
from swarmwire.deploy.campaign.cluster_failed import ClusterFailed
from swarmwire.deploy.campaign.dask_client import CLOSE_S, CONNECT_S, Client, Say, connected, first_cards, hushed
from swarmwire.deploy.campaign.dask_crew import DaskCrew, News
from swarmwire.deploy.campaign.dask_fitness import Fitness
from swarmwire.deploy.campaign.executor import Finished
from swarmwire.deploy.campaign.shipped import scenario_files
from swarmwire.deploy.campaign.task import Task
from swarmwire.deploy.record.modules import module_digests

TIMEOUT_S = 60.0  # without a single worker, at the begin and in between
POLL_S = 5.0  # between looks who is there, beside what dask tells
MUTE_LOOKS = 12  # in a row without an answer: with the time between them two minutes, and the scheduler is given up
AHEAD = 2  # tasks in hand for each thread: one that it is at, one that it can begin at once


class DaskExecutor:
    """The workers of a dask cluster that are fit for a campaign, also those that come later."""

    records = False

    def __init__(
        self,
        on: str,
        workers: int | None,
        scenario: Path,
        *,
        say: Say | None = None,
        clock: Clock | None = None,
        connect_s: float = CONNECT_S,
        patience_s: float = TIMEOUT_S,
    ) -> None:
        """Connect, and see who is there; `workers` threads at most do tasks.

        BadInput for an address of another form or workers of other versions, ClusterFailed if the scheduler is out of
        reach or no worker comes in time.
        """
        self._on, self._limit, self._scenario = on, workers, scenario
        self._say, self._clock, self._patience_ns = say or told, clock or WallClock(), to_ns(patience_s)
        self._news = SimpleQueue[News]()
        self._fault: ClusterFailed | None = None
        self._supplied, self._looked_ns = False, self._clock.now_ns()
        self._without_ns: int | None = None  # since when there has been no worker
        self._mute_looks = 0
        with ExitStack() as stack:
            stack.enter_context(hushed())
            self._client = connected(on, connect_s)
            stack.callback(_closed, self._client)
            self._backend = self._new_backend(patience_s)
            self._open = stack.pop_all()

    @property
    def slots(self) -> int:
        """Twice as many as threads work at tasks."""
        threads = sum(list(self._backend.threads.values()))
        return AHEAD * (threads if self._limit is None else min(threads, self._limit))

    def submit(self, task: Task) -> None:
        """Have a task done by whoever is free first."""
        if not self._supplied:
            self._supply()
        self._client.loop.add_callback(self._backend.take, task)

    def finished(self, timeout_s: float) -> list[Finished]:
        """What is over; ClusterFailed if the cluster is gone, or its workers are and stay so."""
        found: list[Finished] = []
        with suppress(Empty):
            news = self._news.get(timeout=timeout_s)
            while isinstance(news, Finished):
                found.append(news)
                news = self._news.get_nowait()
            self._fault = self._fault or news
        if not found:
            self._check()
        self._look_around()
        return found

    def close(self) -> None:
        """Cancel what is under way, and leave the cluster."""
        with suppress(TimeoutError, RuntimeError):  # its loop is closed where the scheduler has long been gone
            self._client.sync(self._backend.end, callback_timeout=CLOSE_S)
        self._open.close()

    def _new_backend(self, patience_s: float) -> DaskCrew:
        """All workers that are there, and from now on those that come."""
        fitness = Fitness()
        cards = first_cards(self._client, self._on, patience_s, self._say)
        for address, card in cards.items():
            fault, warning = fitness.fault(card), fitness.warning(card)
            if fault:
                raise BadInput("--on", self._on, f"expected workers like this machine; worker {address}: {fault}")
            if warning:
                self._say(f"worker {address} has {warning}")
        crew = DaskCrew(self._client, uuid4().hex, fitness, self._limit, self._news, self._say)
        crew.threads.update({address: card["threads"] for address, card in cards.items()})
        self._client.loop.add_callback(crew.begin, cards)
        self._client.subscribe_topic("all", crew.see)
        self._client.sync(crew.look_around)
        return crew

    def _supply(self) -> None:
        """Send the scenario's files, of which there are none before the first task."""
        code = [f"{module}:" for module in read_campaign(self._scenario.parent).modules]
        self._client.loop.add_callback(self._backend.supply, scenario_files(self._scenario), module_digests(code))
        self._supplied = True

    def _look_around(self) -> None:
        if self._clock.now_ns() - self._looked_ns > to_ns(POLL_S):
            try:
                self._client.sync(self._backend.look_around, callback_timeout=POLL_S)
                self._mute_looks = 0
            except (TimeoutError, OSError):  # then `_check` will know, or the next look
                self._mute_looks += 1
            self._looked_ns = self._clock.now_ns()

    def _check(self) -> None:
        """ClusterFailed if nothing more will come."""
        go_on = f"what is done stays: --resume {self._scenario.parent}, here or --on local"
        if self._fault is not None:
            raise ClusterFailed(f"{self._on}: {self._fault}; {go_on}")
        if self._client.status != "running":
            raise ClusterFailed(f"{self._on}: the scheduler has gone away; {go_on}")
        if self._mute_looks >= MUTE_LOOKS:
            raise ClusterFailed(f"{self._on}: the scheduler does not answer; {go_on}")
        now_ns = self._clock.now_ns()
        if self._backend.threads:
            self._without_ns = None
        elif self._without_ns is None:
            self._without_ns = now_ns
        elif now_ns - self._without_ns > self._patience_ns:
            raise ClusterFailed(f"{self._on}: no worker is there any more; {go_on}")


def told(text: str) -> None:
    """Tell people; a terminal that is gone must not end a campaign."""
    with suppress(OSError, ValueError):
        print(text, file=sys.stderr, flush=True)


def _closed(client: Client) -> None:
    with suppress(TimeoutError):
        client.close(timeout=CLOSE_S)
