"""Propagation delay: what a slow wave needs on its way."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.air.links import HEARD, Links
from swarmwire.comms.air.stages.apart import to_sender_m
from swarmwire.comms.air.stages.stage import Medium, Stage
from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.clock import NS_PER_S


class PropagationDelay(Stage):
    """`heard_at` is later by distance / speed, with the distance between the centres when the packet went on air."""

    name = "propagation_delay"
    keys = ("propagation_mps",)

    @classmethod
    def of(cls, medium: Medium) -> Stage | None:
        """The stage, where the radio says how fast its waves are."""
        speed_mps = medium.radio.propagation_mps
        return None if speed_mps is None else PropagationDelay(speed_mps, medium.wrap_m)

    def __init__(self, speed_mps: float, wrap_m: tuple[float, float]) -> None:
        self._speed_mps, self._wrap_m = speed_mps, wrap_m

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Links that are heard become final later."""
        late_ns = travel_ns(pose, links.sender, links.receiver, links.fate, self._speed_mps, self._wrap_m)
        np.add(links.final_at_ns, late_ns, out=links.final_at_ns)


@njit(cache=True)
def travel_ns(pose, sender, receiver, fate, speed_mps, wrap_m):
    """What `heard_at` adds, in whole ns (rounded down), (k,); 0 for links that ended."""
    late_ns = np.zeros(len(sender), np.int64)
    for i in range(len(late_ns)):
        if fate[i] == HEARD:
            dx, dy = to_sender_m(pose, sender[i], receiver[i], wrap_m)
            late_ns[i] = np.int64(np.sqrt(dx * dx + dy * dy) / speed_mps * NS_PER_S)
    return late_ns
