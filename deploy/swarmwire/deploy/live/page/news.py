"""The data of the page: a run's constants, and its status, robots and packets as news from a separate thread."""

import asyncio
import threading
from collections import deque
from collections.abc import AsyncGenerator, Callable, Mapping, Sequence
from math import nan
from typing import Any

import numpy as np

from swarmwire.comms.base.clock import NS_PER_S, Clock
from swarmwire.comms.base.errors import SwarmwireError
from swarmwire.comms.observe.run_views import ObservedRun, ObservedTick
from swarmwire.comms.observe.truth import EventRecord, Static
from swarmwire.comms.robot.packets import Fate
from swarmwire.deploy.live.remote_control import RemoteControl
from swarmwire.metrics.text import abbreviate

POLL_S = 0.2
MAX_HISTORY = 240  # earlier values of each number for a page that is opened later
SPEED_NS = NS_PER_S  # wall time over which the speed is measured

News = dict[str, Any]


def facts(scene: ObservedRun) -> Mapping[str, Any]:
    """Return the constants of a run for the page."""
    static = scene.static
    return {
        "name": static.name,
        "seed": static.seeds[0],
        "rate_hz": static.rate_hz,
        "arena_m": list(static.arena_size_m),
        "robots": list(static.robot_names),
        "groups": [group.name for group in static.groups],
        "series": [
            {"name": series.name, "unit": series.unit, "bounds": list(series.bounds)} for series in scene.series
        ],
        "obstacles": [
            {"x": obstacle.x_m, "y": obstacle.y_m, "radius": obstacle.radius_m, "corners": obstacle.corners_m.tolist()}
            for obstacle in static.fixed(0)
        ],
    }


class NewsThread(threading.Thread):
    """Thread that polls the status of a run until the run is over or `close` is called, and sends it to all readers.

    A run that does not answer is "silent", since it may be frozen, or over if `over()` returns True.

    Attributes:
        latest: the latest message.
        history: earlier numbers, by tick.
    """

    def __init__(
        self,
        control: RemoteControl,
        seen: Callable[[], Mapping[str, Any]],
        clock: Clock,
        over: Callable[[], bool] = lambda: True,
    ) -> None:
        """`seen` returns further numbers of the page, `over` True if a run that does not answer has ended."""
        super().__init__(name="news", daemon=True)
        self._control, self._seen, self._clock, self._over = control, seen, clock, over
        self.latest: News = {}
        self.history: deque[News] = deque(maxlen=MAX_HISTORY)
        self._marks: deque[tuple[int, float]] = deque(maxlen=50)  # wall time in ns, simulated time in s
        self._readers: dict[asyncio.Queue[News | None], asyncio.AbstractEventLoop] = {}
        self._lock = threading.Lock()
        self._look = threading.Event()
        self._closed = False

    def run(self) -> None:
        """Poll the status and publish it."""
        while not self._closed:
            try:
                status = dict(self._control.status())
            except SwarmwireError as error:  # the page keeps the latest numbers
                status = {**self.latest, "state": "over" if self._over() else "silent", "gone": str(error)}
            self._publish(status)
            if status["state"] == "over":
                return
            self._look.wait(POLL_S)
            self._look.clear()

    @property
    def readers(self) -> int:
        """Number of open pages."""
        return len(self._readers)

    def look(self) -> None:
        """Poll at once, after a command to the run."""
        self._look.set()

    def close(self) -> None:
        """End the news; safe to call more than once."""
        self._closed = True
        self._look.set()
        if self.is_alive():
            self.join()
        with self._lock:
            for queue, loop in self._readers.items():
                loop.call_soon_threadsafe(_put, queue, None)

    async def read(self) -> AsyncGenerator[News]:
        """Yield the latest news, then news as it arrives; a slow reader misses some."""
        queue: asyncio.Queue[News | None] = asyncio.Queue(maxsize=1)
        with self._lock:
            self._readers[queue] = asyncio.get_running_loop()
            if self.latest:
                _put(queue, self.latest)
        try:
            while (news := await queue.get()) is not None:
                yield news
        finally:
            with self._lock:
                del self._readers[queue]

    def _publish(self, status: News) -> None:
        news = {**status, **self._seen(), "speed_now": self._speed(status)}
        with self._lock:
            if news.get("tick") != self.latest.get("tick"):
                self.history.append(_numbers(news))
            self.latest = news
            for queue, loop in self._readers.items():
                loop.call_soon_threadsafe(_put, queue, news)

    def _speed(self, status: News) -> float | None:
        """Return simulated s per s of wall time over the last second; None while unknown."""
        now_ns, time_s = self._clock.now_ns(), float(status.get("time_s", nan))
        if status["state"] == "compiling":  # no time passes in the run
            self._marks.clear()
        self._marks.append((now_ns, time_s))
        while len(self._marks) > 2 and self._marks[1][0] <= now_ns - SPEED_NS:
            self._marks.popleft()
        since_ns, since_s = self._marks[0]
        return (time_s - since_s) * NS_PER_S / (now_ns - since_ns) if now_ns > since_ns else None


def _numbers(news: News) -> News:
    """Return the numbers with curves."""
    tick_ms = news.get("measures_ms")
    return {"link_pdr": news.get("link_pdr"), "alive": news.get("alive"), "tick_ms": tick_ms, **news.get("metrics", {})}


def _put(queue: asyncio.Queue[News | None], news: News | None) -> None:
    if queue.full():
        queue.get_nowait()
    queue.put_nowait(news)


MAX_NAMED = 5  # names of robots of an event
MAX_EVENTS = 200  # the status has the same limit
MAX_POSITIONS = 500  # robots on the small map


class TickNumbers:
    """The numbers of the latest tick. Written by the thread that draws, read by any other."""

    def __init__(self, static: Static) -> None:
        self._rate_hz = static.rate_hz
        self._second: deque[tuple[int, int, int]] = deque()  # tick, received, in range
        self._step = -(-static.robots // MAX_POSITIONS)
        self._static = static
        self._robots_by_event: dict[str, str] = {}
        self.numbers: dict[str, Any] = {"centre": None, "places": [], "link_pdr": None, "who": {}}

    def see(self, observed: ObservedTick) -> None:
        """Update the numbers with a tick."""
        truth = observed.truth
        position_m, alive = np.asarray(truth.pose)[:, :2], np.asarray(truth.alive)
        living_m = position_m[alive]
        shown = slice(None, None, self._step)
        self.numbers = {
            "centre": living_m.mean(axis=0).round(3).tolist() if len(living_m) else None,
            "places": [
                [*position, bool(is_alive)]
                for position, is_alive in zip(position_m[shown].round(2).tolist(), alive[shown], strict=True)
            ],
            "link_pdr": self._link_pdr(observed),
            "who": self._changed_robots(truth.events),
        }

    def _changed_robots(self, events: Sequence[EventRecord]) -> dict[str, str]:
        """Return the robots that each event changed at its start, by the event's number."""
        begun = {str(event.serial): changed_robots(event, self._static) for event in events if not event.ended}
        if begun:
            self._robots_by_event = dict([*self._robots_by_event.items(), *begun.items()][-MAX_EVENTS:])
        return self._robots_by_event

    def _link_pdr(self, observed: ObservedTick) -> float | None:
        """Return received / in range over the last simulated second; None without receivers in range."""
        truth = observed.truth
        if truth.tally is not None:
            received, in_range = int(truth.tally.fates[:, Fate.RECEIVED].sum()), int(truth.tally.in_range.sum())
            self._second.append((truth.tick, received, in_range))
        while self._second and self._second[0][0] <= truth.tick - self._rate_hz:
            self._second.popleft()
        reached = sum(in_range for _, _, in_range in self._second)
        return sum(received for _, received, _ in self._second) / reached if reached else None


def changed_robots(event: EventRecord, static: Static) -> str:
    """Return a text on the robots that an event changed."""
    changed = event.changed_names(static)[0]
    if not changed:
        return "none"
    if len(changed) == static.robots:
        return "all"
    return abbreviate(changed, MAX_NAMED)
