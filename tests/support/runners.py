"""Runners that misbehave, and the runs that they spoil."""

import queue
import threading
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import msgpack
import zenoh

from examples.protocol.runner import BROADCAST, VERSION, acted, frame, packed, unpacked
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Truth
from swarmwire.comms.wire.keys import Keys
from swarmwire.comms.wire.sessions import close_session, open_runner
from swarmwire.deploy.runs.config import JoinObserver, Listening
from swarmwire.deploy.runs.result import Result
from swarmwire.deploy.runs.simulation import Simulation, run_to_end
from swarmwire.world.backends.runner_reports import RunnerEvent
from tests.integration.examples.test_examples import EXAMPLES

# zenoh's stubs leave out some types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false


JOIN_S = 30.0
Arrays = dict[str, Any]
FAR = 2**62
TIMES = 50  # of what comes too often, and yet may all wait (64 may)
REQUEST = {"v": VERSION, "robots": 1, "names": None, "agents": None}
NAN, INF = float("nan"), float("inf")
SCENARIO = EXAMPLES / "protocol" / "flock.toml"
ROBOTS = 3
OVERRIDES = [f"robots.flock.count={ROBOTS}", "time.rate_hz=10", "physics.engine=pymunk"]


class Turn:
    """A tick as the runner sees it: what an honest runner would answer, and with what else it could be confused."""

    def __init__(self, runner: "RawRunner", tick: int, arrays: Arrays) -> None:
        self.runner, self.tick, self.arrays = runner, tick, arrays
        self.honest = frame("actions", tick, arrays, {})

    def other(self, tick: int | None = None, values: Arrays | None = None, **arrays: Any) -> bytes:
        """The honest answer but for its tick, its values, or some arrays ("__" for "/")."""
        changed = {name.replace("__", "/"): array for name, array in arrays.items()}
        return frame("actions", self.tick if tick is None else tick, self.arrays | changed, values or {})


Says = Callable[[Turn], Sequence[bytes]]  # all that is sent in a tick, in order


def honestly(turn: Turn) -> Sequence[bytes]:
    """One answer, the right one."""
    return [turn.honest]


class RawRunner:
    """Plays so many robots of a run in a thread of this process, until the run ends or it is closed."""

    def __init__(
        self, endpoint: str, run_id: str, name: str, robots: int, says: Says = honestly, early: Sequence[bytes] = ()
    ) -> None:
        """`early` is what it says before it is ready."""
        self.keys, self.name, self._robots, self._says, self._early = Keys(run_id), name, robots, says, early
        self.session = open_runner(endpoint, JOIN_S)
        self.frames: list[bytes] = []  # that it answered honestly, or would have
        self.fault: Exception | None = None
        self._arrived: queue.SimpleQueue[zenoh.Sample | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Leave; whatever went wrong in the thread is raised here."""
        self._arrived.put(None)
        self._thread.join(JOIN_S)
        close_session(self.session)
        if self.fault is not None:
            raise self.fault

    def ask(self, name: str, payload: bytes) -> str:
        """What the world says to a request to join under that name: the refusal, "" if there is none."""
        for reply in self.session.get(self.keys.join(name), payload=payload, timeout=JOIN_S):
            return reply.err.payload.to_string() if reply.err else ""
        return ""

    def put(self, key: str, payload: bytes) -> None:
        """Say something at another key than its own."""
        self.session.put(key, payload, congestion_control=zenoh.CongestionControl.BLOCK, express=True)

    def _run(self) -> None:
        try:
            self._play()
        except Exception as fault:  # noqa: BLE001 - raised by close, in the test's thread
            self.fault = fault

    def _play(self) -> None:
        into, block = (self._arrived.put, self._arrived), zenoh.CongestionControl.BLOCK
        declared = (
            self.session.declare_subscriber(self.keys.frame(self.name), into),
            self.session.liveliness().declare_token(self.keys.alive(self.name)),
        )
        answers = self.session.declare_publisher(self.keys.answer(self.name), congestion_control=block, express=True)
        request = msgpack.packb({"v": VERSION, "robots": self._robots, "names": None, "agents": None})
        reply = next(iter(self.session.get(self.keys.join(self.name), payload=request, timeout=JOIN_S)))
        assert reply.ok is not None, reply.err and reply.err.payload.to_string()
        assignment = msgpack.unpackb(reply.ok.payload.to_bytes())
        for payload in (*self._early, frame("ready", -1, {}, {})):
            answers.put(payload)
        while (sample := self._arrived.get()) is not None:
            message = msgpack.unpackb(sample.payload.to_bytes())
            if message["kind"] == "end":
                break
            turn = Turn(self, message["tick"], acted(message["arrays"], assignment))
            for payload in self._says(turn):
                answers.put(payload)
            self.frames.append(turn.honest)
        del declared


@dataclass(frozen=True)
class Prank:
    """Something that a runner does in one tick."""

    title: str  # in the words of the docs
    says: Callable[[Turn], Sequence[bytes]]
    counts: Mapping[str, int] = field(default_factory=dict[str, int])
    fates: tuple[str, ...] = ()  # of its packets


def first(*wrong: Callable[[Turn], bytes]) -> Callable[[Turn], Sequence[bytes]]:
    """Something wrong, then the honest answer."""
    return lambda turn: [*(answer(turn) for answer in wrong), turn.honest]


def only(wrong: Callable[[Turn], bytes]) -> Callable[[Turn], Sequence[bytes]]:
    return lambda turn: [wrong(turn)]


def rows_of(turn: Turn) -> list[int]:
    return list(unpacked(turn.arrays["rows"]))


def rows(turn: Turn, change: Callable[[list[int]], list[int]]) -> bytes:
    """The answer for other robots than its own, everything else of it as many."""
    own = change(rows_of(turn))
    return turn.other(rows=packed("<i8", [len(own)], own))


def commands(turn: Turn, *command: float) -> bytes:
    """The answer with one command for all robots: whether, forward, turn, sideways."""
    count = len(rows_of(turn))
    return turn.other(command=packed("<f8", [4, count], [value for value in command for _ in range(count)]))


def packets(turn: Turn, count: int, size: int, to: int = BROADCAST) -> bytes:
    """The answer with so many packets of its first robot."""
    senders = [rows_of(turn)[0]] * count
    return turn.other(
        sent=packed("<i8", [2, count], [*senders, *[to] * count]),
        sent__data=["|u1", [count * size], bytes(count * size)],
        sent__offset=packed("<i8", [count + 1], range(0, count * size + 1, size)),
    )


def falling(turn: Turn) -> bytes:
    """The answer with packets whose bytes begin behind their end."""
    *offsets, last = unpacked(turn.arrays["sent/offset"])
    return turn.other(sent__offset=packed("<i8", [len(offsets) + 1], [last, *offsets]))


def elsewhere(turn: Turn) -> Sequence[bytes]:
    """Says something in the name of a runner that there is not."""
    turn.runner.put(turn.runner.keys.answer("nobody"), turn.honest)
    return [turn.honest]


def joins(*requests: tuple[str, Any]) -> Callable[[Turn], Sequence[bytes]]:
    def says(turn: Turn) -> Sequence[bytes]:
        return [*(_request(turn, name or turn.runner.name, request) for name, request in requests), turn.honest][-1:]

    return says


def _request(turn: Turn, name: str, request: Any) -> bytes:
    turn.runner.ask(name, request if isinstance(request, bytes) else msgpack.packb(request))
    return b""


def _none(own: list[int]) -> list[int]:
    return own[:0]


def _beyond(own: list[int]) -> list[int]:
    return [*own[:-1], FAR]


def _reverse(own: list[int]) -> list[int]:
    return own[::-1]


def stolen(turn: Turn) -> bytes:
    """The answer with packets in the name of another's robot."""
    senders, to = rows_of(turn), [BROADCAST] * len(rows_of(turn))
    return turn.other(sent=packed("<i8", [2, len(to)], [*senders[:-1], 0, *to]))


def published(turn: Turn, value: float) -> bytes:
    """The answer with a number of its first robot for whoever looks on."""
    return frame("actions", turn.tick, turn.arrays | _table("values", turn, 0, value), {})


def noted(turn: Turn, states: list[Any]) -> bytes:
    """The answer with a state of its first robot."""
    return frame("actions", turn.tick, turn.arrays | _table("notes", turn, 0, 0.0), {"states": states})


def lit(turn: Turn, which: int, rgb: int) -> bytes:
    """The answer with a light of its first robot."""
    return frame("actions", turn.tick, turn.arrays | _table("leds", turn, which, float(rgb)), {})


def _table(name: str, turn: Turn, slot: int, value: float) -> dict[str, Any]:
    """A number of the first robot as the arrays of a sparse table."""
    return {name: packed("<i8", [2, 1], [rows_of(turn)[0], slot]), f"{name}/value": packed("<f8", [1], [value])}


BESIDE = (
    Prank("an answer to the last tick", first(lambda turn: turn.other(turn.tick - 1)), {"wrong_tick_frames": 1}),
    Prank("an answer to the next tick", first(lambda turn: turn.other(turn.tick + 1)), {"wrong_tick_frames": 1}),
    Prank(
        "an answer to a distant tick, or before the first",
        first(lambda turn: turn.other(FAR), lambda turn: turn.other(-2)),
        {"wrong_tick_frames": 2},
    ),
    Prank("the answer twice", lambda turn: [turn.honest, turn.honest], {"wrong_tick_frames": 1}),
    Prank("its answer 50 times more", lambda turn: [turn.honest] * (1 + TIMES), {"wrong_tick_frames": TIMES}),
    Prank(
        "all answers of earlier ticks again",
        lambda turn: [*turn.runner.frames[:5], turn.honest],
        {"wrong_tick_frames": 5},
    ),
    Prank(
        "rows of other robots, and no rows",
        first(lambda turn: rows(turn, lambda own: [row - len(own) for row in own]), lambda turn: rows(turn, _none)),
        {"malformed_frames": 2},
    ),
    Prank(
        "rows out of range",
        first(lambda turn: rows(turn, _beyond), lambda turn: rows(turn, lambda own: [-1, *own[1:]])),
        {"malformed_frames": 2},
    ),
    Prank(
        "a robot twice, one too few, or in another order",
        first(
            lambda turn: rows(turn, lambda own: [own[0], *own[:-1]]),
            lambda turn: rows(turn, lambda own: own[:-1]),
            lambda turn: rows(turn, _reverse),
        ),
        {"malformed_frames": 3},
    ),
    Prank("packets of a robot of another runner", first(stolen), {"malformed_frames": 1}),
    Prank(
        "packets with offsets beyond their end, or to a robot below -1",
        first(falling, lambda turn: packets(turn, 1, 6, to=-2)),
        {"malformed_frames": 2},
    ),
    Prank(
        "notes that are not finite numbers",
        first(lambda turn: published(turn, NAN), lambda turn: published(turn, INF)),
        {"malformed_frames": 2},
    ),
    Prank(
        "states that are not text, too long, or too many",
        first(*(lambda turn, states=states: noted(turn, states) for states in ([7], ["x" * 65], ["x"] * 257, []))),
        {"malformed_frames": 4},
    ),
    Prank(
        "colours of an LED out of range",
        first(lambda turn: lit(turn, 0, 2**24), lambda turn: lit(turn, -1, 0)),
        {"malformed_frames": 2},
    ),
    Prank(
        "half of its answer, an empty frame, or random bytes",
        first(lambda turn: turn.honest[: len(turn.honest) // 2], lambda _: b"", lambda _: b"\xc1" * 40),
        {"malformed_frames": 3},
    ),
    Prank(
        "a frame of another version",
        first(lambda turn: turn.honest.replace(b"\xa1v\x01", b"\xa1v\x02", 1)),
        {"malformed_frames": 1},
    ),
    Prank(
        "arrays with fewer bytes, or another type, than declared",
        first(
            lambda turn: turn.other(command=["<f8", [4, 2**40], b""]),
            lambda turn: turn.other(rows=["<f8", [1], bytes(8)]),
        ),
        {"malformed_frames": 2},
    ),
    Prank(
        "frames of kinds that runners do not send, and a second `ready`",
        first(
            *(
                lambda turn, kind=kind: frame(kind, turn.tick, {}, {})
                for kind in ("tick", "end", "dance", "sent", "ready")
            )
        ),
        {"unexpected_kind_frames": 5},
    ),
    Prank("answers under an unknown name", elsewhere, {"unknown_runner_frames": 1}),
    Prank("repeated requests to join while it plays", joins(*[("", REQUEST)] * 20), {"refused_join": 20}),
    Prank(
        "requests to join under other names when no robot is free",
        joins(("other", REQUEST), ("third", REQUEST)),
        {"refused_join": 2},
    ),
    Prank("malformed requests to join", joins(("fourth", b"\xc1"), ("fifth", {"v": 9})), {"bad_join": 2}),
)
"""What is dropped and counted; the honest answer, which comes too, counts."""

EARLY = Prank(
    "answers before it is ready",
    lambda _: [frame("actions", tick, {}, {}) for tick in (-1, 0)],
    {"wrong_tick_frames": 2},
)
INSTEAD = (
    Prank(
        "commands that are NaN or infinite", only(lambda turn: commands(turn, 1.0, NAN, INF, 0.0)), {"nan_commands": 3}
    ),
    Prank(
        "commands far beyond the body's limits",
        only(lambda turn: commands(turn, 1.0, 1e300, -1e300, 0.0)),
        {"clipped_commands": 3},
    ),
    Prank("packets larger than the radio's limit", only(lambda turn: packets(turn, 2, 5000)), fates=("too_large",)),
    Prank(
        "far more packets than fit into the radio's queue",
        only(lambda turn: packets(turn, 300, 20)),
        fates=("queue_full",),
    ),
    Prank(
        "packets to robots that do not exist", only(lambda turn: packets(turn, 4, 6, to=77)), {"packets_to_nobody": 4}
    ),
)
"""What counts as the answer of its robots; those of others go on as without it."""


@dataclass
class Played(Observer, JoinObserver):
    """An observer of the run, who is told of its runners, too: lets one join after the other, and looks at counts."""

    says: Says = honestly
    ticks: int = 10
    early: Sequence[bytes] = ()  # what the odd one says before it is ready
    runners: dict[str, RawRunner] = field(default_factory=dict[str, RawRunner])
    counted: list[Counter[str]] = field(default_factory=list[Counter[str]])  # at the end of each tick, so far
    refusals: list[str] = field(default_factory=list[str])
    at: tuple[str, str] = ("", "")

    def run(self, *overrides: str, **more: Any) -> Result:
        """The run, to its end; raises what it raises."""
        listening = Listening(("tcp/127.0.0.1:0",), observer=self)
        changes = [*OVERRIDES, f"duration_s={self.ticks / 10}", *overrides]
        self.simulation = Simulation(SCENARIO, seeds=[1, 2], overrides=changes, listening=listening, **more)
        self.simulation.watch(self)
        try:
            return run_to_end(self.simulation)
        finally:
            for runner in self.runners.values():
                runner.close()

    def opened(self, endpoints: tuple[str, ...], run_id: str) -> None:
        self.at = endpoints[0], run_id
        self.runners["honest"] = RawRunner(*self.at, "honest", ROBOTS)

    def changed(self, change: RunnerEvent, free: tuple[str, ...]) -> None:
        if change.what == "joined" and change.runner == "honest":
            self.runners["odd"] = RawRunner(*self.at, "odd", ROBOTS, self.says, self.early)

    def refused(self, runner: str, reason: str) -> None:
        self.refusals.append(reason)

    def see(self, truth: Truth) -> None:
        run = self.simulation._run
        assert run is not None
        self.counted.append(Counter(run.backend.counts()))
