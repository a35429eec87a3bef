"""The bearing that a receiver learns with a packet."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.air.links import HEARD
from swarmwire.comms.air.stages import given
from swarmwire.comms.air.stages.apart import to_sender_m
from swarmwire.comms.air.stages.stage import Medium, Stage
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import normal

NOISE = purpose("bearing noise")
TURN = 2.0 * np.pi


class GivenBearing(given.Given):
    """Where the sender was, seen from the receiver's body when the packet went on air, plus a normal error.

    In the receiver's frame: 0 is ahead, positive to the left; wrapped to (-pi, pi].
    """

    name = "given_bearing"
    keys = ("gives.bearing",)

    @classmethod
    def of(cls, medium: Medium) -> Stage | None:
        """The stage, where the radio gives the bearing."""
        asked = medium.radio.gives.bearing
        return None if asked is None else GivenBearing(medium, asked.noise_rad)

    def __init__(self, medium: Medium, noise_rad: float) -> None:
        super().__init__(medium, "bearing_rad", noise_rad, bearing_rad)


@njit(cache=True)
def bearing_rad(keys, robots, wrap_m, pose, sender, receiver, sequence, fate, noise_rad):
    """atan2(dy, dx) - heading + noise z, z normal, keyed by (sender, receiver, sequence); 0 for ended links; (k,)."""
    out_rad = np.zeros(len(sender))
    for i in range(len(out_rad)):
        s, r = sender[i], receiver[i]
        if fate[i] == HEARD:
            dx, dy = to_sender_m(pose, s, r, wrap_m)
            bearing = np.arctan2(dy, dx) - pose[r, 2]
            if noise_rad > 0.0:
                bearing += noise_rad * normal(keys[s // robots], s % robots, r % robots, sequence[i], NOISE)
            out_rad[i] = wrapped(bearing)
    return out_rad


@njit(cache=True)
def wrapped(angle):
    """The angle in (-pi, pi]; one that lies there already is unchanged."""
    if -np.pi < angle <= np.pi:
        return angle
    turned = angle - TURN * np.ceil((angle - np.pi) / TURN)
    return min(turned, np.pi) if turned > -np.pi else np.pi
