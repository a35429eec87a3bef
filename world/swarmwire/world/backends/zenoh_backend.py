"""Runners behind zenoh: an adapter that carries bytes between runners and a `RunnerRegistry`, which decides.

`ZenohBackend` opens the session, queues arrivals in a `RunnerInbox`, waits for runners with time-outs, and reports
events through `BackendHooks`. `LockstepBackend` is the backend whose loop waits for every runner in each tick.
"""

# zenoh's stubs omit the return types of put, reply and close.
# pyright: reportUnknownMemberType=false, reportMissingModuleSource=false

import queue
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import zenoh
from zenoh.handlers import Callback

from swarmwire.comms.base.clock import Clock, to_ns, to_s
from swarmwire.comms.base.errors import BadInput, Interrupted, RunnerLost
from swarmwire.comms.robot.packets import NO_TX_STATUSES, ReceivedPackets, TxStatuses
from swarmwire.comms.robot.tick_io import Actions, Readings
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.keys import Keys, runner_of
from swarmwire.comms.wire.sessions import close_session, listens_at, open_world
from swarmwire.world.backends.inbox import Item, RunnerInbox
from swarmwire.world.backends.join_policy import (
    HOST_GRACE_S,
    JoinRefused,
    ListenSettings,
)
from swarmwire.world.backends.lockstep import Lockstep
from swarmwire.world.backends.registry import RunnerRegistry
from swarmwire.world.backends.runner_reports import Loss, RunnerEvent, RunnerHealth

POLL_S = 0.2  # time between two checks of a wait
ANNOUNCE_S = 1.0  # a wait for robots without a runner is announced after this time
SILENT_S = 5.0  # a wait for the answer of a runner is announced after this time
FREEZE_THRESHOLD_S = 2.0  # a longer time between two checks means that this process was frozen
START_TIMEOUT_S = 60.0  # time-out of runners that join and build their agents
LEAVE_TIMEOUT_S = 3.0  # time-out of runners that leave after the end
MAX_REFUSALS_REPORTED = 200  # a limit, since endless requests would fill the log
RATE_LIMITED = "it sent far more than it was asked for"

RegistryT = TypeVar("RegistryT", bound=RunnerRegistry[Any])


@dataclass(frozen=True)
class BackendHooks:
    """The callbacks of a backend.

    Attributes:
        failure: returns the reason why no runner will join (a process exited), or None; called while any loss ends the
            run.
        stopped: returns True if the run must end.
        lost: called with a loss that the run survives.
        changed: called with every runner event, and the names of the robots without a runner after it.
        refused: called with the name of a refused runner, and the reason.
        opened: called with the endpoints of an open run.
        waiting: called with the names of the robots without a runner for which the loop has begun to wait.
        silent: called with a runner, and its robots, for whose answer the loop has waited for SILENT_S.
    """

    failure: Callable[[], str | None] = lambda: None
    stopped: Callable[[], bool] = lambda: False
    lost: Callable[[Loss], None] = lambda _: None
    changed: Callable[[RunnerEvent, tuple[str, ...]], None] = lambda _event, _free: None
    refused: Callable[[str, str], None] = lambda _runner, _reason: None
    opened: Callable[[tuple[str, ...]], None] = lambda _: None
    waiting: Callable[[tuple[str, ...]], None] = lambda _: None
    silent: Callable[[str], None] = lambda _: None


NO_HOOKS = BackendHooks()


class ZenohBackend(ABC, Generic[RegistryT]):
    """A backend whose agents run in runners that join over the network; the subclass defines how the loop waits."""

    congestion = zenoh.CongestionControl.BLOCK  # congestion control of frames to runners

    def __init__(
        self,
        listen: ListenSettings | str,
        run_id: str,
        registry: RegistryT,
        timeout_s: float,
        clock: Clock,
        hooks: BackendHooks = NO_HOOKS,
        start_s: float = START_TIMEOUT_S,
    ) -> None:
        """`timeout_s` is the time-out of answers in a tick, `start_s` of runners before the first tick."""
        self._listen = ListenSettings((listen,)) if isinstance(listen, str) else listen
        self._keys = Keys(run_id)
        self._registry, self._timeout_s, self._clock, self._hooks = registry, timeout_s, clock, hooks
        self._inbox = RunnerInbox(registry.limits)
        self._session: zenoh.Session | None = None
        self._declarations: tuple[object, ...] = ()  # zenoh undeclares unreferenced ones
        self._answers: dict[str, zenoh.Subscriber[Any]] = {}  # key -> subscriber, for all runners or for one
        self._rate_limited: set[str] = set()
        self._publishers: dict[str, zenoh.Publisher] = {}
        self._present: set[str] = set()
        self._build_deadlines_ns: dict[str, int] = {}  # runner -> wall time
        self._losses_reported = self._events_reported = self._refusals = 0
        self._wait_timeout_s = start_s  # time-out of the present wait; after the start `timeout_s`
        self._deadline_ns = self._checked_ns = 0
        self._waits_since_ns: int | None = None
        self._announced: tuple[str, ...] = ()  # robots for which the loop waits
        self._silence_announced = False  # in the present wait

    def open(self) -> None:
        """Listen at the endpoints, so that runners may join; BadInput if an endpoint is in use."""
        listen = self._listen
        try:
            session = open_world(
                listen.endpoints, self._timeout_s, listen.network, listen.access, self._registry.limits
            )
        except zenoh.ZError as error:
            reason = str(error).split(" at ")[0]
            raise BadInput(
                "", ", ".join(listen.endpoints), f"expected an endpoint that is free and can be listened on: {reason}"
            ) from error
        self._session = session
        handler = (self._inbox.put, self._inbox)
        self._answers = {self._keys.any_answer: session.declare_subscriber(self._keys.any_answer, handler)}
        self._declarations = (
            session.declare_queryable(self._keys.any_session_info, handler),
            session.declare_queryable(self._keys.any_join, handler),
            session.liveliness().declare_subscriber(self._keys.any_alive, handler, history=True),
            session.liveliness().declare_token(self._keys.world),  # last: it announces that runners may join
        )
        if self._registry.is_open:
            self._hooks.opened(listens_at(session))

    def start(self) -> None:
        """Wait until runners play all robots and have built their agents."""
        if self._session is None:
            self.open()
        self._wait()
        self._wait_timeout_s = self._timeout_s

    @abstractmethod
    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """Return the actions of all robots in this tick."""

    def counts(self) -> dict[str, int]:
        """Return the numbers of dropped frames and lost runners, by name."""
        return {**self._registry.counts(), **self._inbox.counts()}

    def health(self) -> RunnerHealth:
        """Return the health of the runners; safe from any thread."""
        health, since_ns = self._registry.health(), self._waits_since_ns
        if since_ns is None:
            return health
        waits_s = to_s(self._clock.now_ns() - since_ns)
        return replace(health, waits_s=waits_s, waits_for=self._registry.waits_for)

    def close(self) -> None:
        """Send the end of the run to the runners, wait until they leave or time out, and close the session."""
        session, self._session = self._session, None
        if session is None:
            return
        for publisher in self._publishers.values():
            publisher.put(frames.encode("end", -1, {}))
        deadline_ns = self._clock.now_ns() + to_ns(LEAVE_TIMEOUT_S)
        while self._present and self._clock.now_ns() < deadline_ns and self._failure() is None:
            item = self._next()
            if isinstance(item, zenoh.Sample) and item.kind == zenoh.SampleKind.DELETE:
                self._present.discard(runner_of(str(item.key_expr)))
        close_session(session)

    def _send(self, out: list[tuple[str, bytes]]) -> None:
        for runner, data in out:
            self._publishers[runner].put(data)

    def _wait(self) -> None:
        """Handle arrivals until every runner is ready; a runner that takes too long is lost.

        Samples are handled together once there may be one from each runner: otherwise the caches of this process would
        be cold for each sample, since the runners use the cores in between. A query is answered at once.
        """
        self._reset_deadline()
        self._waits_since_ns, self._announced, self._silence_announced = self._checked_ns, (), False
        self._wait_for_all()
        self._waits_since_ns = None

    def _wait_for_all(self) -> None:
        if not self._registry.waiting:  # join requests are answered also when no runner blocks
            self._handle_arrived()
        arrived: list[Item] = []
        while waiting := self._registry.waiting:
            while len(arrived) < waiting:
                item = self._next()
                if item is None:
                    break
                arrived.append(item)
                if isinstance(item, zenoh.Query):
                    break
            if not arrived and self._hooks.stopped():
                raise Interrupted("interrupted while it waited for its runners")
            failure = None if arrived else self._failure()
            for item in arrived:
                self._handle(item)
            arrived.clear()
            if failure is not None and self._registry.waiting:
                raise RunnerLost(*self._registry.missing, failure)
            if self._update_time() > self._deadline_ns:
                self._registry.lose_blocking(f"no answer for {self._wait_timeout_s:g} s")
                self._reset_deadline()
            self._report_changes()
            self._announce_wait()

    def _announce_wait(self) -> None:
        """Call the hooks with the robots for which the run waits, also when these change, or with a silent runner."""
        since_ns, missing = self._waits_since_ns, self._registry.awaited_robots
        if not self._registry.has_begun or since_ns is None:
            return
        waits_ns = self._clock.now_ns() - since_ns
        if missing not in (self._announced, ()) and waits_ns >= to_ns(ANNOUNCE_S):
            self._announced = missing
            self._hooks.waiting(missing)
        blocking = self._registry.waits_for
        if blocking and not missing and not self._silence_announced and waits_ns >= to_ns(SILENT_S):
            self._silence_announced = True
            self._hooks.silent(blocking)

    def _handle_arrived(self) -> None:
        """Handle everything that has arrived, without waiting for more."""
        for _ in range(self._inbox.qsize()):
            self._handle(self._inbox.get())
        self._report_changes()

    def _reset_deadline(self) -> None:
        self._checked_ns = self._clock.now_ns()
        self._deadline_ns = self._checked_ns + to_ns(self._wait_timeout_s + HOST_GRACE_S)

    def _update_time(self) -> int:
        """Return the time. After a freeze of this process, all deadlines move by its duration."""
        now_ns = self._clock.now_ns()
        elapsed_ns = now_ns - self._checked_ns
        if elapsed_ns > to_ns(FREEZE_THRESHOLD_S):
            self._deadline_ns += elapsed_ns
            self._build_deadlines_ns = {
                runner: deadline_ns + elapsed_ns for runner, deadline_ns in self._build_deadlines_ns.items()
            }
        self._checked_ns = now_ns
        return now_ns

    def _failure(self) -> str | None:
        return None if self._registry.survives_losses else self._hooks.failure()

    def _next(self) -> Item | None:
        try:
            return self._inbox.get(timeout=POLL_S)
        except queue.Empty:
            return None
        finally:
            self._update_time()

    def _handle(self, item: Item) -> None:
        if isinstance(item, zenoh.Query):
            self._answer_query(item)
            return
        key = str(item.key_expr)
        runner = runner_of(key)
        if key != self._keys.alive(runner):
            # The key of a put may contain wildcards; only the exact key identifies a runner.
            sender = runner if key == self._keys.answer(runner) else key
            self._send(self._registry.answer(sender, item.payload.to_bytes()))
        elif item.kind == zenoh.SampleKind.DELETE:
            self._present.discard(runner)
            self._registry.lose(runner, "its process or its link is gone")
        else:
            self._present.add(runner)

    def _answer_query(self, query: zenoh.Query) -> None:
        """Answer a query of a runner for the session info, or its join request."""
        if self._session is None:
            return
        self._report_changes()  # before a new runner of the same name gets the frames of the last
        key = str(query.key_expr)
        runner = runner_of(key)
        with query:  # a query that is kept alive blocks the runner until its time-out
            request = query.payload.to_bytes() if query.payload else b""
            try:
                if key == self._keys.session_info(runner):
                    session_info = self._registry.session_info(request)
                    if session_info is not None:
                        query.reply(key, session_info.encode())
                    return
                if runner in self._rate_limited:
                    raise JoinRefused(RATE_LIMITED)
                # Only the exact key identifies a runner.
                reply = self._registry.join(runner if key == self._keys.join(runner) else key, request)
            except JoinRefused as refusal:
                self._refusals += 1
                if self._refusals <= MAX_REFUSALS_REPORTED:
                    self._hooks.refused(runner, str(refusal))
                query.reply_err(str(refusal))
                return
            self._publishers[runner] = self._session.declare_publisher(
                self._keys.frame(runner), congestion_control=self.congestion, express=True
            )
            if self._rate_limited:
                self._subscribe(self._session, runner)
            self._build_deadlines_ns[runner] = self._clock.now_ns() + to_ns(self._registry.limits.join_s)
            self._reset_deadline()
            query.reply(key, reply)

    def _report_changes(self) -> None:
        """Report losses and events to the hooks, and drop rate-limited runners and those past their build deadline.

        A lost runner may only be slow, so it gets an "end" frame.
        """
        rate_limited = self._inbox.rate_limited() - self._rate_limited
        if rate_limited:
            self._rate_limit(rate_limited)
        for runner, deadline_ns in list(self._build_deadlines_ns.items()):
            if not self._registry.is_building(runner):
                del self._build_deadlines_ns[runner]
            elif self._clock.now_ns() > deadline_ns:
                self._registry.lose(runner, f"its agents were not ready within {self._registry.limits.join_s:g} s")
        for loss in self._registry.losses[self._losses_reported :]:
            self._hooks.lost(loss)
        self._losses_reported = len(self._registry.losses)
        for event in self._registry.events[self._events_reported :]:
            if event.what in ("lost", "left"):
                reason = {"why": event.reason} if event.reason else {}
                if publisher := self._publishers.pop(event.runner, None):  # a host's process has no publisher
                    publisher.put(frames.encode("end", -1, {}, reason))
                self._present.discard(event.runner)
            elif event.what == "restarted":  # the new process gets as much time as the last
                self._reset_deadline()
            self._hooks.changed(event, self._registry.missing_robots)
        self._events_reported = len(self._registry.events)

    def _rate_limit(self, rate_limited: set[str]) -> None:
        """Subscribe to each runner separately, except to these: zenoh then drops their samples before Python sees them.

        An answer that arrives during the change may be received twice, which is counted, but is never missed.
        """
        if self._session is None:
            return
        self._rate_limited |= rate_limited
        for runner in self._publishers.keys() - self._rate_limited:
            self._subscribe(self._session, runner)
        for key in (self._keys.any_answer, *map(self._keys.answer, rate_limited)):
            if key in self._answers:
                self._answers.pop(key).undeclare()
        for runner in rate_limited:
            self._registry.lose(runner, RATE_LIMITED)

    def _subscribe(self, session: zenoh.Session, runner: str) -> None:
        key, put = self._keys.answer(runner), Callback(self._inbox.put, indirect=False)  # indirect: a thread per key
        if key not in self._answers:
            self._answers[key] = session.declare_subscriber(key, put)


class LockstepBackend(ZenohBackend[Lockstep]):
    """A backend of runners in lockstep, as fast as the machine allows: `Lockstep` decides, this carries the bytes."""

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """Send one frame to every runner, and wait for one answer from each."""
        self._send(self._registry.open_tick(tick, readings, received, tx_status))
        self._wait()
        return self._registry.pop_actions()
