"""Order: agreement of the headings and velocities of a swarm, and its speed."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import AnyArray, FloatArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import Measure, Metric, TickView, agreement
from swarmwire.metrics.measures.swarm.pairs import NearPairs


@dataclass(frozen=True)
class Order(Metric):
    """|sum u_i| / N over the unit headings u_i of the N robots alive; NaN if none is.

    1 if all point one way, 0 if they cancel. For random headings its mean is near sqrt(pi / (4 N)) and the mean of its
    square is 1/N: small swarms look ordered by chance. It differs from |sum v_i| / sum |v_i|, which weights robots by
    speed and reverses robots that drive backwards.

    Source: T. Vicsek et al., Novel type of phase transition in a system of self-driven particles, PRL 75 (1995), eq. 3,
    with headings for directions of motion.
    """

    name = "order"
    help = "order of headings: |sum of unit headings| / robots alive"
    standard = True
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """Return a measure without memory."""
        return lambda view: agreement(*view.direction, view.alive, False)


@dataclass(frozen=True)
class OrderVelocity(Metric):
    """|sum v_i| / sum |v_i| over the velocities v_i of the robots alive; 0 if all stand still, NaN if none is alive.

    1 if all move one way, 0 if their motions cancel. Robots are weighted by speed, so a robot that turns on the spot
    does not count; a robot that drives backwards counts by its motion, in `order` by its heading.

    Source: the average normalised velocity of T. Vicsek et al., PRL 75 (1995), with speeds that differ.
    """

    name = "order_velocity"
    help = "order of velocities: |sum of velocities| / sum of speeds, over robots alive"
    standard = True
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """Return a measure without memory."""
        return lambda view: agreement(view.velocity[:, :, 0], view.velocity[:, :, 1], view.alive, True)


@dataclass(frozen=True)
class OrderLocal(Metric):
    """Mean over the robots i alive of the mean over their neighbours j of cos(heading_i - heading_j), -1 to 1.

    Neighbours are the other robots alive nearer than `range_m`, centre to centre, the shortest way on a torus. A robot
    without neighbours counts 1, as in the source, so a scattered swarm looks ordered: read it with `nearest_neighbour`.
    Groups that each agree within have 1 even if they differ from each other; `order` is less then. Near 0 for random
    headings; NaN if no robot is alive.

    Source: the order metric of E. Soria et al., SwarmLab (IROS 2020), with headings in place of directions of
    velocities, which robots at rest lack, and a range alone, without a largest number of neighbours.
    """

    range_m: float = parameter(1.0, help="who is nearer is a neighbour", unit="m", above=0.0)

    name = "order_local"
    help = "local order: mean of the cosines between a robot's heading and those of its neighbours, over robots alive"
    bounds = (-1.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """Return a measure; its memory only makes it quick."""
        neighbours = NearPairs(static, np.full(static.robots, 0.5 * self.range_m))

        def measure(view: TickView) -> FloatArray:
            return _mean_agreement(*view.direction, view.alive, neighbours.find(view))

        return measure


@njit()
def _mean_agreement(c: AnyArray, s: AnyArray, alive: AnyArray, pairs: AnyArray):
    arenas, robots = alive.shape
    c, s = c.ravel(), s.ravel()
    total, neighbours = np.zeros(arenas * robots), np.zeros(arenas * robots, np.int64)
    for k in range(len(pairs)):
        i, j = pairs[k]
        agree = c[i] * c[j] + s[i] * s[j]
        total[i] += agree
        total[j] += agree
        neighbours[i] += 1
        neighbours[j] += 1
    order = np.full(arenas, np.nan)
    for arena in range(arenas):
        sum_of_means, n = 0.0, 0
        for i in range(robots):
            row = arena * robots + i
            if alive[arena, i]:
                sum_of_means += total[row] / neighbours[row] if neighbours[row] else 1.0
                n += 1
        if n:
            order[arena] = min(max(sum_of_means / n, -1.0), 1.0)  # rounding may exceed the bounds
    return order


@dataclass(frozen=True)
class Speed(Metric):
    """Mean of |v_i| over the velocities v_i of the robots alive, in m/s; NaN if none is alive.

    Directions and turns do not matter.
    """

    name = "speed"
    help = "mean speed of the robots alive, in m/s"
    unit = "m/s"
    bounds = (0.0, None)

    def begin(self, static: Static) -> Measure:
        """Return a measure without memory."""
        return _speed


def _speed(view: TickView) -> FloatArray:
    velocity = view.velocity
    return view.sum_alive(np.hypot(velocity[:, :, 0], velocity[:, :, 1])) / view.per_robot_alive
