"""Obstacles from the scenario's tables."""

from math import inf

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.truth import Obstacle
from swarmwire.world.scenario.arena_tables import CylinderTable, ObstacleTable, PolygonTable


def obstacle_at(table: ObstacleTable, x_m: float, y_m: float, heading_rad: float) -> Obstacle:
    """The obstacle that a table describes, put at a place in the arena."""
    height_m = inf if table.height_m is None else table.height_m
    if isinstance(table, CylinderTable):
        return Obstacle("cylinder", x_m, y_m, radius_m=table.radius_m, height_m=height_m, mass_kg=table.mass_kg)
    size_m, points = ((0.0, 0.0), table.points) if isinstance(table, PolygonTable) else (table.size_m, ())
    return Obstacle(
        table.shape, x_m, y_m, heading_rad, size_m=size_m, points_m=points, height_m=height_m, mass_kg=table.mass_kg
    )


def heading_of(table: ObstacleTable) -> float | None:
    """The heading that a table asks for, if any; a cylinder has none."""
    return None if isinstance(table, CylinderTable) else table.heading_rad


def extent(obstacle: Obstacle) -> tuple[FloatArray, FloatArray]:
    """The least and the greatest x, y of an obstacle, (2,) each, in m, arena frame."""
    if obstacle.shape == "cylinder":
        centre = np.array([obstacle.x_m, obstacle.y_m])
        return centre - obstacle.radius_m, centre + obstacle.radius_m
    corners = obstacle.corners_m
    return corners.min(axis=0), corners.max(axis=0)
