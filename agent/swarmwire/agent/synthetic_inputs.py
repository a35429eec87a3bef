"""Synthetic readings, packets and tx statuses for a group of robots, keyed by a seed.

`inputs` yields them tick by tick: new random readings, the packets that the robots sent a tick ago, each received by
some of the others, tx statuses of unicast packets, and robots that drop out and return.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms import draws
from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.bodies.body import Body, load_body
from swarmwire.comms.clock import tick_start_ns
from swarmwire.comms.packets import (
    NO_TX_STATUSES,
    NOT_MEASURED,
    Payloads,
    ReceivedPackets,
    SentPackets,
    TxResult,
    TxStatuses,
)
from swarmwire.comms.tick_io import GroupReadings

RATE_HZ = 10
MEASURES = ("range_m", "bearing_rad", "rssi_dbm")
DROP_OUT_SHARE = 0.1  # share of the robots missing in a tick
RECEPTION_SHARE = 0.4  # share of the senders that a robot receives
STATUS_SHARE = 0.6  # share of the outstanding tx statuses that arrive in a tick


@dataclass(frozen=True)
class Trial:
    """A test case for an agent: robots with synthetic readings and packets.

    All readings are drawn again in each tick. A packet is received a tick later, by each of the others with probability
    0.4, and an agent that needs tx statuses gets all kinds of them. A tenth of the robots is missing in each tick and
    starts with defaults when it returns.
    """

    robots: int = 7  # of one group
    ticks: int = 12  # of a tenth of a second
    seed: int = 1  # of readings, reception and the robots' draws
    body: str | Body = "epuck"  # the name of a bundled body, or any body
    params: dict[str, Any] | None = None  # as in a scenario: a list has a value for each robot

    @cached_property
    def spec(self) -> Body:
        """The body with its specs."""
        return load_body(self.body) if isinstance(self.body, str) else self.body


class _Medium:
    """Delivers the packets of the last tick at random, and their tx statuses at random ticks."""

    def __init__(self, key: int) -> None:
        self._key, self._sent = key, SentPackets.none()
        self._outstanding = NO_TX_STATUSES

    def show(self, sent: SentPackets) -> None:
        self._sent = sent.select(np.argsort(sent.sender, kind="stable"))
        unicast = np.flatnonzero(self._sent.tx_status_ids != NOT_MEASURED)
        row, id_ = self._sent.sender[unicast], self._sent.tx_status_ids[unicast]
        chance = draws.uniform(self._key, row, id_, 0, draws.purpose("outcome"))
        new = TxStatuses(row, id_, (chance * len(TxResult)).astype(np.int64))
        self._outstanding = TxStatuses.joined([self._outstanding, new])

    def tx_status(self, tick: int) -> TxStatuses:
        """As from the radio medium: also for robots that are missing, and for those that started again since."""
        arrives = _uniform(self._key, tick, "learning", (len(self._outstanding),)) < STATUS_SHARE
        now, self._outstanding = (self._outstanding.select(np.flatnonzero(mask)) for mask in (arrives, ~arrives))
        return now

    def received(self, tick: int, rows: IntArray) -> ReceivedPackets:
        chance = _uniform(self._key, tick, "hearing", (len(rows), len(self._sent)))
        receiver, payload = np.nonzero((chance < RECEPTION_SHARE) & (self._sent.sender != rows[:, None]))
        given = {name: _uniform(self._key, tick, name, (len(receiver),)) * 3.0 - 1.0 for name in MEASURES}
        at_ns = np.full(len(receiver), tick_start_ns(tick, RATE_HZ) - 1, np.int64)
        sender = self._sent.sender[payload]
        payloads: Payloads = self._sent.payloads
        return ReceivedPackets(rows[receiver], sender, np.full(len(receiver), tick), at_ns, given, payload, payloads)


class SyntheticInputs(NamedTuple):
    """The inputs of a group in a tick: time (tick, start and length in ns), readings, packets and tx statuses."""

    time: tuple[int, int, int]
    readings: GroupReadings
    received: ReceivedPackets
    tx_status: TxStatuses


def inputs(trial: Trial) -> Iterator[tuple[SyntheticInputs, Callable[[SentPackets], None]]]:
    """The inputs of the robots, tick by tick, each with a call that takes the packets that they send."""
    key, body = draws.derive_key("inputs", trial.seed), trial.spec
    medium = _Medium(key)
    for tick in range(trial.ticks):
        rows = np.flatnonzero(_uniform(key, tick, "drop-out", (trial.robots,)) >= DROP_OUT_SHARE)
        time_ns = tick_start_ns(tick, RATE_HZ)
        time = (tick, time_ns, tick_start_ns(tick + 1, RATE_HZ) - time_ns)
        readings = GroupReadings(rows, _readings(body, key, tick, rows))
        yield SyntheticInputs(time, readings, medium.received(tick, rows), medium.tx_status(tick)), medium.show


def _readings(body: Body, key: int, tick: int, rows: IntArray) -> dict[str, FloatArray]:
    n = len(rows)

    def draw(purpose: str, width: int) -> FloatArray:
        return _uniform(key, tick, purpose, (n, width) if width else (n,))

    readings: dict[str, FloatArray] = {}
    for name, spec in body.sensors.items():
        columns = zip(spec.reading_fields(), spec.synthetic(name, tick, draw), strict=True)
        readings |= {f"{name}.{field.name}": column for field, column in columns}
    return readings


def _uniform(key: int, tick: int, purpose: str, shape: tuple[int, ...]) -> FloatArray:
    count = np.arange(int(np.prod(shape))).reshape(shape)
    return draws.uniform(key, tick, count, 0, draws.purpose(purpose))
