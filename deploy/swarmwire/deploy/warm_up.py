"""A rehearsal: some ticks apart from the run, so that what a machine has not compiled yet is not compiled within it.

Otherwise a robot driven in real time would not react for half a minute, and the run would stay late.
"""

from collections.abc import Iterable

import numpy as np

from swarmwire.comms.packets import BROADCAST, NO_TX_STATUSES, Payloads, ReceivedPackets, SentPackets, TxStatuses
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.tick_io import Actions, Readings
from swarmwire.comms.truth import Static
from swarmwire.metrics.measure import Metrics
from swarmwire.metrics.metric import Metric
from swarmwire.metrics.network.latency import RadioTally
from swarmwire.world.loop import Loop
from swarmwire.world.world import World

TICKS = 5  # by which packets of the first have come, and are over
PACKET = b"\0"


def warm_up(world: World, medium: RadioMedium | None, metrics: Iterable[Metric]) -> None:
    """Run a temporary world and medium: every robot drives and sends, and metrics are measured."""
    observers = [Metrics(tuple(metrics)), RadioTally()]
    for observer in observers:
        observer.begin(world.static)
    Loop(world, medium, _Extras(world.static, sends=medium is not None), observers).run(TICKS)


class _Extras:
    """A backend that drives and sends, whatever it is told."""

    def __init__(self, static: Static, *, sends: bool) -> None:
        rows = np.arange(static.arenas * static.robots)
        still = np.zeros(len(rows))
        packets = SentPackets(rows, np.full(len(rows), BROADCAST), Payloads.of([PACKET] * len(rows)))
        sent = packets if sends else SentPackets.none()
        self._actions = Actions(rows, np.ones(len(rows), np.bool_), still + 0.01, still, still, sent)

    def start(self) -> None:
        """They are ready."""

    def act(
        self, tick: int, readings: Readings, received: ReceivedPackets, tx_status: TxStatuses = NO_TX_STATUSES
    ) -> Actions:
        """The same in every tick."""
        return self._actions

    def counts(self) -> dict[str, int]:
        """No faults."""
        return {}

    def close(self) -> None:
        """Nothing to end."""
