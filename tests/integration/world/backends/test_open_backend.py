"""A world that listens, over a real socket: what it offers, and who takes robots without ever playing them."""

import tempfile
from collections.abc import Iterator
from contextlib import closing

import pytest

from swarmwire.comms.clock import WallClock
from swarmwire.comms.wire.join import GroupInfo, JoinLimits, JoinRequest, SessionInfo
from swarmwire.comms.wire.keys import Keys
from swarmwire.comms.wire.sessions import closed_after, open_runner, unix_endpoint
from swarmwire.world.backends.join_policy import JoinPolicy
from swarmwire.world.backends.registry import RunnerEvent
from swarmwire.world.backends.zenoh_backend import BackendHooks, LockstepBackend
from tests.integration.world.backends.test_zenoh_backend import RUN
from tests.support.agent.hosts import assignment, group, spec
from tests.support.waiting import until

OFFER = SessionInfo(RUN, "s", "", "1", 10, None, (GroupInfo("flock", "a:B", "f" * 64, 3, ()),))


@pytest.fixture
def endpoint() -> Iterator[str]:
    with tempfile.TemporaryDirectory(prefix="sw-", dir="/tmp") as directory:
        yield unix_endpoint(f"{directory}/world")


class Told:
    """What a backend told, and what a test does upon it."""

    def __init__(self) -> None:
        self.changes: list[RunnerEvent] = []
        self.free: list[tuple[str, ...]] = []
        self.endpoints: tuple[str, ...] = ()

    def changed(self, change: RunnerEvent, free: tuple[str, ...]) -> None:
        self.changes.append(change)
        self.free.append(free)

    def opened(self, endpoints: tuple[str, ...]) -> None:
        self.endpoints = endpoints


def backend_at(endpoint: str, told: Told, limits: JoinLimits) -> LockstepBackend:
    whole = [assignment(group(spec("Counter"), [0, 1, 2]))]
    around = BackendHooks(changed=told.changed, opened=told.opened)
    return LockstepBackend(
        endpoint, RUN, whole, 20.0, WallClock(), around, "stand", policy=JoinPolicy(OFFER, True, limits=limits)
    )


def test_who_takes_robots_and_builds_no_agents_loses_them(endpoint: str) -> None:
    told, keys = Told(), Keys(RUN)
    with closing(backend_at(endpoint, told, JoinLimits(join_s=0.2))) as backend:
        backend.open()
        assert told.endpoints == (endpoint,)
        with closed_after(open_runner(endpoint)) as idler:
            asked = [
                idler.get(keys.session_info("idler")),
                idler.get(keys.join("idler"), payload=JoinRequest(names=("flock-1",)).encode()),
            ]
            until(lambda: (backend._take_in(), told.changes)[1])
            replies = [next(iter(replies)) for replies in asked]
    assert all(reply.ok is not None for reply in replies)
    session_info = SessionInfo.decode(replies[0].ok.payload.to_bytes()) if replies[0].ok else None
    assert session_info is not None
    assert session_info.groups[0].robots == 3
    reason = "its agents were not ready within 0.2 s"
    assert told.changes == [RunnerEvent("lost", "idler", ("flock-1",), -1, reason)]
    assert [sorted(free) for free in told.free] == [["flock-0", "flock-1", "flock-2"]]
