"""Latency and jitter: what passes between the end of the airtime and the moment at which a receiver has the packet."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.air.links import HEARD, Links
from swarmwire.comms.air.stages.stage import Medium, Stage
from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.clock import to_ns
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import uniform

DELAY = purpose("delay")


class Latency(Stage):
    """`heard_at = off_air_at + latency + U[0, jitter)`, in integer ns."""

    name = "latency"
    keys = ("latency_s", "jitter_s")

    @classmethod
    def of(cls, medium: Medium) -> Stage | None:
        """The stage, where the radio has latency or jitter."""
        return Latency(medium) if medium.radio.latency_s > 0.0 or medium.radio.jitter_s > 0.0 else None

    def __init__(self, medium: Medium) -> None:
        self._latency_ns, self._jitter_ns = to_ns(medium.radio.latency_s), to_ns(medium.radio.jitter_s)
        self._keys, self._robots = medium.keys, medium.robots

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Links that are heard become final later."""
        late_ns = delay_ns(
            self._keys,
            self._robots,
            links.sender,
            links.receiver,
            links.sequence,
            links.fate,
            self._latency_ns,
            self._jitter_ns,
        )
        np.add(links.final_at_ns, late_ns, out=links.final_at_ns)


@njit(cache=True)
def delay_ns(keys, robots, sender, receiver, sequence, fate, latency_ns, jitter_ns):
    """What `heard_at` adds, in ns, (k,): latency + floor(u x jitter), u keyed by (sender, receiver, sequence).

    0 for links that ended.
    """
    late_ns = np.zeros(len(sender), np.int64)
    for i in range(len(late_ns)):
        if fate[i] == HEARD:
            late_ns[i] = latency_ns
            if jitter_ns > 0:
                key = keys[sender[i] // robots]
                u = uniform(key, sender[i] % robots, receiver[i] % robots, sequence[i], DELAY)
                late_ns[i] += np.int64(u * jitter_ns)
    return late_ns
