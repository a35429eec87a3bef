"""Runs on several machines."""

import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
import zenoh

from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.errors import RunnerLost
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.join import JoinRequest
from swarmwire.comms.wire.keys import Keys
from swarmwire.comms.wire.limits import LIMITS, MAX_BYTES
from swarmwire.deploy import run
from swarmwire.deploy.robots.certificates.folder import begin_authority, issue, revoke
from swarmwire.deploy.robots.certificates.register import certificate_request
from tests.support.deploy.certificates import at_once, wait_for_listeners
from tests.support.deploy.machines import AT_TICK, GuardedWorld, authority, machines, on
from tests.support.deploy.machines import SHORT as SHORT_RUN
from tests.support.deploy.runs import LOSSY

SHORT = "duration_s=3"
SETTINGS = ("duration_s=5000", "run.on_runner_loss=stand", "run.runner_timeout_s=3")
BLOCK = zenoh.CongestionControl.BLOCK
FLOOD = 5000
OWN = b"own"  # attached to what the hostile one says itself


def lab(folder: Path, addresses: Mapping[str, Sequence[str]], *runners: str) -> Path:
    """A CA, certificates of the world and of routers at their addresses, and of runners."""
    begin_authority(folder, WallClock())
    purposes = {"world": "world", **dict.fromkeys(runners, "runner")}
    names = [*addresses, *runners]
    requests = [certificate_request(name, addresses.get(name, ()), purposes.get(name, "router")) for name in names]
    issue(folder, requests, 1, WallClock())
    return folder


def summary(out: Path) -> dict[str, object]:
    return json.loads((out / "summary.json").read_text())


def test_machines_with_a_router_between_run_as_one_process_does(tmp_path):
    with machines(3) as (far, between, near):
        certs = lab(tmp_path / "ca", {"world": far.addresses, "gate": between.addresses}, "r1", "r2")
        at, through = (f"tls/{address}:7447" for address in (far.addresses[0], between.addresses[1]))
        out, options = tmp_path / "out", ("--certs", certs)
        with (
            on(between, "router", "--listen", through, "--connect", at, *options) as router,
            on(far, "world", LOSSY, "--set", SHORT, "--listen", at, "--out", out, "--no-rrd", *options) as world,
        ):
            router.next_line("linked with world")
            joined = [on(near, "join", through, "--robots", "10", "--name", name, *options) for name in ("r1", "r2")]
            with joined[0] as one, joined[1] as other:
                assert (world.ended(), one.ended(), other.ended()) == (0, 0, 0), (world.lines, one.lines, other.lines)
            assert router.stop() == 0
    alone = run(LOSSY, overrides=[SHORT])
    assert summary(out)["trajectory_sha256"] == list(alone.trajectory_sha256)
    assert {line for line in router.lines if "linked" in line} >= {"router: linked with r1", "router: linked with r2"}


def test_nobody_gets_past_a_machine_without_a_router(tmp_path):
    with machines(3) as (far, _, near):
        certs = lab(tmp_path / "ca", {"world": far.addresses}, "r1")
        at = f"tls/{far.addresses[0]}:7447"
        with on(far, "world", LOSSY, "--listen", at, "--out", tmp_path / "out", "--certs", certs) as world:
            world.next_line("listens at")
            with on(near, "join", at, "--name", "r1", "--certs", certs) as stray:
                assert stray.ended() != 0
            assert "no world answers" in stray.lines[-1]


@pytest.mark.slow  # the runner waits for ten seconds before it believes it
def test_runner_that_is_cut_off_is_reported_at_both_ends_and_may_return(tmp_path):
    settings = [word for setting in SETTINGS for word in ("--set", setting)]
    with machines(2) as (lab, laptop):
        at = f"tcp/{lab.addresses[0]}:7447"
        join = "join", at, "--insecure", "--name", "a"
        world = ("world", LOSSY, *settings, "--listen", at, "--insecure", "--out", tmp_path / "run")
        with on(lab, *world) as world:
            world.next_line("0 of 20 robots have agents")
            with on(laptop, *join) as cut:
                world.next_line("20 robots, 50000 ticks")
                cut.next_line("joined run")
                laptop.link("down")
                world.next_line("a was lost with flock-0", "no answer for 3 s")
                assert cut.ended() == 1
                assert cut.lines[-1] == "the world is gone, or out of reach"
            laptop.link("up")
            with on(laptop, *join) as back:
                world.next_line("a returned to flock-0")
                assert world.stop() == 130
                assert back.ended() == 0


# zenoh's stubs leave out the return type of put.
# pyright: reportUnknownMemberType=false


@pytest.fixture(scope="module")
def certs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = authority(tmp_path_factory.mktemp("lab") / "ca")
    revoke(folder, "gone", WallClock())
    return folder


@pytest.fixture(scope="module")
def undisturbed() -> list[str]:
    return list(run(LOSSY, overrides=SHORT_RUN).trajectory_sha256)


def standing(first: int, stop: int, tick: int) -> bytes:
    """An answer that stops these robots."""
    rows = np.arange(first, stop, dtype=np.int64)
    return frames.encode("actions", tick, {"rows": rows, "command": np.zeros((4, len(rows)))})


def forged(tick: int) -> list[bytes]:
    """Answers that would stop the robots of r0, or the run, or have r0 leave, if they were taken for r0's."""
    failed = frames.encode("failed", tick, {}, {"robots": "all", "traceback": "lies"})
    return [standing(0, 10, tick), failed, frames.encode("leave", -1, {})]


def faults(counts: dict[str, int]) -> dict[str, int]:
    """What was counted of what came from runners."""
    return {name: count for name, count in counts.items() if count and not name.endswith("_commands")}


class Hostile:
    """A session that tries everything at once; `received` is what it got hold of, then and later."""

    def __init__(self, name: str, opened: ExitStack) -> None:
        self.name, self._opened = name, opened
        self.received: list[str] = []
        self._entities: list[object] = []

    def __call__(self, world: GuardedWorld) -> None:
        session = self._opened.enter_context(world.session_of(self.name))
        self._spy(session, world)
        self._speak_for_others(session, world.keys)
        self._ask(session, world)
        self._flood(session, world.keys)
        observing = self._opened.enter_context(world.session_of(self.name, observing=True))
        self._spy(observing, world)
        self._ask(observing, world)

    def _spy(self, session: zenoh.Session, world: GuardedWorld) -> None:
        """On frames to others, their answers, the truth."""
        for key in ("**", world.keys.frame("r0"), world.keys.any_answer, world.seen.truth):
            self._entities.append(session.declare_subscriber(key, at_once(self._hear)))

    def _be_asked(self, query: zenoh.Query) -> None:
        self.received.append(f"asked {query.key_expr}")

    def _hear(self, sample: zenoh.Sample) -> None:
        if sample.attachment is None:  # what it puts itself, it hears, too
            self.received.append(str(sample.key_expr))

    def _speak_for_others(self, session: zenoh.Session, keys: Keys) -> None:
        for payload in forged(AT_TICK):
            for key in (keys.answer("r0"), keys.answer("r1"), "swarmwire/*/answer/r0", keys.any_answer, "**"):
                session.put(key, payload, congestion_control=BLOCK, attachment=OWN)
        for name in ("r0", "r1"):
            end = frames.encode("end", -1, {})
            session.put(keys.frame(name), end, congestion_control=BLOCK, attachment=OWN)
            token = session.liveliness().declare_token(keys.alive(name))
            token.undeclare()
        self._entities.append(session.liveliness().declare_token(keys.world))

    def _ask(self, session: zenoh.Session, world: GuardedWorld) -> None:
        """In others' names, for others' robots, for control and truth: nobody answers; nor is it asked itself."""
        request, keys, observer_keys = JoinRequest(names=("flock-0",)).encode(), world.keys, world.seen
        for key in (keys.join("r0"), keys.any_join, observer_keys.control, observer_keys.scene, observer_keys.status):
            replies = [reply for reply in session.get(key, payload=request, timeout=20.0) if reply.ok]
            assert replies == [], key
        for key in (keys.any_join, keys.any_session_info, observer_keys.control):  # now: it would be asked by itself
            self._entities.append(session.declare_queryable(key, at_once(self._be_asked)))

    def _flood(self, session: zenoh.Session, keys: Keys) -> None:
        payload = standing(0, 10, AT_TICK)
        for _ in range(FLOOD):
            session.put(keys.answer(self.name), payload, congestion_control=BLOCK, attachment=OWN)
        for size in (MAX_BYTES + 1, LIMITS.link_bytes + 1):
            session.put(keys.answer(self.name), bytes(size), congestion_control=BLOCK, attachment=OWN)


def test_admitted_runner_without_robots_gets_nowhere(certs, undisturbed, tmp_path):
    with ExitStack() as opened:
        hostile = Hostile("mallory", opened)
        result = GuardedWorld(certs, hostile).run(tmp_path / "run")
        assert list(result.trajectory_sha256) == undisturbed
        assert hostile.received == []
    arrived = faults(result.counts)
    assert arrived.keys() == {"unknown_runner_frames", "flooded_frames"}
    assert sum(arrived.values()) == FLOOD + 1  # the one that no link takes is not seen here


def flood(world: GuardedWorld, name: str, opened: ExitStack) -> None:
    """More of a name's messages than are dropped one by one."""
    session, own = opened.enter_context(world.session_of(name)), world.keys.answer(name)
    wait_for_listeners(session, own)
    for _ in range(4 * LIMITS.flood):
        session.put(own, b"x", congestion_control=BLOCK)


def test_runner_that_plays_and_floods_is_lost(certs, tmp_path):
    with ExitStack() as opened, pytest.raises(RunnerLost, match="far more than it was asked for"):
        GuardedWorld(certs, lambda world: flood(world, "r1", opened)).run(tmp_path / "run")


def test_runner_that_plays_can_neither_join_twice_nor_answer_for_others(certs, undisturbed, tmp_path):
    """The session has the name and the certificate of r1, which plays ten robots beside it."""

    def disturb(world: GuardedWorld) -> None:
        session, own = opened.enter_context(world.session_of("r1")), world.keys.answer("r1")
        wait_for_listeners(session, own)
        replies.append(session.get(world.keys.join("r1"), payload=JoinRequest().encode(), timeout=20.0))
        dance = frames.encode("dance", AT_TICK, {})
        for payload in (standing(0, 20, AT_TICK), b"\xc1", standing(0, 10, AT_TICK + 9), dance):
            session.put(own, payload, congestion_control=BLOCK)

    replies: list[Iterable[zenoh.Reply]] = []
    with ExitStack() as opened:
        result = GuardedWorld(certs, disturb).run(tmp_path / "run")
        refused = [reply.err.payload.to_string() for reply in replies[0] if reply.err]
    assert list(result.trajectory_sha256) == undisturbed
    assert len(refused) == 1
    assert "in use" in refused[0]
    counts = faults(result.counts)
    # An answer about too many robots is of the wrong tick once the runner's own has come.
    assert counts.pop("malformed_frames") + counts.pop("wrong_tick_frames") == 3
    assert counts == {"refused_join": 1, "unexpected_kind_frames": 1}
