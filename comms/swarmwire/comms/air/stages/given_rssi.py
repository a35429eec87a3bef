"""The strength of the signal that a receiver learns with a packet."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np
from numba import njit

from swarmwire.comms.air.links import HEARD, Links
from swarmwire.comms.air.stages.stage import Medium, Stage
from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import normal

NOISE = purpose("rssi noise")


class GivenRssi(Stage):
    """The power of the signal at the receiver, fading included, plus a normal error in dB."""

    name = "given_rssi"
    keys = ("gives.rssi",)

    @classmethod
    def of(cls, medium: Medium) -> Stage | None:
        """The stage, where the radio gives the strength."""
        given = medium.radio.gives.rssi
        return None if given is None else GivenRssi(medium, given.noise_db)

    def __init__(self, medium: Medium, noise_db: float) -> None:
        self._noise_db, self._keys, self._robots = noise_db, medium.keys, medium.robots
        self._column = medium.radio.gives.columns.index("rssi_dbm")

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Fill the column "rssi_dbm"."""
        noise_db = error_db(
            self._keys, self._robots, links.sender, links.receiver, links.sequence, links.fate, self._noise_db
        )
        links.given[:, self._column] = np.where(links.fate == HEARD, links.rssi_dbm, 0.0) + noise_db


@njit(cache=True)
def error_db(keys, robots, sender, receiver, sequence, fate, noise_db):
    """The error noise z, z normal, keyed by (sender, receiver, sequence); 0 for ended links; in dB, (k,)."""
    out_db = np.zeros(len(sender))
    for i in range(len(out_db)):
        if fate[i] == HEARD and noise_db > 0.0:
            s, r = sender[i], receiver[i]
            out_db[i] = noise_db * normal(keys[s // robots], s % robots, r % robots, sequence[i], NOISE)
    return out_db
