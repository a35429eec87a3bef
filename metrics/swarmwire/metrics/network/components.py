"""Components: into how many pieces the radio graph has fallen."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment


@dataclass(frozen=True)
class ComponentCount(Metric):
    """Connected components of the radio graph over the robots alive: 1 when everyone can reach everyone over hops.

    From 1 to the number of robots alive, 0 if none is; NaN without a radio. What an edge is, `Truth.edges` says.
    """

    name = "components"
    help = "connected components of the radio graph over robots alive"
    standard = True
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        return _components


def _components(moment: Moment) -> FloatArray | float:
    found = moment.components
    return np.nan if found is None else found.pieces.astype(np.float64)
