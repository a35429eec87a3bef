"""The radio's account of a run: what became of every packet, the delivery ratios, and how late packets were."""

from typing import Any

import numpy as np

from swarmwire.comms.clock import NS_PER_S
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.packets import FATE_NAMES, Fate
from swarmwire.comms.truth import PacketCounts, ReceptionRecords, Static, Truth
from swarmwire.metrics.measure import json_number
from swarmwire.metrics.network.latency import Latencies, LogHistogram

PERCENTS = (50.0, 90.0, 99.0)


class RadioTally(Observer):
    """Observer that adds up the radio's tallies. Summary part: `radio`, per arena; nothing without a radio.

    sent (packets), intended and in_range (receivers), fates {name: receivers}, pdr = received / intended, link_pdr =
    received / in_range (null without any such receiver), and of the packets received the p50, p90 and p99 of two
    latencies in s, within 0.5 % (null if none was received): latency_air_s from sending to reception, latency_agent_s
    from sending to the first tick at which the receiver acts.
    """

    def begin(self, static: Static) -> None:
        """Start afresh."""
        arenas = static.arenas
        self._has_radio = False
        self._latencies = Latencies(static)
        self._sent = np.zeros(arenas, np.int64)
        self._intended = np.zeros(arenas, np.int64)
        self._in_range = np.zeros(arenas, np.int64)
        self._fates = np.zeros((arenas, len(FATE_NAMES)), np.int64)
        self._air = LogHistogram(arenas)
        self._agent = LogHistogram(arenas)

    def see(self, truth: Truth) -> None:
        """Add what a tick brought."""
        if truth.tally is not None:
            self._add(truth.tally)
        if truth.finished is not None:
            self._time(truth.finished, truth.tick)

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """The account; with `last`, in which what is still in flight has its fate, the fates add up to intended."""
        if last is not None:
            self._add(last)
        return {"radio": [self._arena(arena) for arena in range(len(self._sent))]} if self._has_radio else {}

    def _add(self, tally: PacketCounts) -> None:
        self._has_radio = True
        self._sent += tally.sent
        self._intended += tally.intended
        self._in_range += tally.in_range
        self._fates += tally.fates

    def _time(self, finished: ReceptionRecords, tick: int) -> None:
        arena, air_ns, agent_ns = self._latencies.of(finished, tick)
        self._air.add(arena, air_ns)
        self._agent.add(arena, agent_ns)

    def _arena(self, arena: int) -> dict[str, Any]:
        fates = [int(count) for count in self._fates[arena]]
        received, intended, in_range = fates[Fate.RECEIVED], int(self._intended[arena]), int(self._in_range[arena])
        return {
            "sent": int(self._sent[arena]),
            "intended": intended,
            "in_range": in_range,
            "fates": dict(zip(FATE_NAMES, fates, strict=True)),
            "pdr": received / intended if intended else None,
            "link_pdr": received / in_range if in_range else None,
            "latency_air_s": _percentiles_s(self._air, arena),
            "latency_agent_s": _percentiles_s(self._agent, arena),
        }


def _percentiles_s(histogram: LogHistogram, arena: int) -> dict[str, float | None]:
    found_ns = histogram.percentiles_ns(arena, PERCENTS)
    return {f"p{percent:g}": json_number(ns / NS_PER_S) for percent, ns in zip(PERCENTS, found_ns, strict=True)}
