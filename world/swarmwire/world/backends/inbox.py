"""A bounded queue between the network's threads and the loop, with limits per runner.

A runner that sends too much fills only its share, so memory stays bounded and other runners are not affected. The
inbox counts dropped items by name. A dropped liveliness token shows as the time-out of its runner.
"""

import queue
import threading
from collections import Counter
from collections.abc import Callable

import zenoh

from swarmwire.comms.wire.keys import runner_of
from swarmwire.comms.wire.limits import LIMITS, JoinLimits

Item = zenoh.Sample | zenoh.Query


class RunnerInbox:
    """The runners' answers, tokens and requests, in the order in which they arrived.

    Attributes:
        arrived_ns: time of arrival of the item that `get` returned last.
    """

    def __init__(self, limits: JoinLimits = LIMITS, now_ns: Callable[[], int] = lambda: 0) -> None:
        """`now_ns` is the clock for `arrived_ns`."""
        self._limits, self._now_ns, self.arrived_ns = limits, now_ns, 0
        self._arrived: queue.SimpleQueue[tuple[str, int, int, Item]] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._queued: dict[str, tuple[int, int]] = {}  # runner -> number of items, and their bytes
        self._requests: Counter[str] = Counter()
        self._dropped: Counter[str] = Counter()
        self._dropped_by_runner: Counter[str] = Counter()

    def put(self, item: Item) -> None:
        """Add an item, or drop it if its runner is over a limit. Called from the network's threads; does not block."""
        runner, payload = runner_of(str(item.key_expr)), item.payload
        size = 0 if payload is None else len(payload)
        limits = self._limits
        with self._lock:
            if isinstance(item, zenoh.Query) and not self._accepts_request(runner):
                self._drop("flooded_requests", runner)
                return  # dropping the query ends the request without an answer
            items, queued_bytes = self._queued.get(runner, (0, 0))
            if items >= limits.waiting or (items and queued_bytes + size > limits.waiting_bytes):
                self._drop("flooded_frames", runner)
                return
            self._queued[runner] = items + 1, queued_bytes + size
        self._arrived.put((runner, size, self._now_ns(), item))

    def get(self, timeout: float | None = None) -> Item:
        """Return the next item; queue.Empty after `timeout` seconds."""
        runner, size, self.arrived_ns, item = self._arrived.get(timeout=timeout)
        with self._lock:
            items, queued_bytes = self._queued.pop(runner)
            if items > 1:
                self._queued[runner] = items - 1, queued_bytes - size
        return item

    def qsize(self) -> int:
        """Return the approximate number of queued items."""
        return self._arrived.qsize()

    def rate_limited(self) -> set[str]:
        """Return the runners with more dropped items than the flood limit, which no mistake explains."""
        with self._lock:
            return {runner for runner, dropped in self._dropped_by_runner.items() if dropped > self._limits.flood}

    def counts(self) -> dict[str, int]:
        """Return the numbers of dropped items, by name."""
        with self._lock:
            return dict(self._dropped)

    def _accepts_request(self, runner: str) -> bool:
        if runner not in self._requests and len(self._requests) >= self._limits.names:
            return False
        self._requests[runner] += 1
        return self._requests[runner] <= self._limits.requests

    def _drop(self, name: str, runner: str) -> None:
        self._dropped[name] += 1
        if runner in self._dropped_by_runner or len(self._dropped_by_runner) < self._limits.names:
            self._dropped_by_runner[runner] += 1
