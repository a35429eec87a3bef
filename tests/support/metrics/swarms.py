"""Swarms as metrics see them."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

from swarmwire.comms.observe.truth import Group, Static, Truth
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.metrics.measures.metric import Metric
from tests.support.metrics.truths import in_each_tick, static, truth

Array = np.ndarray[Any, Any]


@dataclass(frozen=True)
class Swarm:
    static: Static
    pose: Array  # (rows, 3)
    alive: Array  # (rows,)

    def truth(self, tick: int = 0, **fields: Any) -> Truth:
        return truth(self.static, tick, pose=self.pose, alive=self.alive, **fields)

    @property
    def arenas(self) -> Iterator[tuple[Array, Array]]:
        """Poses and radii of the robots alive of each arena."""
        radius_m = np.concatenate([[g.body.radius_m] * (g.stop - g.start) for g in self.static.groups])
        for own, living in zip(
            np.split(self.pose, self.static.arenas), np.split(self.alive, self.static.arenas), strict=True
        ):
            yield own[living], radius_m[living]

    def shortest(self, away_m: Array) -> Array:
        """The shortest of the images of displacements (..., 2), over the sides of a torus."""
        if self.static.boundary != "torus":
            return away_m
        images = np.stack([away_m + turns * np.array(self.static.arena_size_m) for turns in (-2, -1, 0, 1, 2)])
        return np.take_along_axis(images, np.abs(images).argmin(axis=0)[None], axis=0)[0]

    def apart_m(self, pose: Array) -> Array:
        """The distance of each to each, (n, n)."""
        away = self.shortest(pose[None, :, :2] - pose[:, None, :2])
        return np.hypot(away[..., 0], away[..., 1])


def last_values(metric: Metric | str, *ticks: Truth, run: Static) -> list[float]:
    """The metric of each arena in the last of these ticks."""
    return in_each_tick(run, ticks, metric)[-1, 0].tolist()


def measure(metric: Metric | str, swarm: Swarm) -> list[float]:
    return last_values(metric, swarm.truth(), run=swarm.static)


def stand(*at: Any, boundary: str = "walls", arenas: int = 1) -> Swarm:
    """Living e-pucks at these x, y or x, y, heading, in an arena of 8 x 6 m."""
    run = replace(static(len(at) // arenas, arenas=arenas), boundary=boundary)
    pose = np.zeros((len(at), 3))
    pose[:, : len(at[0])] = at
    return Swarm(run, pose, np.ones(len(at), np.bool_))


def rolled(place_m: Array) -> Array:
    """Places (..., 2) brought back into the arena of 8 x 6 m, as on a torus."""
    half = np.array([4.0, 3.0])
    return (place_m + half) % (2.0 * half) - half


def mixed(run: Static, first: int) -> Static:
    """The same, of which robots from `first` on are foot-bots."""
    (flock,) = run.groups
    larger = Group("larger", load_body("footbot"), first, flock.stop)
    return replace(run, groups=(replace(flock, stop=first), larger))


@st.composite
def swarms(draw: st.DrawFn, least: int = 1, most: int = 14) -> Swarm:
    """Several arenas with walls or on a torus, two kinds of bodies, some dead; spread out, in a heap, or on a grid."""
    robots, arenas = draw(st.integers(least, most)), draw(st.integers(1, 3))
    run = mixed(static(robots, arenas=arenas), draw(st.integers(1, robots)))
    run = replace(run, boundary=draw(st.sampled_from(["walls", "torus"])))
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    spread, grid_m = draw(st.sampled_from([1.0, 0.3, 0.05])), draw(st.sampled_from([0.0, 0.5]))
    middle = rng.uniform(-0.5, 0.5, 2)
    unit = (middle + spread * rng.uniform(-0.5, 0.5, (arenas * robots, 2)) + 0.5) % 1.0 - 0.5
    position = unit * run.arena_size_m
    if grid_m:  # some at one place, and some at a half of the side from each other
        position = np.floor(position / grid_m) * grid_m
    pose = np.column_stack([position, rng.uniform(-np.pi, np.pi, arenas * robots)])
    return Swarm(run, pose, rng.random(arenas * robots) < draw(st.sampled_from([1.0, 0.7, 0.1])))


def centroid_m(swarm, pose):
    """Of the places of some robots: the mean, on a torus that of the places unrolled from their circular mean."""
    position = pose[:, :2]
    if swarm.static.boundary != "torus":
        return position.mean(axis=0)
    size = np.array(swarm.static.arena_size_m)
    directions = np.exp(2j * np.pi * position / size).mean(axis=0)
    assume(np.all(np.abs(directions) > 1e-3))  # nearly cancelled directions are decided by rounding
    around = np.angle(directions) / (2.0 * np.pi) * size
    unrolled = swarm.shortest(position - around)
    assume(np.all(np.abs(np.abs(unrolled) - 0.5 * size) > 1e-6))  # as is the shorter way to the other side
    return around + unrolled.mean(axis=0)


def away_m(swarm, pose):
    """Displacements from the centroid, (n, 2)."""
    away = swarm.shortest(pose[:, :2] - centroid_m(swarm, pose))
    assume(
        swarm.static.boundary != "torus"
        or np.all(np.abs(np.abs(away) - 0.5 * np.array(swarm.static.arena_size_m)) > 1e-6)
    )
    return away
