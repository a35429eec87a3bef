"""The remote crew in lockstep: runners behind zenoh. A thin adapter: `lockstep` decides, this carries the bytes."""

# zenoh's stubs leave out the return types of put, reply and close.
# pyright: reportUnknownMemberType=false

import queue
from collections.abc import Callable

import zenoh

from swarmwire.comms.assignment import Assignment
from swarmwire.comms.clock import Clock, to_ns
from swarmwire.comms.errors import BadInput, Interrupted, RunnerLost
from swarmwire.comms.packets import Heard
from swarmwire.comms.senses import Actions, Senses
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.keys import Keys, runner_of
from swarmwire.comms.wire.sessions import open_world
from swarmwire.world.lockstep import Lockstep, Refused

POLL_S = 0.2  # how often a wait looks up whether to go on waiting
START_S = 60.0  # how long runners may take to join and build their agents
FAREWELL_S = 3.0  # how long runners may take to leave after the end


class RemoteCrew:
    """All agents of a run in runners that join at `endpoint`; the loop waits for every one of them.

    While it waits it asks `trouble`, which says why there is no more point in it (a process that exited), or None, and
    `stopped`, whether somebody asked for the end: Interrupted. Until the first tick it waits `start_s`.
    """

    def __init__(
        self,
        endpoint: str,
        run_id: str,
        assignments: list[Assignment],
        timeout_s: float,
        clock: Clock,
        trouble: Callable[[], str | None] = lambda: None,
        stopped: Callable[[], bool] = lambda: False,
        start_s: float = START_S,
    ) -> None:
        self._endpoint, self._keys = endpoint, Keys(run_id)
        self._lockstep = Lockstep(assignments)
        self._timeout_s, self._start_s, self._clock = timeout_s, start_s, clock
        self._trouble, self._stopped = trouble, stopped
        self._inbox: queue.SimpleQueue[zenoh.Sample | zenoh.Query] = queue.SimpleQueue()
        self._session: zenoh.Session | None = None
        self._declared: tuple[object, ...] = ()  # zenoh takes back what nobody holds on to
        self._frames: dict[str, zenoh.Publisher] = {}
        self._present: set[str] = set()

    def open(self) -> None:
        """Listen at the endpoint, so that runners may join; BadInput if it is taken."""
        try:
            session = self._session = open_world(self._endpoint, self._timeout_s)
        except zenoh.ZError as error:
            reason = str(error).split(" at ")[0]
            raise BadInput(
                "", self._endpoint, f"expected an endpoint that is free and can be listened on: {reason}"
            ) from error
        arrived = (self._inbox.put, self._inbox)
        self._declared = (
            session.declare_queryable(self._keys.join, arrived),
            session.declare_subscriber(self._keys.any_answer, arrived),
            session.liveliness().declare_subscriber(self._keys.any_alive, arrived, history=True),
            session.liveliness().declare_token(self._keys.world),  # last: it says that runners may join
        )

    def start(self) -> None:
        """Wait until runners have taken all robots and built their agents."""
        if self._session is None:
            self.open()
        self._wait(self._start_s)

    def act(self, tick: int, senses: Senses, heard: Heard) -> Actions:
        """One frame to every runner whose robots act, one answer from each."""
        for runner, data in self._lockstep.open_tick(tick, senses, heard):
            self._frames[runner].put(data)
        self._wait(self._timeout_s)
        return self._lockstep.take()

    def counts(self) -> dict[str, int]:
        """Frames that were dropped, by name."""
        return self._lockstep.counts()

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
        session.close()

    def _wait(self, timeout_s: float) -> None:
        """Take in what arrives until every runner is ready; RunnerLost if one takes too long.

        Samples are handled together once there may be one from each runner: one by one, the caches of this process
        would be cold for each, since the runners use the cores in between.
        """
        deadline_ns = self._clock.now_ns() + to_ns(timeout_s)
        arrived: list[zenoh.Sample | zenoh.Query] = []
        while waiting := self._lockstep.waiting:
            while len(arrived) < waiting:
                item = self._next()
                if item is None:
                    break
                arrived.append(item)
            if not arrived and self._stopped():
                raise Interrupted("interrupted while it waited for its runners")
            trouble = None if arrived else self._trouble()
            for item in arrived:
                self._handle(item)
            arrived.clear()
            if trouble is None and self._clock.now_ns() > deadline_ns:
                trouble = f"no answer for {timeout_s:g} s"
            if trouble is not None and self._lockstep.waiting:
                raise RunnerLost(*self._lockstep.missing, trouble)

    def _next(self) -> zenoh.Sample | zenoh.Query | None:
        try:
            return self._inbox.get(timeout=POLL_S)
        except queue.Empty:
            return None

    def _handle(self, item: zenoh.Sample | zenoh.Query) -> None:
        if isinstance(item, zenoh.Query):
            self._join(item)
            return
        key = str(item.key_expr)
        runner = runner_of(key)
        if key != self._keys.alive(runner):
            # A put may name its key with wildcards; only the exact one speaks for a runner.
            self._lockstep.answer(runner if key == self._keys.answer(runner) else key, item.payload.to_bytes())
        elif item.kind == zenoh.SampleKind.DELETE:
            self._present.discard(runner)
            self._lockstep.gone(runner, "its process or its link is gone")
        else:
            self._present.add(runner)

    def _join(self, query: zenoh.Query) -> None:
        if self._session is None:
            return
        with query:  # a query that is kept alive holds the asker until its time-out
            try:
                runner, reply = self._lockstep.join(query.payload.to_bytes() if query.payload else b"")
            except Refused as refusal:
                query.reply_err(str(refusal))
                return
            self._frames[runner] = self._session.declare_publisher(
                self._keys.frame(runner), congestion_control=zenoh.CongestionControl.BLOCK, express=True
            )
            query.reply(self._keys.join, reply)
