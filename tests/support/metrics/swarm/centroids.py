"""The centroid of a swarm, and where robots stand as seen from it, worked out without the code under test."""

import numpy as np
from hypothesis import assume


def centroid_m(swarm, pose):
    """Of the places of some robots: the mean, on a torus that of the places unrolled from their circular mean."""
    place = pose[:, :2]
    if swarm.of.boundary != "torus":
        return place.mean(axis=0)
    size = np.array(swarm.of.arena_size_m)
    directions = np.exp(2j * np.pi * place / size).mean(axis=0)
    assume(np.all(np.abs(directions) > 1e-3))  # nearly cancelled directions are decided by rounding
    around = np.angle(directions) / (2.0 * np.pi) * size
    unrolled = swarm.shortest(place - around)
    assume(np.all(np.abs(np.abs(unrolled) - 0.5 * size) > 1e-6))  # as is the shorter way to the other side
    return around + unrolled.mean(axis=0)


def away_m(swarm, pose):
    """Displacements from the centroid, (n, 2)."""
    away = swarm.shortest(pose[:, :2] - centroid_m(swarm, pose))
    assume(swarm.of.boundary != "torus" or np.all(np.abs(np.abs(away) - 0.5 * np.array(swarm.of.arena_size_m)) > 1e-6))
    return away
