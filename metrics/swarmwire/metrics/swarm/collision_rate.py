"""The collision rate: contacts per robot and hour."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment

S_PER_H = 3600.0


@dataclass(frozen=True)
class CollisionRate(Metric):
    """2 x contacts between robots that began so far / robot-hours alive so far, in 1/h; NaN while nobody was alive.

    A contact that lasts counts once, and for both robots, so this is how often one robot is in a collision. Robots
    alive are added up over time. The dead can be hit, and their contacts count as any. `final` is the rate of the run.

    Discs of diameter D that go straight at speed v without heed, at random over an area with n of them to the square
    metre, touch at a rate of (8 / pi) n D v (N - 1) / N each, since their mean relative speed is 4 v / pi: 237 an hour
    for 60 of 7 cm at 0.1 m/s on 4 x 4 m.

    Source: the kinetic theory of gases in the plane, for the rate of those that avoid nobody.
    """

    name = "collision_rate"
    help = "contacts between robots per robot-hour so far, each counted for both robots, in 1/h"
    unit = "1/h"
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """A fresh measure."""
        contacts, robot_ticks = np.zeros(static.arenas, np.int64), np.zeros(static.arenas, np.int64)
        ticks_per_h = static.rate_hz * S_PER_H

        def measure(moment: Moment) -> FloatArray:
            np.add(contacts, moment.truth.contact_onsets[:, 0], out=contacts)
            np.add(robot_ticks, moment.robots_alive, out=robot_ticks)
            robot_h = np.where(robot_ticks > 0, robot_ticks / ticks_per_h, np.nan)
            return 2.0 * contacts / robot_h

        return measure
