"""Loss sequences: every packet of every link, received or lost, and the time since the one before."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.metrics.radio_fit.radio_log import RadioLog

STRETCH = 1000


@dataclass(frozen=True)
class LossSequences:
    """A row per packet, link after link, in the order of time within each."""

    link: IntArray  # (n,)
    since_s: FloatArray  # (n,) time since the link's packet before; inf for its first, before which all is forgotten
    lost: BoolArray  # (n,)

    @property
    def interval_s(self) -> float:
        """The usual time between two packets of a link: the median; NaN if no link has two."""
        known = self.since_s[np.isfinite(self.since_s)]
        return float(np.median(known)) if len(known) else float("nan")

    @property
    def burst_lengths(self) -> IntArray:
        """How many packets in a row were lost, for every run of losses; a link's end ends a run, too."""
        begins = self.lost & ~(np.append(False, self.lost[:-1]) & np.isfinite(self.since_s))
        run = np.cumsum(begins)[self.lost]
        return np.bincount(run)[1:] if len(run) else np.zeros(0, np.int64)

    def thinned(self, most: int) -> "LossSequences":
        """So many packets or less: stretches of a thousand, evenly chosen, each of which starts without a past."""
        every = -(-len(self.lost) // most)
        if every <= 1:
            return self
        row = np.arange(len(self.lost))
        kept = (row // STRETCH) % every == 0
        since_s = np.where(row % STRETCH == 0, np.inf, self.since_s)
        return LossSequences(self.link[kept], since_s[kept], self.lost[kept])


def loss_sequences(log: RadioLog) -> LossSequences:
    """The packets of a log; those that were lost unseen are taken as sent evenly between the rows around them.

    Packets before a link's first row and after its last leave no trace.
    """
    repeat = log.gaps + 1
    row = np.repeat(np.arange(len(log.link)), repeat)
    step_s = np.diff(log.time_s, prepend=0.0) / repeat
    since_s = step_s[row]
    last = np.cumsum(repeat) - 1
    since_s[last[log.opens]] = np.inf  # an opening row has no gap before it
    lost = np.ones(len(row), np.bool_)
    lost[last] = ~log.received
    return LossSequences(log.link[row], since_s, lost)
