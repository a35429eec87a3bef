"""The way to the scheduler of a dask cluster, with a time limit, and who works there."""

import logging
import re
import warnings
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any, Protocol, cast

import distributed
from distributed.exceptions import WorkerStartTimeoutError
from distributed.versions import VersionMismatchWarning

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.cluster_failed import ClusterFailed
from swarmwire.deploy.campaign.dask_worker import about, importable

SCHEME = "dask://"
USUAL_PORT = 8786  # of a dask scheduler
CONNECT_S = 10.0
CLOSE_S = 5.0
Say = Callable[[str], None]
Card = dict[str, Any]  # what `dask_worker.about` tells


class Client(Protocol):
    """What we use of `distributed.Client`, which has no types."""

    status: str  # "running" while it is connected
    loop: Any
    scheduler: Any
    run: Callable[..., Any]
    run_on_scheduler: Callable[..., Any]
    scheduler_info: Callable[..., dict[str, Any]]
    submit: Callable[..., Any]
    subscribe_topic: Callable[..., None]
    sync: Callable[..., Any]
    wait_for_workers: Callable[..., None]
    close: Callable[..., None]


def address_of(on: str) -> str:
    """HOST:PORT of `dask://HOST:PORT`, where the port may be left out; BadInput if it has another form."""
    found = re.fullmatch(SCHEME + r"([^\s:/]+|\[[0-9a-fA-F:]+\])(?::(\d{1,5}))?/?", on)
    if found is None or int(found[2] or 0) >= 2**16:
        raise BadInput("--on", "", f"expected {SCHEME}HOST:PORT of a dask scheduler, got {on!r}")
    return f"{found[1]}:{found[2] or USUAL_PORT}"


def connected(on: str, timeout_s: float = CONNECT_S) -> Client:
    """A client of the scheduler; ClusterFailed if there is none in time. To be closed."""
    address = address_of(on)
    try:
        with warnings.catch_warnings():
            # That packages differ is told by us, of those that matter, in one line.
            warnings.simplefilter("ignore", VersionMismatchWarning)
            found = distributed.Client(address, timeout=timeout_s, set_as_default=False, direct_to_workers=False)
    except (OSError, ImportError) as error:
        raise ClusterFailed(f"{on}: the scheduler is out of reach: {error}") from error
    client = cast("Client", found)
    try:
        client.run_on_scheduler(importable)
    except ImportError as error:
        client.close(timeout=CLOSE_S)
        raise ClusterFailed(f"{on}: the scheduler lacks this swarmwire, or its extra cluster: {error}") from error
    return client


def present(client: Client) -> list[str]:
    """The addresses of all workers that are there."""
    return list(client.scheduler_info(n_workers=-1)["workers"])


def first_cards(client: Client, on: str, patience_s: float, say: Say) -> dict[str, Card]:
    """By address, what the workers are that are there, or come in time; ClusterFailed if none does, or one is mute."""
    if not present(client):
        say(f"{on}: no worker is there; waiting {patience_s:g} s for one")
        try:
            client.wait_for_workers(1, timeout=patience_s)
        except WorkerStartTimeoutError:
            raise ClusterFailed(f"{on}: no worker came within {patience_s:g} s: dask worker HOST:PORT") from None
    cards: dict[str, Any] = client.run(about, workers=present(client), on_error="return")
    for address, card in cards.items():
        if isinstance(card, Exception) and "No module named" in str(card):  # of whatever kind, as dask hands it on
            raise ClusterFailed(f"worker {address} lacks this swarmwire, or its extra cluster: {card}")
        if isinstance(card, Exception) and not isinstance(card, OSError):  # that one has gone away meanwhile
            raise ClusterFailed(f"worker {address}: {card}")
    there = {address: card for address, card in cards.items() if not isinstance(card, Exception)}
    if not there:
        raise ClusterFailed(f"{on}: its workers do not answer")
    return there


@contextmanager
def hushed() -> Generator[None]:
    """Keep dask's client from telling of lost connections, with tracebacks: we do, in one line."""
    logger = logging.getLogger("distributed.client")
    before = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        logger.setLevel(before)
