"""What is to happen when: generators that act, and yield how many seconds they wait before they act again."""

import heapq
from collections.abc import Generator
from itertools import count

from swarmwire.comms.clock import to_ns

Steps = Generator[float]


class Agenda:
    """Generators that are under way, each taken up again when it is due."""

    def __init__(self) -> None:
        self._due: list[tuple[int, int, Steps]] = []
        self._serial = count()

    def begin(self, steps: Steps, now_ns: int) -> None:
        """Have it act now, and go on when it wants to."""
        wait_s = next(steps, None)
        if wait_s is not None:
            heapq.heappush(self._due, (now_ns + to_ns(wait_s), next(self._serial), steps))

    def step(self, now_ns: int) -> None:
        """All that is due."""
        while self._due and self._due[0][0] <= now_ns:
            self.begin(heapq.heappop(self._due)[2], now_ns)
