"""Whoever has another's certificate, or none, changes nothing in a run: what it tries fails, and is counted."""

# zenoh's stubs leave out the return type of put.
# pyright: reportUnknownMemberType=false

from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
import zenoh

from swarmwire.comms.clock import WallClock
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.join_request import JoinRequest
from swarmwire.comms.wire.keys import ObserverKeys
from swarmwire.comms.wire.limits import LIMITS
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.sessions import open_runner
from swarmwire.deploy import run
from swarmwire.deploy.certificates.certificate_folder import revoke
from tests.deploy.certificates.peers import at_once, wait_for_listeners
from tests.deploy.commands import LOSSY
from tests.deploy.machines.guarded_world import KEYS, SHORT, GuardedWorld, authority, guarded_world

BLOCK = zenoh.CongestionControl.BLOCK
AT_TICK = 3
FLOOD = 5000
SEEN = ObserverKeys("run1")


@pytest.fixture(scope="module")
def certs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = authority(tmp_path_factory.mktemp("lab") / "ca")
    revoke(folder, "gone", WallClock())
    return folder


@pytest.fixture(scope="module")
def undisturbed() -> list[str]:
    return list(run(LOSSY, overrides=SHORT).trajectory_sha256)


def standing(first: int, stop: int, tick: int) -> bytes:
    """An answer that stops these robots."""
    rows = np.arange(first, stop, dtype=np.int64)
    return frames.encode("actions", tick, {"rows": rows, "command": np.zeros((4, len(rows)))})


def forged(tick: int) -> list[bytes]:
    """Answers that would stop robots of one or the other runner, or the run, if they were taken for theirs."""
    failed = frames.encode("failed", tick, {}, {"robots": "all", "traceback": "lies"})
    return [standing(0, 10, tick), standing(10, 20, tick), failed]


def faults(counts: dict[str, int]) -> dict[str, int]:
    """What was counted of what came from runners."""
    return {name: count for name, count in counts.items() if count and not name.endswith("_commands")}


class Hostile:
    """A session that tries everything at one tick; `heard` is what it got hold of."""

    def __init__(self, world: GuardedWorld, name: str, opened: ExitStack) -> None:
        self.name, self._world, self._opened = name, world, opened
        self.heard: list[str] = []
        self._kept: list[object] = []

    def __call__(self, tick: int) -> None:
        if tick != AT_TICK:
            return
        session = self._opened.enter_context(self._world.session_of(self.name))
        self._spy(session)
        self._speak_for_others(session, tick)
        self._ask(session)
        self._flood(session)

    def _spy(self, session: zenoh.Session) -> None:
        """On frames to others, their answers, the truth."""
        for key in ("**", KEYS.frame("r0"), KEYS.any_answer, SEEN.truth):
            self._kept.append(session.declare_subscriber(key, at_once(self._hear)))

    def _be_asked(self, query: zenoh.Query) -> None:
        self.heard.append(f"asked {query.key_expr}")

    def _hear(self, sample: zenoh.Sample) -> None:
        if sample.attachment is None:  # what it puts itself, it hears, too
            self.heard.append(str(sample.key_expr))

    def _speak_for_others(self, session: zenoh.Session, tick: int) -> None:
        own = b"own"
        for payload in forged(tick):
            for key in (KEYS.answer("r0"), KEYS.answer("r1"), "swarmwire/*/answer/r0", KEYS.any_answer, "**"):
                session.put(key, payload, congestion_control=BLOCK, attachment=own)
        for name in ("r0", "r1"):
            end = frames.encode("end", -1, {})
            session.put(KEYS.frame(name), end, congestion_control=BLOCK, attachment=own)
            token = session.liveliness().declare_token(KEYS.alive(name))
            token.undeclare()
        self._kept.append(session.liveliness().declare_token(KEYS.world))

    def _ask(self, session: zenoh.Session) -> None:
        """In others' names, for others' robots, for control and truth: nobody answers; nor is it asked itself."""
        request = JoinRequest(names=("flock-0",)).encode()
        for key in (KEYS.join("r0"), KEYS.any_join, SEEN.control, SEEN.scene, SEEN.status):
            assert [reply for reply in session.get(key, payload=request, timeout=20.0) if reply.ok] == []
        for key in (KEYS.any_join, KEYS.any_offer, SEEN.control):  # only now: it would be asked by itself
            self._kept.append(session.declare_queryable(key, at_once(self._be_asked)))

    def _flood(self, session: zenoh.Session) -> None:
        payload = standing(0, 10, AT_TICK)
        for _ in range(FLOOD):
            session.put(KEYS.answer(self.name), payload, congestion_control=BLOCK, attachment=b"own")
        for size in (frames.MOST_BYTES + 1, LIMITS.link_bytes + 1):
            session.put(KEYS.answer(self.name), bytes(size), congestion_control=BLOCK, attachment=b"own")


@pytest.mark.parametrize("name", ["mallory", "robot-1", "gone"])
def test_another_members_certificate_gets_nowhere(certs, undisturbed, name):
    """An admitted runner without robots, a member of another network, and one that is revoked."""
    with ExitStack() as opened, guarded_world(certs) as world:
        hostile = Hostile(world, name, opened)
        world.finish(hostile)
        assert world.hashes == undisturbed
        assert hostile.heard == []
        arrived = faults(world.counts)
        if name != "mallory":
            assert arrived == {}
            return
        assert arrived.keys() == {"unknown_runner_frames", "flooded_frames"}
        assert sum(arrived.values()) == FLOOD + 1  # the one that no link takes is not seen here


def test_a_runner_that_plays_cannot_join_twice_nor_answer_for_others(certs, undisturbed):
    """The session has the name and the certificate of r1, which plays ten robots beside it."""

    def disturb(tick: int) -> None:
        if tick != AT_TICK:
            return
        session = opened.enter_context(world.session_of("r1"))
        wait_for_listeners(session, KEYS.answer("r1"))
        replies.append(session.get(KEYS.join("r1"), payload=JoinRequest().encode(), timeout=20.0))
        odd = standing(0, 20, tick), b"\xc1", standing(0, 10, tick + 9), frames.encode("dance", tick, {})
        for payload in odd:
            session.put(KEYS.answer("r1"), payload, congestion_control=BLOCK)

    replies: list[Iterable[zenoh.Reply]] = []
    with ExitStack() as opened, guarded_world(certs) as world:
        world.finish(disturb)
        refused = [reply.err.payload.to_string() for reply in replies[0] if reply.err]
        assert world.hashes == undisturbed
        assert len(refused) == 1
        assert "in use" in refused[0]
        counts = faults(world.counts)
        # An answer about too many robots is of the wrong tick once the runner's own has come.
        assert counts.pop("malformed_frames") + counts.pop("wrong_tick_frames") == 3
        assert counts == {"refused_join": 1, "unexpected_kind_frames": 1}


def test_no_certificate_of_this_ca_is_no_link(certs, undisturbed, tmp_path):
    others = authority(tmp_path / "other")
    foreign = Network(ca=certs / "ca.pem", certificate=others / "r0.pem", key=others / "r0.key")

    def disturb(tick: int) -> None:
        if tick == AT_TICK:
            with pytest.raises(zenoh.ZError):
                open_runner(world.endpoint, 0.3, foreign)
            with pytest.raises(zenoh.ZError):
                open_runner(world.endpoint.replace("tls/", "tcp/"), 0.3)

    with guarded_world(certs) as world:
        world.finish(disturb)
        assert world.hashes == undisturbed
        assert not faults(world.counts)
