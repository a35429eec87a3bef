"""What the page shows of a run: its constants; its status, robots and packets as news, from a thread of its own."""

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
from swarmwire.metrics.records.run_folder.events import changed_names
from swarmwire.metrics.text import some

EVERY_S = 0.2  # between two looks
KEPT = 240  # values of each number that a page that is opened later still gets
SPEED_NS = NS_PER_S  # of wall time over which the speed is measured

News = dict[str, Any]


def facts(scene: ObservedRun) -> Mapping[str, Any]:
    """The constants of a run, as sent to the page."""
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
            {"x": one.x_m, "y": one.y_m, "radius": one.radius_m, "corners": one.corners_m.tolist()}
            for one in static.fixed(0)
        ],
    }


class NewsThread(threading.Thread):
    """Asks for the status of a run until the run is over or `close` is called, and hands it to all that read.

    A run that does not answer is "silent" until it does, for it may be frozen; it is over once `over()` says so, too.

    Attributes:
        latest: the last message.
        history: what the numbers were, by tick, as far as it is kept.
    """

    def __init__(
        self,
        control: RemoteControl,
        seen: Callable[[], Mapping[str, Any]],
        clock: Clock,
        over: Callable[[], bool] = lambda: True,
    ) -> None:
        """`seen` tells what else there is to tell at each look, `over` whether a run that does not answer is gone."""
        super().__init__(name="news", daemon=True)
        self._control, self._seen, self._clock, self._over = control, seen, clock, over
        self.latest: News = {}
        self.history: deque[News] = deque(maxlen=KEPT)
        self._marks: deque[tuple[int, float]] = deque(maxlen=50)  # wall time in ns, simulated time in s
        self._readers: dict[asyncio.Queue[News | None], asyncio.AbstractEventLoop] = {}
        self._lock = threading.Lock()
        self._look = threading.Event()
        self._closed = False

    def run(self) -> None:
        """Read the state, publish it, wait."""
        while not self._closed:
            try:
                status = dict(self._control.status())
            except SwarmwireError as error:  # what is known of it stays
                status = {**self.latest, "state": "over" if self._over() else "silent", "gone": str(error)}
            self._tell(status)
            if status["state"] == "over":
                return
            self._look.wait(EVERY_S)
            self._look.clear()

    @property
    def readers(self) -> int:
        """How many pages are open."""
        return len(self._readers)

    def look(self) -> None:
        """Look at once: something was asked of the run."""
        self._look.set()

    def close(self) -> None:
        """No more news; safe to call more than once."""
        self._closed = True
        self._look.set()
        if self.is_alive():
            self.join()
        with self._lock:
            for queue, loop in self._readers.items():
                loop.call_soon_threadsafe(_put, queue, None)

    async def read(self) -> AsyncGenerator[News]:
        """The news as it comes, beginning with the newest; what a slow reader missed is left out."""
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

    def _tell(self, status: News) -> None:
        news = {**status, **self._seen(), "speed_now": self._speed(status)}
        with self._lock:
            if news.get("tick") != self.latest.get("tick"):
                self.history.append(_numbers(news))
            self.latest = news
            for queue, loop in self._readers.items():
                loop.call_soon_threadsafe(_put, queue, news)

    def _speed(self, status: News) -> float | None:
        """Simulated s per s of wall time over the last second; None while nothing is known."""
        now_ns, time_s = self._clock.now_ns(), float(status.get("time_s", nan))
        if status["state"] == "compiling":  # no time passes in the run
            self._marks.clear()
        self._marks.append((now_ns, time_s))
        while len(self._marks) > 2 and self._marks[1][0] <= now_ns - SPEED_NS:
            self._marks.popleft()
        since_ns, since_s = self._marks[0]
        return (time_s - since_s) * NS_PER_S / (now_ns - since_ns) if now_ns > since_ns else None


def _numbers(news: News) -> News:
    """What is drawn as a curve."""
    tick_ms = news.get("measures_ms")
    return {"link_pdr": news.get("link_pdr"), "alive": news.get("alive"), "tick_ms": tick_ms, **news.get("metrics", {})}


def _put(queue: asyncio.Queue[News | None], news: News | None) -> None:
    if queue.full():
        queue.get_nowait()
    queue.put_nowait(news)


NAMED = 5  # robots of an event, at most
MAX_WHO = 200  # events; the status tells of no more either
MAX_PLACES = 500  # robots: of more, the small map shows only some


class Seen:
    """The newest glimpse, in numbers. Written by the thread that draws, read by any other."""

    def __init__(self, static: Static) -> None:
        self._rate_hz = static.rate_hz
        self._second: deque[tuple[int, int, int]] = deque()  # tick, received, in range
        self._every = -(-static.robots // MAX_PLACES)
        self._static = static
        self._who: dict[str, str] = {}
        self.numbers: dict[str, Any] = {"centre": None, "places": [], "link_pdr": None, "who": {}}

    def see(self, glimpse: ObservedTick) -> None:
        """Take one more."""
        truth = glimpse.truth
        places, alive = np.asarray(truth.pose)[:, :2], np.asarray(truth.alive)
        living = places[alive]
        shown = slice(None, None, self._every)
        self.numbers = {
            "centre": living.mean(axis=0).round(3).tolist() if len(living) else None,
            "places": [
                [*place, bool(lives)]
                for place, lives in zip(places[shown].round(2).tolist(), alive[shown], strict=True)
            ],
            "link_pdr": self._link_pdr(glimpse),
            "who": self._whom(truth.events),
        }

    def _whom(self, events: Sequence[EventRecord]) -> dict[str, str]:
        """Whom each event changed when it began, by its number."""
        begun = {str(event.serial): whom(event, self._static) for event in events if not event.ended}
        if begun:  # of those that began before, the newest, as the status tells of no others
            self._who = dict([*self._who.items(), *begun.items()][-MAX_WHO:])
        return self._who

    def _link_pdr(self, glimpse: ObservedTick) -> float | None:
        """Received over in range in the last simulated second; None if none was in range."""
        truth = glimpse.truth
        if truth.tally is not None:
            received, in_range = int(truth.tally.fates[:, Fate.RECEIVED].sum()), int(truth.tally.in_range.sum())
            self._second.append((truth.tick, received, in_range))
        while self._second and self._second[0][0] <= truth.tick - self._rate_hz:
            self._second.popleft()
        reached = sum(in_range for _, _, in_range in self._second)
        return sum(received for _, received, _ in self._second) / reached if reached else None


def whom(event: EventRecord, static: Static) -> str:
    """The robots that an event changed, in words."""
    changed = changed_names(event, static)[0]
    if not changed:
        return "none"
    if len(changed) == static.robots:
        return "all"
    return some(changed, NAMED)
