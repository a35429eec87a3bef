"""Path efficiency: how straight robots went where they are."""

# pyright: basic, reportUnknownMemberType=false

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.config import parameter
from swarmwire.comms.geometry.obstacles import to_nearest
from swarmwire.comms.kernels import njit
from swarmwire.comms.truth import Static
from swarmwire.metrics.metric import Measure, Metric
from swarmwire.metrics.moment import Moment
from swarmwire.metrics.torus import sides_m


@dataclass(frozen=True)
class PathEfficiency(Metric):
    """Mean over the robots alive that moved of |x(t) - x(0)| / length of the path from x(0) to x(t), 0 to 1.

    1 for those that went straight, 0 for those that are back where they began. A robot moved if its path is at least
    `moved_m` long: what shivers on the spot is left out. Paths are sums of the shortest ways from tick to tick, and on
    a torus x is unrolled: who went once around is a side away from where it was. What a robot went while dead, pushed
    by others, counts once it is alive again. NaN while no robot alive has moved.

    A random walk has sqrt(pi / (4 n)) after n steps of equal length, n large: it falls as the run goes on.

    Source: the straightness index of E. Batschelet, Circular Statistics in Biology (1981).
    """

    moved_m: float = parameter(0.01, help="who has a shorter path has not moved", unit="m", above=0.0)

    name = "path_efficiency"
    help = "net displacement / path length since the start, mean over robots alive that moved"
    bounds = (0.0, 1.0)

    def begin(self, static: Static) -> Measure:
        """A fresh measure; it remembers where each robot was, its displacement and its path."""
        before: FloatArray | None = None
        gone_m: FloatArray = np.zeros((static.arenas * static.robots, 3))  # along x, along y, path
        wrap_m = sides_m(static)

        def measure(moment: Moment) -> FloatArray:
            nonlocal before
            pose = moment.truth.pose
            if before is None:
                before = pose[:, :2].copy()
            return _step(pose, moment.alive, wrap_m, self.moved_m, before, gone_m)

        return measure


@njit()
def _step(pose, alive, wrap_m, moved_m, before, gone_m):
    """The mean of each arena, after adding the step from `before`, which becomes the present place, to `gone_m`."""
    arenas, robots = alive.shape
    mean = np.full(arenas, np.nan)
    for arena in range(arenas):
        total, n = 0.0, 0
        for i in range(robots):
            row = arena * robots + i
            along, across = pose[row, 0] - before[row, 0], pose[row, 1] - before[row, 1]
            along, across = along + to_nearest(along, wrap_m[0]), across + to_nearest(across, wrap_m[1])
            before[row, 0], before[row, 1] = pose[row, 0], pose[row, 1]
            gone_m[row, 0] += along
            gone_m[row, 1] += across
            gone_m[row, 2] += np.sqrt(along * along + across * across)
            if alive[arena, i] and gone_m[row, 2] >= moved_m:
                net_m = np.sqrt(gone_m[row, 0] ** 2 + gone_m[row, 1] ** 2)
                total += min(net_m / gone_m[row, 2], 1.0)  # rounding may carry it just past
                n += 1
        if n:
            mean[arena] = total / n
    return mean
