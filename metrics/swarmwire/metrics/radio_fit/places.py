"""Places: received packets of one link from one place, taken together; so many at most that a fit stays quick."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.metrics.radio_fit.radio_log import RadioLog

SAME_PLACE_M = 0.05
MAX_PLACES = 300


@dataclass(frozen=True)
class Places:
    """Mean values of the packets of each place, and how many there were."""

    ends_m: FloatArray  # (n, 4) x and y of sender and receiver
    rssi_dbm: FloatArray  # (n,)
    packets: FloatArray  # (n,)

    @property
    def distance_m(self) -> FloatArray:
        """Length of each link, (n,)."""
        return np.hypot(self.ends_m[:, 2] - self.ends_m[:, 0], self.ends_m[:, 3] - self.ends_m[:, 1])


def places_of(log: RadioLog) -> Places:
    """The places of a log with positions, both directions of a link as one; an even choice where there are many."""
    assert log.ends_m is not None
    ends_m, rssi_dbm = log.ends_m[log.received], log.rssi_dbm[log.received]
    turned = (ends_m[:, 0] > ends_m[:, 2]) | ((ends_m[:, 0] == ends_m[:, 2]) & (ends_m[:, 1] > ends_m[:, 3]))
    ends_m = np.where(turned[:, None], ends_m[:, [2, 3, 0, 1]], ends_m)
    cells = np.round(ends_m / SAME_PLACE_M).astype(np.int64)
    _, first, place = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    place = place.reshape(-1)
    packets = np.bincount(place).astype(np.float64)
    mean_ends = np.stack([np.bincount(place, ends_m[:, i]) / packets for i in range(4)], axis=1)
    mean_rssi = np.bincount(place, rssi_dbm) / packets
    in_order = np.argsort(first)  # evenly over the log, not over the cells
    if len(in_order) > MAX_PLACES:
        in_order = in_order[np.linspace(0, len(in_order) - 1, MAX_PLACES).round().astype(np.int64)]
    return Places(mean_ends[in_order], mean_rssi[in_order], packets[in_order])
