"""Distances of robots from the target, the nearest light, and the time at which they found it."""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.clock import to_s
from swarmwire.comms.base.config import parameter
from swarmwire.comms.observe.truth import Static
from swarmwire.metrics.measures.metric import Measure, Metric, TickView
from swarmwire.metrics.measures.torus import shortest_displacement


class _TargetDistance(Metric):
    """A statistic over the robots alive of the distance in m from a robot's centre to the nearest light of its arena.

    NaN without lights, or if no robot is alive.
    """

    unit = "m"
    standard = True
    bounds = (0.0, None)

    @abstractmethod
    def statistic(self, distance_m: FloatArray, view: TickView) -> FloatArray:
        """Return the statistic (arenas,) of distances (arenas, robots), dead robots included; not finite: no value."""

    def begin(self, static: Static) -> Measure:
        """Return a measure without memory."""
        distance_m = light_distance(static)

        def measure(view: TickView) -> FloatArray | float:
            if distance_m is None:
                return np.nan
            value_m = self.statistic(distance_m(view), view)
            return np.where(np.isfinite(value_m), value_m, np.nan)

        return measure


@dataclass(frozen=True)
class TargetBest(_TargetDistance):
    """The least: 0 once a robot is at the target."""

    name = "target_best"
    help = "distance of the nearest robot alive to a light, in m"

    def statistic(self, distance_m: FloatArray, view: TickView) -> FloatArray:
        """Return the distance of the nearest robot alive."""
        return np.min(distance_m, axis=1, where=view.alive, initial=np.inf)


@dataclass(frozen=True)
class TargetMean(_TargetDistance):
    """The mean, which is at least `target_best`."""

    name = "target_mean"
    help = "mean distance of the robots alive to the light nearest to each, in m"

    def statistic(self, distance_m: FloatArray, view: TickView) -> FloatArray:
        """Return the mean over the robots alive."""
        return view.sum_alive(distance_m) / view.per_robot_alive


@dataclass(frozen=True)
class FindTime(Metric):
    """First time in s at which ceil(`share` x N) of the N robots alive, at least one, are within `within_m` of a light.

    Distances are from a robot's centre to the nearest light. 0 if the robots are there at the start. Later motion of
    the robots does not change it. NaN until then, and without lights.
    """

    name = "find_time_s"
    help = "first time that a share of the robots alive, at least one, is within within_m of a light, in s"
    unit = "s"
    kind = "time"
    bounds = (0.0, None)

    within_m: float = parameter(0.5, help="who is no further from a light has found it", unit="m", at_least=0.0)
    share: float = parameter(0.0, help="of the robots alive, that must be there at once", at_least=0.0, at_most=1.0)

    def begin(self, static: Static) -> Measure:
        """Return a measure that keeps the result."""
        distance_m = light_distance(static)
        time_s: FloatArray = np.full(static.arenas, np.nan)

        def measure(view: TickView) -> FloatArray:
            is_open = np.isnan(time_s)
            if distance_m is not None and is_open.any():
                near = np.sum(distance_m(view) <= self.within_m, axis=1, where=view.alive)
                time_s[is_open & (near >= view.robots_for(self.share))] = to_s(view.truth.time_ns)
            return time_s

        return measure


def light_distance(static: Static) -> Callable[[TickView], FloatArray] | None:
    """Return a function to each robot's distance in m to the nearest light, (arenas, robots); inf without a light.

    None if no arena has a light.
    """
    lights = static.lights or ((),) * static.arenas
    if not any(lights):
        return None
    light_m: FloatArray = np.full((static.arenas, max(map(len, lights), default=0), 2), np.inf)
    for arena, listed in enumerate(lights):
        light_m[arena, : len(listed)] = np.array([(light.x_m, light.y_m) for light in listed]).reshape(-1, 2)

    def measure(view: TickView) -> FloatArray:
        # (arenas, robots, lights, 2)
        away = shortest_displacement(view.position_m[:, :, None, :] - light_m[:, None, :, :], static)
        return np.min(np.hypot(away[..., 0], away[..., 1]), axis=2, initial=np.inf)

    return measure
