"""Radio logs: which packet was received where, when and how strongly, as arrays in the order of each link."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class RadioLog:
    """A row per packet that was received, or noted as lost; sorted by link, then by sequence number.

    Packets between two rows of a link whose sequence numbers leave a gap were lost, too.
    """

    links: tuple[tuple[str, str], ...]  # names of sender and receiver
    link: IntArray  # (n,) place in `links`
    time_s: FloatArray  # (n,) rising within a link
    sequence: IntArray  # (n,) rising within a link
    rssi_dbm: FloatArray  # (n,) NaN: lost
    distance_m: FloatArray  # (n,) NaN: unknown, of lost packets only
    ends_m: FloatArray | None  # (n, 4) x and y of sender and receiver; None: the log has no positions

    @cached_property
    def received(self) -> BoolArray:
        """Which rows were received, (n,)."""
        return np.isfinite(self.rssi_dbm)

    @cached_property
    def opens(self) -> BoolArray:
        """Which rows are the first of their link, (n,)."""
        return np.diff(self.link, prepend=-1) != 0

    @cached_property
    def gaps(self) -> IntArray:
        """How many packets were lost unseen right before each row, (n,)."""
        missed = np.diff(self.sequence, prepend=0) - 1
        return np.where(self.opens, 0, missed)

    @cached_property
    def last_distance_m(self) -> FloatArray:
        """Distances (n,), where a lost packet's is unknown the last known of its link; NaN before any."""
        row = np.arange(len(self.link))
        known: IntArray = np.maximum.accumulate(np.where(np.isfinite(self.distance_m), row, -1))
        here = (known >= 0) & (self.link[known] == self.link)
        return np.where(here, self.distance_m[known], np.nan)

    def within(self, distance_m: float) -> "RadioLog":
        """The rows at most so far apart; where a link comes back after a while beyond, it counts as another link."""
        near = self.last_distance_m <= distance_m
        far_since_start = np.cumsum(~near)
        # A link's rows with no far row between them stay together.
        spell = np.stack([self.link, far_since_start])[:, near]
        starts = np.any(np.diff(spell, axis=1, prepend=-1) != 0, axis=0)
        first: list[int] = self.link[near][starts].tolist()
        return RadioLog(
            tuple(self.links[i] for i in first),
            np.cumsum(starts) - 1,
            self.time_s[near],
            self.sequence[near],
            self.rssi_dbm[near],
            self.distance_m[near],
            None if self.ends_m is None else self.ends_m[near],
        )
