"""The crew of a run some of whose robots answer as real ones: foreign programs drive them, and nobody waits for those.

    a tick begins     poses, readings and packets heard go out
    it is over        by the wall clock: commands and packets that have come by then are taken

So what is commanded while a tick goes on is done from its start, like the answers of runners in real time.

A loop that lags by more than a tick does not make up for it: robots that moved for seconds in an instant, by commands
of before, would be none that a program could drive.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from swarmwire.comms.arrays import BoolArray, IntArray
from swarmwire.comms.clock import tick_start_ns, to_s
from swarmwire.comms.outcomes import NO_OUTCOMES, Outcomes
from swarmwire.comms.packets import Heard, Sent
from swarmwire.comms.protocols import Crew
from swarmwire.comms.senses import Actions, Senses
from swarmwire.world.crews.pace import Pace
from swarmwire.world.crews.realtime_crew import RealTimeReport
from swarmwire.world.gateways.gateway_group import GatewayGroup

CARRIED = ("packets_to_robots", "packets_from_robots")  # which is no fault


class RobotsAir(Protocol):
    """The world's air as robots behind gateways have it; `AirBridge` is one."""

    def publish(self, tick: int, heard: Heard, outcomes: Outcomes) -> None:
        """Hand out what these robots heard, and learn of packets that they sent."""
        ...

    def take(self) -> Sent:
        """The packets that they sent since it was asked last."""
        ...

    def counts(self) -> dict[str, int]:
        """What went wrong on the way, by name."""
        ...


class GatewayCrew:
    """The robots of some groups behind gateways, all others played by another crew, in one arena and in real time."""

    def __init__(
        self,
        inner: Crew,
        groups: Sequence[GatewayGroup],
        air: RobotsAir | None,
        pace: Pace,
        rate_hz: int,
        show: Callable[[], None] = lambda: None,
        show_counts: Callable[[], dict[str, int]] = dict,
    ) -> None:
        """`inner` plays all other groups; `show` is called at the start of each tick, before anything goes out.

        `show_counts` tells what went wrong there, by name. Gateways and air are open already, and are closed by
        whoever opened them.
        """
        self._inner, self._groups, self._air, self._pace, self._show = inner, groups, air, pace, show
        self._rate_hz, self._show_counts = rate_hz, show_counts
        self._names = frozenset(group.name for group in groups)
        self._rows = np.sort(np.concatenate([group.rows for group in groups]))
        self.start, self.close = inner.start, inner.close

    def act(self, tick: int, senses: Senses, heard: Heard, outcomes: Outcomes = NO_OUTCOMES) -> Actions:
        """What agents here decided, and what foreign programs told the other robots in this tick."""
        self._pace.begin()
        self._show()
        for group in self._groups:
            group.publish(tick_start_ns(tick, self._rate_hz), senses)
        if self._air:
            self._air.publish(tick, heard.select(self._own(heard.receiver)), outcomes.select(self._own(outcomes.row)))
        others = {name: of for name, of in senses.items() if name not in self._names}
        actions = self._inner.act(tick, others, heard, outcomes)
        self._hold(tick)
        told = Actions.joined([actions, *(group.take() for group in self._groups)])
        return replace(told, sent=Sent.joined([told.sent, self._air.take()])) if self._air else told

    def counts(self) -> dict[str, int]:
        """Faults of the inner crew, of gateways by their kind, of what is shown, and of the air between."""
        found = Counter(self._inner.counts())
        found.update(self._show_counts())
        for group in self._groups:
            found.update({f"{group.kind}_{name}": count for name, count in group.gateway.counts().items()})
        if self._air:
            found.update({f"air_{name}": count for name, count in self._air.counts().items() if name not in CARRIED})
        return {name: count for name, count in found.items() if count}

    def report(self) -> RealTimeReport:
        """How far the loop kept up."""
        return RealTimeReport(self._pace.factor, self._pace.missed_ticks, to_s(self._pace.worst_lag_ns))

    def _hold(self, tick: int) -> None:
        """Return once the tick is over by the wall clock."""
        pace = self._pace
        pace.hold(tick)
        if pace.lag_ns > tick_start_ns(1, self._rate_hz) / pace.factor:
            pace.begin_anew(tick + 1, pace.factor)

    def _own(self, rows: IntArray) -> IntArray:
        """Which of these rows (k,) are of robots behind gateways."""
        mine: BoolArray = np.isin(rows, self._rows)
        return np.flatnonzero(mine)
