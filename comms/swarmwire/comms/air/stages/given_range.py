"""The range that a receiver learns with a packet."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.air.links import HEARD
from swarmwire.comms.air.stages import given
from swarmwire.comms.air.stages.apart import to_sender_m
from swarmwire.comms.air.stages.stage import Medium, Stage
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import normal

NOISE = purpose("range noise")


class GivenRange(given.Given):
    """The distance between the centres when the packet went on air, plus a normal error; never below 0."""

    name = "given_range"
    keys = ("gives.range",)

    @classmethod
    def of(cls, medium: Medium) -> Stage | None:
        """The stage, where the radio gives the range."""
        asked = medium.radio.gives.range
        return None if asked is None else GivenRange(medium, asked.noise_m)

    def __init__(self, medium: Medium, noise_m: float) -> None:
        super().__init__(medium, "range_m", noise_m, range_m)


@njit(cache=True)
def range_m(keys, robots, wrap_m, pose, sender, receiver, sequence, fate, noise_m):
    """max(0, distance + noise z), z normal, keyed by (sender, receiver, sequence); 0 for ended links; in m, (k,)."""
    out_m = np.zeros(len(sender))
    for i in range(len(out_m)):
        s, r = sender[i], receiver[i]
        if fate[i] == HEARD:
            dx, dy = to_sender_m(pose, s, r, wrap_m)
            out_m[i] = np.sqrt(dx * dx + dy * dy)
            if noise_m > 0.0:
                z = normal(keys[s // robots], s % robots, r % robots, sequence[i], NOISE)
                out_m[i] = max(out_m[i] + noise_m * z, 0.0)
    return out_m
