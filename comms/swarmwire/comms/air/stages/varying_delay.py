"""Varying delay: a further delay with a distribution of its own, before a receiver has the packet."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.air.links import HEARD, Links
from swarmwire.comms.air.stages.stage import Medium, Stage
from swarmwire.comms.air.timing.delay_law import delay_law, varying_delay_ns
from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import uniform

DELAYS = purpose("delays")


class VaryingDelay(Stage):
    """`heard_at` is later by a quantile of the distribution."""

    name = "varying_delay"
    keys = ("delays",)

    @classmethod
    def of(cls, medium: Medium) -> Stage | None:
        """The stage, where the radio has such delays."""
        return VaryingDelay(medium) if medium.radio.delays is not None else None

    def __init__(self, medium: Medium) -> None:
        assert medium.radio.delays is not None
        self._law, self._keys, self._robots = delay_law(medium.radio.delays), medium.keys, medium.robots

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Links that are heard become final later."""
        late_ns = drawn_ns(
            self._law, self._keys, self._robots, links.sender, links.receiver, links.sequence, links.fate
        )
        np.add(links.final_at_ns, late_ns, out=links.final_at_ns)


@njit(cache=True)
def drawn_ns(law, keys, robots, sender, receiver, sequence, fate):
    """What `heard_at` adds, in ns, (k,); u keyed by (sender, receiver, sequence). 0 for links that ended."""
    late_ns = np.zeros(len(sender), np.int64)
    for i in range(len(late_ns)):
        if fate[i] == HEARD:
            s, r = sender[i], receiver[i]
            late_ns[i] = varying_delay_ns(law, uniform(keys[s // robots], s % robots, r % robots, sequence[i], DELAYS))
    return late_ns
