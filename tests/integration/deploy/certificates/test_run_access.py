"""Rights at the endpoints of a run, on real links with mutual TLS: each name does its own, and nothing of another's."""

import queue
from collections.abc import Generator
from contextlib import ExitStack
from pathlib import Path

import pytest
import zenoh

from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.wire.access_control import RunAccess, agents_access, observers_access, router_access
from swarmwire.comms.wire.keys import Keys, ObserverKeys
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.sessions import (
    closed_after,
    listens_at,
    open_observed,
    open_observer,
    open_router,
    open_runner,
    open_world,
)
from swarmwire.deploy.robots.certificates.folder import begin_authority, issue
from swarmwire.deploy.robots.certificates.member import network_in
from swarmwire.deploy.robots.certificates.register import certificate_request
from tests.support.clocks import until
from tests.support.deploy.certificates import WITHIN_S, at_once, wait_for_listeners

KEYS, SEEN = Keys("run1"), ObserverKeys("run1")
ACCESS = RunAccess(("a", "b", "gone"), ("wall",), ("alice",), ("gate", "gate2"), ("gone",))
NAMES = (*ACCESS.runners, *ACCESS.observers, *ACCESS.operators, *ACCESS.routers, *ACCESS.worlds, "robot-1")
LISTEN = "tls/127.0.0.1:0"
TIMEOUT_S = 60.0  # of links, so that a busy machine cuts none
BLOCK = zenoh.CongestionControl.BLOCK


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lab") / "ca"
    begin_authority(folder, WallClock())
    issue(folder, [certificate_request(name, ("127.0.0.1",)) for name in NAMES], 1, WallClock())
    return folder


@pytest.fixture(scope="module")
def strangers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Another CA, that has issued a certificate to the same name."""
    folder = tmp_path_factory.mktemp("other") / "ca"
    begin_authority(folder, WallClock())
    issue(folder, [certificate_request("a", ("127.0.0.1",))], 1, WallClock())
    return folder


@pytest.fixture
def opened() -> Generator[ExitStack]:
    """Whatever a test opens is closed after it, last first."""
    with ExitStack() as stack:
        yield stack


def as_name(folder: Path, name: str) -> Network:
    return network_in(folder, "", name)


class World:
    """The agents' endpoint of a world: it answers to session_info and join, and keeps what else it hears."""

    def __init__(self, folder: Path, opened: ExitStack) -> None:
        world = open_world(LISTEN, TIMEOUT_S, as_name(folder, "world"), agents_access(KEYS, ACCESS))
        self.session = opened.enter_context(closed_after(world))
        self.endpoint = listens_at(self.session)[0]
        self.received: queue.SimpleQueue[tuple[str, bytes]] = queue.SimpleQueue()
        self.queries: list[str] = []
        self.alive: list[str] = []
        for key in (KEYS.any_session_info, KEYS.any_join):
            self.session.declare_queryable(key, at_once(self._answer))
        self.session.declare_subscriber(KEYS.any_answer, at_once(self._hear))
        live = self.session.liveliness()
        live.declare_subscriber(KEYS.any_alive, at_once(lambda token: self.alive.append(str(token.key_expr))))
        self._token = live.declare_token(KEYS.world)

    def _answer(self, query: zenoh.Query) -> None:
        self.queries.append(str(query.key_expr))
        with query:
            query.reply(query.key_expr, b"yes")

    def _hear(self, sample: zenoh.Sample) -> None:
        self.received.put((str(sample.key_expr), sample.payload.to_bytes()))


@pytest.fixture
def world(folder: Path, opened: ExitStack) -> World:
    return World(folder, opened)


@pytest.fixture(params=[0, 2], ids=["direct", "two-routers"])
def endpoint(request: pytest.FixtureRequest, world: World, folder: Path, opened: ExitStack) -> str:
    """Where a runner calls: the world, or a router before it."""
    at = world.endpoint
    for name in ("gate", "gate2")[: request.param]:
        router = closed_after(open_router(LISTEN, at, as_name(folder, name), router_access(ACCESS)))
        at = listens_at(opened.enter_context(router))[0]
    return at


def runner(folder: Path, name: str, endpoint: str, opened: ExitStack) -> zenoh.Session:
    return opened.enter_context(closed_after(open_runner(endpoint, TIMEOUT_S, as_name(folder, name))))


def replies(session: zenoh.Session, key: str) -> list[bytes]:
    return [reply.ok.payload.to_bytes() for reply in session.get(key, payload=b"x", timeout=WITHIN_S) if reply.ok]


def test_runner_has_the_rights_of_its_own_robots_alone(folder, world, endpoint, opened):
    """What is refused is sent first on the same link, so it would have arrived before what is let through."""
    a = runner(folder, "a", endpoint, opened)
    until(lambda: [str(token.ok.key_expr) for token in a.liveliness().get("swarmwire/*/world") if token.ok])
    forged = (KEYS.answer("b"), KEYS.answer("*"), "swarmwire/*/answer/a", "**", KEYS.frame("a"), KEYS.alive("a"))
    wait_for_listeners(a, KEYS.answer("a"))
    for key in forged:
        a.put(key, b"forged", congestion_control=BLOCK)
    tokens = [a.liveliness().declare_token(key) for key in (KEYS.alive("b"), KEYS.world, KEYS.alive("a"))]
    until(lambda: world.alive)
    for key in (KEYS.join("b"), KEYS.session_info("b"), KEYS.join("*"), "swarmwire/**", KEYS.alive("b")):
        assert replies(a, key) == []
    assert replies(a, KEYS.session_info("a")) == replies(a, KEYS.join("a")) == [b"yes"]
    a.put(KEYS.answer("a"), b"own", congestion_control=BLOCK)
    assert world.received.get(timeout=WITHIN_S) == (KEYS.answer("a"), b"own")
    assert world.received.empty()
    assert world.queries == [KEYS.session_info("a"), KEYS.join("a")]
    assert world.alive == [KEYS.alive("a")]
    del tokens


def test_runner_neither_reads_frames_of_others_nor_acts_as_world(folder, world, endpoint, opened):
    a, b = (runner(folder, name, endpoint, opened) for name in "ab")
    spied, frames = list[bytes](), queue.SimpleQueue[bytes]()
    for key in ("**", KEYS.frame("a"), KEYS.any_answer, "@/**"):
        b.declare_subscriber(key, at_once(lambda sample: spied.append(sample.payload.to_bytes())))
    b.declare_queryable(KEYS.any_join, lambda query: query.reply(query.key_expr, b"forged"))
    for session, name in ((a, "a"), (b, "b")):
        session.declare_subscriber(KEYS.frame(name), at_once(lambda sample: frames.put(sample.payload.to_bytes())))
        wait_for_listeners(world.session, KEYS.frame(name))
    wait_for_listeners(a, KEYS.answer("a"))
    a.put(KEYS.answer("a"), b"of a", congestion_control=BLOCK)
    assert world.received.get(timeout=WITHIN_S) == (KEYS.answer("a"), b"of a")
    wait_for_listeners(b, KEYS.answer("b"))
    b.put(KEYS.frame("a"), b"forged", congestion_control=BLOCK)
    spied.clear()  # what it puts itself, it hears
    for name in "ab":
        world.session.put(KEYS.frame(name), name.encode(), congestion_control=BLOCK)
        assert frames.get(timeout=WITHIN_S) == name.encode()
    assert frames.empty()
    assert set(spied) <= {b"b"}
    assert replies(a, KEYS.join("a")) == [b"yes"]
    assert replies(b, f"@/{world.session.zid()}/**") == []


@pytest.mark.parametrize("name", ["gone", "robot-1", "wall", "alice"])
def test_revoked_member_has_a_link_without_rights(folder, world, name, opened):
    session = runner(folder, name, world.endpoint, opened)
    until(lambda: [link for link in world.session.info.links() if link.auth_identifier == name])
    for key in (KEYS.session_info(name), KEYS.join(name)):
        assert replies(session, key) == []
    assert [token for token in session.liveliness().get(KEYS.world) if token.ok] == []
    session.put(KEYS.answer(name), b"x", congestion_control=BLOCK)
    a = runner(folder, "a", world.endpoint, opened)
    wait_for_listeners(a, KEYS.answer("a"))
    a.put(KEYS.answer("a"), b"own", congestion_control=BLOCK)
    assert world.received.get(timeout=WITHIN_S) == (KEYS.answer("a"), b"own")
    assert not world.queries


def test_certificate_of_another_ca_gets_no_link(folder, strangers, world):
    foreign = as_name(strangers, "a")
    swapped = Network(ca=folder / "ca.pem", certificate=foreign.certificate, key=foreign.key)
    for network in (foreign, swapped):
        with pytest.raises(zenoh.ZError):
            open_runner(world.endpoint, 0.5, network)
    with pytest.raises(zenoh.ZError):
        open_runner(world.endpoint.replace("tls/", "tcp/"), 0.5)
    assert not world.session.info.links()


def observed(folder: Path, opened: ExitStack) -> zenoh.Session:
    """The observers' endpoint of a world."""
    world = open_observed(LISTEN, as_name(folder, "world"), observers_access(SEEN, ACCESS))
    return opened.enter_context(closed_after(world))


def test_observers_observe_and_operators_control(folder, opened):
    world = observed(folder, opened)
    for key in (SEEN.scene, SEEN.status, SEEN.control):
        world.declare_queryable(key, at_once(lambda query: query.reply(query.key_expr, b"yes")))
    token = world.liveliness().declare_token(SEEN.published)
    endpoint = listens_at(world)[0]
    may = {"wall": (SEEN.scene, SEEN.status), "alice": (SEEN.scene, SEEN.status, SEEN.control), "a": (), "gone": ()}
    for name, keys in may.items():
        session = opened.enter_context(closed_after(open_observer(endpoint, as_name(folder, name))))
        for key in (SEEN.scene, SEEN.status, SEEN.control):
            assert replies(session, key) == ([b"yes"] if key in keys else []), (name, key)
        assert bool([t for t in session.liveliness().get("swarmwire/*/published") if t.ok]) == bool(keys)
    del token


def test_observers_receive_the_truth(folder, opened):
    world = observed(folder, opened)
    endpoint = listens_at(world)[0]
    keys: queue.SimpleQueue[str] = queue.SimpleQueue()
    for name in ("a", "wall"):
        session = opened.enter_context(closed_after(open_observer(endpoint, as_name(folder, name))))
        session.declare_subscriber(SEEN.truth, at_once(lambda _, name=name: keys.put(name)))
    wait_for_listeners(world, SEEN.truth)
    world.put(SEEN.truth, b"glimpse", congestion_control=BLOCK)
    assert keys.get(timeout=WITHIN_S) == "wall"
    assert keys.empty()
