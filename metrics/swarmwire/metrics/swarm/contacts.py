"""Contacts that began: robots with robots, and apart from them robots with what stands still."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment


@dataclass(frozen=True)
class Collisions(Metric):
    """Contacts between two robots that began in the tick; one that lasts counts once. The dead can be hit."""

    name = "collisions"
    help = "contacts between two robots that began, a lasting one once"
    kind = "count"
    standard = True
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        return _with_robots


@dataclass(frozen=True)
class WallContacts(Metric):
    """Contacts between a robot and a wall or obstacle that began in the tick; one that lasts counts once."""

    name = "wall_contacts"
    help = "contacts of a robot with a wall or an obstacle that began, a lasting one once"
    kind = "count"
    standard = True
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; nothing is remembered."""
        return _with_walls


def _with_robots(moment: Moment) -> FloatArray:
    return moment.truth.contact_onsets[:, 0].astype(np.float64)


def _with_walls(moment: Moment) -> FloatArray:
    return moment.truth.contact_onsets[:, 1].astype(np.float64)
