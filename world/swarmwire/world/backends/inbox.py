"""What arrives from runners, between the network's threads and the loop: so much of each runner waits, and no more.

A runner that sends more than it is asked for takes nobody else's place and no memory without bound. What is dropped is
counted by name; a token that is dropped shows in the time-out of its runner.
"""

import queue
import threading
from collections import Counter
from collections.abc import Callable

import zenoh

from swarmwire.comms.wire.join import LIMITS, JoinLimits
from swarmwire.comms.wire.keys import runner_of

Item = zenoh.Sample | zenoh.Query


class RunnerInbox:
    """The runners' answers, tokens and requests, in the order in which they arrived.

    Attributes:
        arrived_ns: when the item that was got last arrived.
    """

    def __init__(self, limits: JoinLimits = LIMITS, now_ns: Callable[[], int] = lambda: 0) -> None:
        """`now_ns` tells the time, where it matters when something arrives."""
        self._limits, self._now_ns, self.arrived_ns = limits, now_ns, 0
        self._arrived: queue.SimpleQueue[tuple[str, int, int, Item]] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._waiting: dict[str, tuple[int, int]] = {}  # of each runner: items, and their bytes
        self._asked: Counter[str] = Counter()
        self._dropped: Counter[str] = Counter()
        self._beyond: Counter[str] = Counter()  # what was dropped of each runner

    def put(self, item: Item) -> None:
        """Called from the network's threads; it returns at once."""
        runner, payload = runner_of(str(item.key_expr)), item.payload
        size = 0 if payload is None else len(payload)
        limits = self._limits
        with self._lock:
            if isinstance(item, zenoh.Query) and not self._may_ask(runner):
                self._drop("flooded_requests", runner)
                return  # the asker gets no answer as soon as nobody holds the query
            items, waiting_bytes = self._waiting.get(runner, (0, 0))
            if items >= limits.waiting or (items and waiting_bytes + size > limits.waiting_bytes):
                self._drop("flooded_frames", runner)
                return
            self._waiting[runner] = items + 1, waiting_bytes + size
        self._arrived.put((runner, size, self._now_ns(), item))

    def get(self, timeout: float | None = None) -> Item:
        """The next item; queue.Empty if there is none in time."""
        runner, size, self.arrived_ns, item = self._arrived.get(timeout=timeout)
        with self._lock:
            items, waiting_bytes = self._waiting.pop(runner)
            if items > 1:
                self._waiting[runner] = items - 1, waiting_bytes - size
        return item

    def qsize(self) -> int:
        """How many wait, about."""
        return self._arrived.qsize()

    def flooding(self) -> set[str]:
        """Runners of which so much was dropped that no mistake explains it."""
        with self._lock:
            return {runner for runner, dropped in self._beyond.items() if dropped > self._limits.flood}

    def counts(self) -> dict[str, int]:
        """What was dropped, by name."""
        with self._lock:
            return dict(self._dropped)

    def _may_ask(self, runner: str) -> bool:
        if runner not in self._asked and len(self._asked) >= self._limits.names:
            return False
        self._asked[runner] += 1
        return self._asked[runner] <= self._limits.requests

    def _drop(self, what: str, runner: str) -> None:
        self._dropped[what] += 1
        if runner in self._beyond or len(self._beyond) < self._limits.names:
            self._beyond[runner] += 1
