"""A run published for observers: viewers connect from their own processes and do not affect the run.

What adds up from tick to tick (counts of packets, contacts, events) is published in full with the next tick that is; of
the links that ended, those of that tick alone.
"""

# pyright: reportUnknownMemberType=false
# zenoh's stubs leave out the return types of put, reply and close.

import os
import queue
import threading
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from math import isinf
from pathlib import Path
from typing import Any

import numpy as np
import zenoh

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.clock import NS_PER_S, Clock
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.run_views import (
    MetricSeries,
    ObservedRun,
    ObservedTick,
    readings_within,
    static_of,
    truth_of,
)
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.comms.wire.keys import ObserverKeys
from swarmwire.comms.wire.observer_frames import encode_scene, encode_truth
from swarmwire.comms.wire.sessions import closed_after, open_observed
from swarmwire.deploy.runs.live_address import Live, forget_live
from swarmwire.deploy.runs.runners import local_endpoint
from swarmwire.metrics.measures.measure import Measured
from swarmwire.metrics.pictures.viewer.selection import ARENA, living_robot, selected_robot
from swarmwire.world.backends.join_policy import ListenSettings

FRAMES_PER_S = 30
LINKS_PER_S = 5  # in large swarms, where links are most of a frame
FEW = 200  # robots: up to so many, links come with every frame
SMALL = 50  # robots: up to so many, everybody's sensors are shown; of more, those of one
MAX_FINISHED = 2000  # packets that ended in a tick: up to so many are shown, of more none


@dataclass(slots=True)
class RateLimit:
    """Something that may be done so many times a second."""

    per_s: int
    next_ns: int = 0

    def due(self, now_ns: int) -> bool:
        """Whether it may be done now; if so, the next time is counted from now."""
        if now_ns < self.next_ns:
            return False
        self.next_ns = now_ns + NS_PER_S // self.per_s
        return True


class Since:
    """The ticks since the one that was shown last."""

    def __init__(self) -> None:
        self.ticks = 0
        self._together: Truth | None = None

    def add(self, truth: Truth) -> None:
        """One more."""
        self.ticks += 1
        before = self._together
        if before is None:
            self._together = truth
            return
        tally = before.tally and truth.tally and before.tally + truth.tally
        onsets, events = before.contact_onsets + truth.contact_onsets, before.events + truth.events
        self._together = replace(truth, tally=tally, contact_onsets=onsets, events=events)

    def take(self) -> tuple[Truth, int]:
        """The last of them with what adds up over all, and how many; from here on it is the next ones."""
        together, ticks = self._together, self.ticks
        if together is None:
            raise ValueError("expected a tick")
        self.ticks, self._together = 0, None
        return together, ticks


class Sampling:
    """Glimpses of the first arena, out of the ticks of all."""

    def __init__(self, static: Static, selected: str) -> None:
        """Show of a large swarm the sensors of the robot `selected`."""
        self._static = static
        self._serial = 0
        self._links = RateLimit(LINKS_PER_S)
        self._selected = static.robot_names.index(selected)

    def glimpse(self, truth: Truth, ticks: int, values: FloatArray, now_ns: int) -> ObservedTick:
        """What is shown of a tick; `values` (series, arenas) were measured in it."""
        static = self._static
        links = static.robots <= FEW or self._links.due(now_ns)
        shown = truth_of(truth, static, ARENA)
        few = shown.finished is not None and len(shown.finished.fate) <= MAX_FINISHED
        shown = replace(shown, edges=shown.edges if links else None, finished=shown.finished if few else None)
        if static.robots > SMALL:
            index = living_robot(static, self._selected, shown.alive)
            shown = replace(shown, readings=readings_within(shown.readings, slice(index, index + 1)))
        self._serial += 1
        return ObservedTick(shown, self._serial - 1, ticks, values[:, ARENA : ARENA + 1])


LEAVE_TIMEOUT_S = 2.0  # of the last frame


class ObserverEndpoint:
    """The endpoint at which observers join a run: a socket of this machine, and those of `listen`."""

    def __init__(self, listen: ListenSettings | None = None) -> None:
        """Listen nowhere yet."""
        self._listen = listen or ListenSettings(())
        self._resources = ExitStack()
        self._opened: tuple[str, zenoh.Session] | None = None

    def open(self) -> tuple[str, zenoh.Session]:
        """Listen once; return the local address and the session. BadInput if an endpoint is in use."""
        if self._opened is None:
            with ExitStack() as resources:
                address = resources.enter_context(local_endpoint())
                self._opened = address, resources.enter_context(closed_after(self._session(address)))
                self._resources = resources.pop_all()
        return self._opened

    def close(self) -> None:
        """Close the endpoint; safe to call more than once."""
        self._resources.close()

    def _session(self, address: str) -> zenoh.Session:
        listen = self._listen
        try:
            return open_observed([address, *listen.endpoints], listen.network, listen.access)
        except zenoh.ZError as error:
            reason = str(error).split(" at ")[0]
            raise BadInput(
                "observed", ", ".join(listen.endpoints), f"expected endpoints that are free: {reason}"
            ) from error


class Published(Observer):
    """Observer that publishes the first arena of a run on an endpoint of its own, named by `live.json` in the folder.

    At most 30 ticks per second of wall time are published; nothing is encoded or counted without a viewer.
    Frames are encoded and sent in a thread of their own, and a tick that finds it busy is left out: an observer that is
    slow, frozen or dead does not hold the run. It publishes what `metrics` measured, so that must see each tick before.

    It begins before the run's agents are there, where they come from elsewhere.

    Summary part: `published`: `frames` sent, and `left_out`: due while the one before was not yet sent.
    """

    before_agents = True

    def __init__(
        self,
        folder: Path,
        run_id: str,
        metrics: Measured,
        clock: Clock,
        selected: str | None = None,
        declare: Callable[[zenoh.Session, ObserverKeys], object] | None = None,
        endpoint: ObserverEndpoint | None = None,
    ) -> None:
        """Publish a run; `selected` is the robot that is shown in detail.

        `declare` declares more queryables on the session, which exist as long as its result. `endpoint` may be open
        already.
        """
        self._endpoint = endpoint or ObserverEndpoint()
        self._declare_more = declare
        self._folder, self._run_id, self._metrics, self._clock = folder, run_id, metrics, clock
        self._selected = selected
        self._resources = ExitStack()
        self.frames = self.left_out = 0

    def begin(self, static: Static) -> None:
        """Write its address to the run folder; BadInput if there is no selected robot."""
        self._selected = selected_robot(static, self._selected, "live view")
        self._arenas = static.arenas
        self._sampling = Sampling(static, self._selected)
        self._since, self._rate = Since(), RateLimit(FRAMES_PER_S)
        self._watched = False
        self._newest: Truth | None = None
        self._fault: Exception | None = None
        self._frames: queue.Queue[ObservedTick | None] = queue.Queue(maxsize=1)
        with ExitStack() as resources:
            resources.callback(self._endpoint.close)
            address, session = self._endpoint.open()
            self._declare(session, encode_scene(self._scene(static)))
            resources.callback(forget_live, self._folder)
            Live(address, self._run_id, os.getpid()).write(self._folder)
            self._sender = threading.Thread(target=self._send_all, name="published", daemon=True)
            self._sender.start()
            resources.callback(self._stop_sender)
            self._resources = resources.pop_all()

    def see(self, truth: Truth) -> None:
        """Publish a tick if it is due and there is a viewer; none once the arena has left."""
        if not truth.running[ARENA]:
            return
        self._newest = truth
        if self._watched:
            self._since.add(truth)
        now_ns = self._clock.now_ns()
        if not self._rate.due(now_ns):
            return
        if self._fault is not None:
            raise self._fault
        watched_before, self._watched = self._watched, self._is_watched()
        if not self._watched:
            self._since = Since()
            return
        if not watched_before:
            self._since.add(truth)
        if self._frames.full():
            self.left_out += 1
            return
        self._put(now_ns)

    def catch_up(self) -> None:
        """Publish the newest tick, if it is not yet: the run is paused, and no other will follow.

        Nothing here raises: what fails does so in the next `see`.
        """
        if self._newest is None or self._fault is not None or self._frames.full():
            return
        watched_before, self._watched = self._watched, self._is_watched()
        if self._watched and not watched_before:
            self._since = Since()
            self._since.add(self._newest)
        if self._watched and self._since.ticks:
            try:
                self._put(self._clock.now_ns())
            except Exception as error:  # noqa: BLE001 - raised by `see`, which is guarded
                self._fault = error

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Publish the end of the run and close the endpoint; viewers learn that the run is over."""
        if self._watched and self._since.ticks and self._fault is None:
            self._put(self._clock.now_ns())
        self._resources.close()
        return {"published": {"frames": self.frames, "left_out": self.left_out}}

    def _put(self, now_ns: int) -> None:
        """Hand what has not been shown to the sender; at the end it may be busy for a while."""
        latest = self._metrics.latest
        measured = self._metrics.metrics
        values = np.array([latest[of.name] for of in measured]).reshape(len(measured), self._arenas)
        try:
            self._frames.put(self._sampling.glimpse(*self._since.take(), values, now_ns), timeout=LEAVE_TIMEOUT_S)
        except queue.Full:
            self.left_out += 1
        else:
            self.frames += 1

    def _is_watched(self) -> bool:
        status: Any = self._publisher.matching_status  # an object, where zenoh's stub promises a bool
        return status.matching

    def _scene(self, static: Static) -> ObservedRun:
        metrics = self._metrics.metrics
        series = tuple(MetricSeries(metric.name, metric.unit, _finite(*metric.bounds)) for metric in metrics)
        return ObservedRun(static_of(static, ARENA), series, self._selected or "")

    def _declare(self, session: zenoh.Session, scene: bytes) -> None:
        keys = ObserverKeys(self._run_id)
        # DROP is said though it is zenoh's default: to wait for an observer is the one thing that must not be.
        drop = zenoh.CongestionControl.DROP
        self._publisher = session.declare_publisher(keys.truth, congestion_control=drop)

        # Answered in zenoh's own thread, since the loop may be long in a tick, or paused.
        def answer(query: zenoh.Query) -> None:
            query.reply(keys.scene, scene)

        self._declared = (
            session.declare_queryable(keys.scene, zenoh.handlers.Callback(answer, indirect=False)),
            self._declare_more(session, keys) if self._declare_more else None,
            session.liveliness().declare_token(keys.published),  # last: it says that all is there
        )

    def _send_all(self) -> None:
        try:
            while (glimpse := self._frames.get()) is not None:
                self._publisher.put(encode_truth(glimpse))
        except Exception as error:  # noqa: BLE001 - the loop's thread raises it
            self._fault = error

    def _stop_sender(self) -> None:
        with suppress(queue.Full):  # it has failed, or is still busy: the closed session ends it
            self._frames.put(None, timeout=LEAVE_TIMEOUT_S)
        self._sender.join(LEAVE_TIMEOUT_S)


def _finite(*bounds: float | None) -> tuple[float | None, float | None]:
    least, largest = (None if bound is None or isinf(bound) else bound for bound in bounds)
    return least, largest
