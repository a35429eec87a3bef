"""A run published for observers: viewers connect from their own processes and do not affect the run.

Counts of packets, contacts and events of ticks that are not published are added to the next published tick; links that
ended have the state of that tick alone.
"""

# pyright: reportUnknownMemberType=false
# zenoh's stubs omit the return types of put, reply and close.

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
from swarmwire.deploy.runs.live_address import Live, local_endpoint, remove_live, write_live
from swarmwire.metrics.measures.measure import MetricValues
from swarmwire.metrics.pictures.viewer.selection import ARENA, living_robot, selected_robot
from swarmwire.world.backends.join_policy import ListenSettings

FRAMES_PER_S = 30
LINKS_PER_S = 5  # rate of links in large swarms, where they are most of a frame
MAX_ROBOTS_WITH_LINKS = 200  # robots of a swarm whose frames all have the links
MAX_ROBOTS_WITH_READINGS = 50  # robots of a swarm whose frames have the readings of all; others have those of one
MAX_FINISHED = 2000  # packets that end in a tick; frames with more have none of them


@dataclass(slots=True)
class RateLimit:
    """Limits the rate of an action."""

    per_s: int
    next_ns: int = 0

    def due(self, now_ns: int) -> bool:
        """Return True if the action may be done now, which delays the next one."""
        if now_ns < self.next_ns:
            return False
        self.next_ns = now_ns + NS_PER_S // self.per_s
        return True


class PendingTicks:
    """The ticks since the last published one, joined."""

    def __init__(self) -> None:
        self.ticks = 0
        self._joined: Truth | None = None

    def add(self, truth: Truth) -> None:
        """Add a tick."""
        self.ticks += 1
        before = self._joined
        if before is None:
            self._joined = truth
            return
        tally = before.tally and truth.tally and before.tally + truth.tally
        onsets, events = before.contact_onsets + truth.contact_onsets, before.events + truth.events
        self._joined = replace(truth, tally=tally, contact_onsets=onsets, events=events)

    def pop(self) -> tuple[Truth, int]:
        """Return the latest tick with the sums over all, and the number of ticks; then there are none."""
        joined, ticks = self._joined, self.ticks
        if joined is None:
            raise ValueError("expected a tick")
        self.ticks, self._joined = 0, None
        return joined, ticks


class Sampling:
    """Makes frames of the first arena from the ticks of all arenas."""

    def __init__(self, static: Static, selected: str) -> None:
        """Make frames of a run; those of a large swarm have the readings of the robot `selected`."""
        self._static = static
        self._serial = 0
        self._link_limit = RateLimit(LINKS_PER_S)
        self._selected = static.robot_names.index(selected)

    def frame(self, truth: Truth, ticks: int, values: FloatArray, now_ns: int) -> ObservedTick:
        """Return the frame of a tick; `values` (series, arenas) are its metrics."""
        static = self._static
        has_links = static.robots <= MAX_ROBOTS_WITH_LINKS or self._link_limit.due(now_ns)
        shown = truth_of(truth, static, ARENA)
        has_finished = shown.finished is not None and len(shown.finished.fate) <= MAX_FINISHED
        edges, finished = shown.edges if has_links else None, shown.finished if has_finished else None
        shown = replace(shown, edges=edges, finished=finished)
        if static.robots > MAX_ROBOTS_WITH_READINGS:
            index = living_robot(static, self._selected, shown.alive)
            shown = replace(shown, readings=readings_within(shown.readings, slice(index, index + 1)))
        self._serial += 1
        return ObservedTick(shown, self._serial - 1, ticks, values[:, ARENA : ARENA + 1])


LEAVE_TIMEOUT_S = 2.0  # time for sending the last frame


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
    """Observer that publishes the first arena of a run at the endpoint that `live.json` in the folder names.

    At most 30 ticks per second of wall time are published; nothing is encoded or counted without a viewer. A thread
    encodes and sends the frames, and a tick that finds it busy is left out, so that a viewer that is slow, frozen or
    dead does not delay the run. `metrics` must see each tick before.

    Summary part: `published`: `frames` sent, and `left_out`: frames that were due before the last one was sent.
    """

    before_agents = True

    def __init__(
        self,
        folder: Path,
        run_id: str,
        metrics: MetricValues,
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
        """Write the address to the run folder and start publishing; BadInput for an unknown selected robot."""
        self._selected = selected_robot(static, self._selected, "live view")
        self._arenas = static.arenas
        self._sampling = Sampling(static, self._selected)
        self._pending, self._rate = PendingTicks(), RateLimit(FRAMES_PER_S)
        self._has_viewer = False
        self._newest: Truth | None = None
        self._fault: Exception | None = None
        self._frames: queue.Queue[ObservedTick | None] = queue.Queue(maxsize=1)
        with ExitStack() as resources:
            resources.callback(self._endpoint.close)
            address, session = self._endpoint.open()
            self._declare(session, encode_scene(self._scene(static)))
            resources.callback(remove_live, self._folder)
            write_live(Live(address, self._run_id, os.getpid()), self._folder)
            self._sender = threading.Thread(target=self._send_all, name="published", daemon=True)
            self._sender.start()
            resources.callback(self._stop_sender)
            self._resources = resources.pop_all()

    def see(self, truth: Truth) -> None:
        """Publish the tick if it is due and there is a viewer, unless the arena has left."""
        if not truth.running[ARENA]:
            return
        self._newest = truth
        if self._has_viewer:
            self._pending.add(truth)
        now_ns = self._clock.now_ns()
        if not self._rate.due(now_ns):
            return
        if self._fault is not None:
            raise self._fault
        had_viewer, self._has_viewer = self._has_viewer, self._find_viewer()
        if not self._has_viewer:
            self._pending = PendingTicks()
            return
        if not had_viewer:
            self._pending.add(truth)
        if self._frames.full():
            self.left_out += 1
            return
        self._put(now_ns)

    def catch_up(self) -> None:
        """Publish the newest tick of a paused run, which no other tick follows, unless it is published.

        An error is raised in the next `see`.
        """
        if self._newest is None or self._fault is not None or self._frames.full():
            return
        had_viewer, self._has_viewer = self._has_viewer, self._find_viewer()
        if self._has_viewer and not had_viewer:
            self._pending = PendingTicks()
            self._pending.add(self._newest)
        if self._has_viewer and self._pending.ticks:
            try:
                self._put(self._clock.now_ns())
            except Exception as error:  # noqa: BLE001 - raised by `see`, which is guarded
                self._fault = error

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Publish the last tick, and close the endpoint, by which viewers notice the end."""
        if self._has_viewer and self._pending.ticks and self._fault is None:
            self._put(self._clock.now_ns())
        self._resources.close()
        return {"published": {"frames": self.frames, "left_out": self.left_out}}

    def _put(self, now_ns: int) -> None:
        """Pass the pending ticks to the sending thread, which may be busy for a while at the end."""
        latest = self._metrics.latest
        metrics = self._metrics.metrics
        values = np.array([latest[metric.name] for metric in metrics]).reshape(len(metrics), self._arenas)
        try:
            self._frames.put(self._sampling.frame(*self._pending.pop(), values, now_ns), timeout=LEAVE_TIMEOUT_S)
        except queue.Full:
            self.left_out += 1
        else:
            self.frames += 1

    def _find_viewer(self) -> bool:
        status: Any = self._publisher.matching_status  # zenoh's stub declares a bool
        return status.matching

    def _scene(self, static: Static) -> ObservedRun:
        metrics = self._metrics.metrics
        series = tuple(MetricSeries(metric.name, metric.unit, _finite(*metric.bounds)) for metric in metrics)
        return ObservedRun(static_of(static, ARENA), series, self._selected or "")

    def _declare(self, session: zenoh.Session, scene: bytes) -> None:
        keys = ObserverKeys(self._run_id)
        # Explicit, though it is zenoh's default, since the run must never wait for an observer.
        drop = zenoh.CongestionControl.DROP
        self._publisher = session.declare_publisher(keys.truth, congestion_control=drop)

        # zenoh's thread answers, since the loop may be in a long tick, or paused.
        def answer(query: zenoh.Query) -> None:
            query.reply(keys.scene, scene)

        self._declared = (
            session.declare_queryable(keys.scene, zenoh.handlers.Callback(answer, indirect=False)),
            self._declare_more(session, keys) if self._declare_more else None,
            session.liveliness().declare_token(keys.published),  # last: it announces that all queryables exist
        )

    def _send_all(self) -> None:
        try:
            while (frame := self._frames.get()) is not None:
                self._publisher.put(encode_truth(frame))
        except Exception as error:  # noqa: BLE001 - the loop's thread raises it
            self._fault = error

    def _stop_sender(self) -> None:
        with suppress(queue.Full):  # a thread that failed or is busy ends with the session
            self._frames.put(None, timeout=LEAVE_TIMEOUT_S)
        self._sender.join(LEAVE_TIMEOUT_S)


def _finite(*bounds: float | None) -> tuple[float | None, float | None]:
    least, largest = (None if bound is None or isinf(bound) else bound for bound in bounds)
    return least, largest
