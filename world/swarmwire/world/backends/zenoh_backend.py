"""Runners behind zenoh: a thin adapter that carries bytes between them and a roster, which decides."""

# pyright: reportUnknownMemberType=false, reportMissingModuleSource=false

import queue
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import zenoh
from zenoh.handlers import Callback

from swarmwire.comms.assignment import Assignment
from swarmwire.comms.clock import Clock, to_ns, to_s
from swarmwire.comms.errors import BadInput, Interrupted, RunnerLost
from swarmwire.comms.packets import NO_TX_STATUSES, ReceivedPackets, TxStatuses
from swarmwire.comms.tick_io import Actions, Readings
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.keys import Keys, runner_of
from swarmwire.comms.wire.sessions import close_session, listens_at, open_world
from swarmwire.world.backends.inbox import Item, RunnerInbox
from swarmwire.world.backends.join_policy import USUAL, JoinPolicy, JoinRefused, ListenSettings
from swarmwire.world.backends.lockstep import Lockstep
from swarmwire.world.backends.registry import Loss, OnLoss, RunnerEvent, RunnerHealth, RunnerRegistry

# zenoh's stubs leave out the return types of put, reply and close.


POLL_S = 0.2  # how often a wait looks up whether to go on waiting
AWAY_S = 2.0  # longer between two looks: this process was frozen itself
START_S = 60.0  # how long runners may take to join and build their agents
MAX_TOLD = 200  # refusals: whoever asks for ever shall not fill the log
FLOODED = "it sent far more than it was asked for"
FAREWELL_S = 3.0  # how long runners may take to leave after the end

R = TypeVar("R", bound=RunnerRegistry[Any])


@dataclass(frozen=True)
class BackendHooks:
    """What a backend asks and tells whoever runs it.

    `trouble` says why there is no more point in waiting for runners (a process that exited), or None; it is asked while
    any loss ends the run. `stopped` says whether the run is to end; `lost` is told of a loss that the run survives,
    `changed` of every runner that comes or goes and of the robots that nobody plays then, `refused` of one that may not
    join, and why; `opened`, in an open run, of where the world listens.
    """

    trouble: Callable[[], str | None] = lambda: None
    stopped: Callable[[], bool] = lambda: False
    lost: Callable[[Loss], None] = lambda _: None
    changed: Callable[[RunnerEvent, tuple[str, ...]], None] = lambda _change, _free: None
    refused: Callable[[str, str], None] = lambda _runner, _why: None
    opened: Callable[[tuple[str, ...]], None] = lambda _: None


class ZenohBackend(ABC, Generic[R]):
    """All agents of a run in runners that join at `endpoint`; how the loop waits for them is the subclass's affair."""

    congestion = zenoh.CongestionControl.BLOCK  # of frames to runners

    def __init__(
        self,
        door: ListenSettings | str,
        run_id: str,
        roster: R,
        timeout_s: float,
        clock: Clock,
        around: BackendHooks,
        start_s: float = START_S,
    ) -> None:
        self._door = ListenSettings((door,)) if isinstance(door, str) else door
        self._keys = Keys(run_id)
        self._roster, self._timeout_s, self._clock, self._around = roster, timeout_s, clock, around
        self._inbox = RunnerInbox(roster.limits)
        self._session: zenoh.Session | None = None
        self._declared: tuple[object, ...] = ()  # zenoh takes back what nobody holds on to
        self._answers: dict[str, zenoh.Subscriber[Any]] = {}  # by key: one for all; one for each once one is shut out
        self._shut_out: set[str] = set()
        self._frames: dict[str, zenoh.Publisher] = {}
        self._present: set[str] = set()
        self._building: dict[str, int] = {}  # until when runners may take, wall time
        self._losses_told = self._changes_told = self._refusals = 0
        self._patience_s = start_s  # how long a wait may last; in ticks the time-out
        self._deadline_ns = self._looked_ns = 0
        self._waits_since_ns: int | None = None

    def open(self) -> None:
        """Listen at the endpoints, so that runners may join; BadInput if one is taken."""
        door = self._door
        try:
            session = open_world(door.endpoints, self._timeout_s, door.network, door.access, self._roster.limits)
        except zenoh.ZError as error:
            reason = str(error).split(" at ")[0]
            raise BadInput(
                "", ", ".join(door.endpoints), f"expected an endpoint that is free and can be listened on: {reason}"
            ) from error
        self._session = session
        arrived = (self._inbox.put, self._inbox)
        self._answers = {self._keys.any_answer: session.declare_subscriber(self._keys.any_answer, arrived)}
        self._declared = (
            session.declare_queryable(self._keys.any_offer, arrived),
            session.declare_queryable(self._keys.any_join, arrived),
            session.liveliness().declare_subscriber(self._keys.any_alive, arrived, history=True),
            session.liveliness().declare_token(self._keys.world),  # last: it says that runners may join
        )
        if self._roster.is_open:
            self._around.opened(listens_at(session))

    def start(self) -> None:
        """Wait until runners have taken all robots and built their agents."""
        if self._session is None:
            self.open()
        self._wait()
        self._patience_s = self._timeout_s

    @abstractmethod
    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """What every robot does in this tick."""

    def counts(self) -> dict[str, int]:
        """Frames that were dropped and runners that were lost, by name."""
        return {**self._roster.counts(), **self._inbox.counts()}

    def health(self) -> RunnerHealth:
        """How the runners are doing; safe from any thread."""
        health, since_ns = self._roster.health(), self._waits_since_ns
        if since_ns is None:
            return health
        waits_s = to_s(self._clock.now_ns() - since_ns)
        return replace(health, waits_s=waits_s, waits_for=self._roster.waits_for)

    def close(self) -> None:
        """Tell the runners that the run is over, give them a moment to leave, and close the session."""
        session, self._session = self._session, None
        if session is None:
            return
        for publisher in self._frames.values():
            publisher.put(frames.encode("end", -1, {}))
        deadline_ns = self._clock.now_ns() + to_ns(FAREWELL_S)
        while self._present and self._clock.now_ns() < deadline_ns and self._trouble() is None:
            item = self._next()
            if isinstance(item, zenoh.Sample) and item.kind == zenoh.SampleKind.DELETE:
                self._present.discard(runner_of(str(item.key_expr)))
        close_session(session)

    def _send(self, out: list[tuple[str, bytes]]) -> None:
        for runner, data in out:
            self._frames[runner].put(data)

    def _wait(self) -> None:
        """Take in what arrives until every runner is ready; one that takes too long is lost.

        Samples are handled together once there may be one from each runner: one by one, the caches of this process
        would be cold for each, since the runners use the cores in between. A question is answered at once.
        """
        self._allow_time()
        self._waits_since_ns = self._looked_ns
        self._wait_for_all()
        self._waits_since_ns = None

    def _wait_for_all(self) -> None:
        if not self._roster.waiting:  # who joins is let in also where nobody is waited for
            self._take_in()
        arrived: list[Item] = []
        while waiting := self._roster.waiting:
            while len(arrived) < waiting:
                item = self._next()
                if item is None:
                    break
                arrived.append(item)
                if isinstance(item, zenoh.Query):
                    break
            if not arrived and self._around.stopped():
                raise Interrupted("interrupted while it waited for its runners")
            trouble = None if arrived else self._trouble()
            for item in arrived:
                self._handle(item)
            arrived.clear()
            if trouble is not None and self._roster.waiting:
                raise RunnerLost(*self._roster.missing, trouble)
            if self._looked() > self._deadline_ns:
                self._roster.lose_silent(f"no answer for {self._patience_s:g} s")
                self._allow_time()
            self._tell_changes()

    def _take_in(self) -> None:
        """All that has arrived by now, without waiting for more."""
        for _ in range(self._inbox.qsize()):
            self._handle(self._inbox.get())
        self._tell_changes()

    def _allow_time(self) -> None:
        self._looked_ns = self._clock.now_ns()
        self._deadline_ns = self._looked_ns + to_ns(self._patience_s)

    def _looked(self) -> int:
        """The time. For as long as this process was frozen, no runner can be blamed: it is allowed to them again."""
        now_ns, before_ns = self._clock.now_ns(), self._looked_ns
        if now_ns - before_ns > to_ns(AWAY_S):
            self._deadline_ns += now_ns - before_ns
            self._building = {runner: until_ns + now_ns - before_ns for runner, until_ns in self._building.items()}
        self._looked_ns = now_ns
        return now_ns

    def _trouble(self) -> str | None:
        return None if self._roster.bears_losses else self._around.trouble()

    def _next(self) -> Item | None:
        try:
            return self._inbox.get(timeout=POLL_S)
        except queue.Empty:
            return None
        finally:
            self._looked()

    def _handle(self, item: Item) -> None:
        if isinstance(item, zenoh.Query):
            self._asked(item)
            return
        key = str(item.key_expr)
        runner = runner_of(key)
        if key != self._keys.alive(runner):
            # A put may name its key with wildcards; only the exact one speaks for a runner.
            speaker = runner if key == self._keys.answer(runner) else key
            self._send(self._roster.answer(speaker, item.payload.to_bytes()))
        elif item.kind == zenoh.SampleKind.DELETE:
            self._present.discard(runner)
            self._roster.gone(runner, "its process or its link is gone")
        else:
            self._present.add(runner)

    def _asked(self, query: zenoh.Query) -> None:
        """A runner asks what there is to play, or for robots."""
        if self._session is None:
            return
        self._tell_changes()  # before another runner of the same name hears what the one before it was told
        key = str(query.key_expr)
        runner = runner_of(key)
        with query:  # a query that is kept alive holds the asker until its time-out
            request = query.payload.to_bytes() if query.payload else b""
            try:
                if key == self._keys.offer(runner):
                    offer = self._roster.offer(request)
                    if offer is not None:
                        query.reply(key, offer.encode())
                    return
                if runner in self._shut_out:
                    raise JoinRefused(FLOODED)
                # Only the exact key speaks for a runner, as below.
                reply = self._roster.join(runner if key == self._keys.join(runner) else key, request)
            except JoinRefused as refusal:
                self._refusals += 1
                if self._refusals <= MAX_TOLD:
                    self._around.refused(runner, str(refusal))
                query.reply_err(str(refusal))
                return
            self._frames[runner] = self._session.declare_publisher(
                self._keys.frame(runner), congestion_control=self.congestion, express=True
            )
            if self._shut_out:
                self._hear(self._session, runner)
            self._building[runner] = self._clock.now_ns() + to_ns(self._roster.limits.join_s)
            self._allow_time()
            query.reply(key, reply)

    def _tell_changes(self) -> None:
        """A runner that was lost may be but slow: it is told to leave, since it has no robots any more."""
        flooding = self._inbox.flooding() - self._shut_out
        if flooding:
            self._shut(flooding)
        for runner, until_ns in list(self._building.items()):
            if not self._roster.is_building(runner):
                del self._building[runner]
            elif self._clock.now_ns() > until_ns:
                self._roster.gone(runner, f"its agents were not ready within {self._roster.limits.join_s:g} s")
        for loss in self._roster.losses[self._losses_told :]:
            self._around.lost(loss)
        self._losses_told = len(self._roster.losses)
        for change in self._roster.changes[self._changes_told :]:
            if change.what in ("lost", "left"):
                why = {"why": change.reason} if change.reason else {}
                self._frames.pop(change.runner).put(frames.encode("end", -1, {}, why))
                self._present.discard(change.runner)
            self._around.changed(change, self._roster.missing_robots)
        self._changes_told = len(self._roster.changes)

    def _shut(self, flooding: set[str]) -> None:
        """Hear each runner on its own, but for these: what they send is dropped where no Python sees it.

        An answer that comes while this is under way may be received twice, which is counted; none is missed.
        """
        if self._session is None:
            return
        self._shut_out |= flooding
        for runner in self._frames.keys() - self._shut_out:
            self._hear(self._session, runner)
        for key in (self._keys.any_answer, *map(self._keys.answer, flooding)):
            if key in self._answers:
                self._answers.pop(key).undeclare()
        for runner in flooding:
            self._roster.gone(runner, FLOODED)

    def _hear(self, session: zenoh.Session, runner: str) -> None:
        key, put = self._keys.answer(runner), Callback(self._inbox.put, indirect=False)  # or each would have a thread
        if key not in self._answers:
            self._answers[key] = session.declare_subscriber(key, put)


# --- The remote backend in lockstep: the loop waits for every runner, as fast as the machine allows.


ALONE = BackendHooks()


class LockstepBackend(ZenohBackend[Lockstep]):
    """All agents of a run in runners; `lockstep` decides, this carries the bytes."""

    def __init__(
        self,
        door: ListenSettings | str,
        run_id: str,
        assignments: list[Assignment],
        timeout_s: float,
        clock: Clock,
        around: BackendHooks = ALONE,
        on_loss: OnLoss = "stop",
        start_s: float = START_S,
        terms: JoinPolicy = USUAL,
    ) -> None:
        super().__init__(door, run_id, Lockstep(assignments, on_loss, terms), timeout_s, clock, around, start_s)

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """One frame to every runner, one answer from each."""
        self._send(self._roster.open_tick(tick, readings, received, tx_status))
        self._wait()
        return self._roster.take()
