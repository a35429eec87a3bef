"""Walls: the strength around a sender with obstacles, and along a line behind one of them."""

# pyright: basic, reportUnknownMemberType=false

import math

import numpy as np

from docs.pictures.radio.sheet import legend, line_color, panels, scale, set_labels, write
from swarmwire.comms.base.geometry.obstacle_index import ObstacleIndex, obstacles_within
from swarmwire.comms.base.geometry.obstacles import obstacle_arrays
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.radio.config.path_loss_models import LogDistance
from swarmwire.comms.radio.config.phy import Walls
from swarmwire.comms.radio.propagation.obstruction import wall_loss_db
from swarmwire.comms.radio.propagation.path_loss import loss_db, rssi_dbm
from swarmwire.metrics.pictures.drawing.canvas import INK

CURVE = LogDistance(3.0).curve(2.44e9)
WALLS = Walls(crossing_db=7.0, inside_db_per_m=6.0)
OBSTACLES = (Obstacle("box", 1.0, 1.0, size_m=(0.4, 5.0)), Obstacle("cylinder", -1.5, -2.5, radius_m=0.8))
SENDER = (-3.0, 0.0)
HALF_X_M, HALF_Y_M, STEPS = 6.0, 4.5, 110
CUT_Y_M = 1.0


def strength_dbm(obstacles: ObstacleIndex, x: float, y: float) -> float:
    """What a receiver at (x, y) in m has of a sender with 0 dBm."""
    loss = loss_db(CURVE, math.dist(SENDER, (x, y)))
    entered = np.empty((len(obstacles.shape), 2))
    walls = wall_loss_db(obstacles, entered, 0, WALLS.crossing_db, WALLS.inside_db_per_m, *SENDER, 0.0, x, y, 0.0)
    return rssi_dbm(0.0, 0.0, 0.0, loss + walls)


def draw() -> None:
    """Write walls.svg."""
    size_m = 2.0 * HALF_X_M, 2.0 * HALF_Y_M
    placed, none = (obstacles_within(obstacle_arrays((box,)), size_m, 0.0, torus=False) for box in (OBSTACLES, ()))
    figure, (left, right) = panels(2, 2.75, (1.25, 1.0))
    x_m, y_m = np.linspace(-HALF_X_M, HALF_X_M, STEPS), np.linspace(-HALF_Y_M, HALF_Y_M, STEPS)
    strengths_dbm = [[strength_dbm(placed, x, y) for x in x_m] for y in y_m]
    extent = (-HALF_X_M, HALF_X_M, -HALF_Y_M, HALF_Y_M)
    image = left.imshow(
        strengths_dbm, cmap="viridis", vmin=-85, vmax=-40, origin="lower", extent=extent, interpolation="none"
    )
    for obstacle in OBSTACLES:
        outline = obstacle.corners_m if obstacle.shape != "cylinder" else ring(obstacle)
        left.fill(*outline.T, facecolor="none", edgecolor="white", lw=1.2)
    left.plot(*SENDER, "o", ms=4, color=INK)
    left.axhline(CUT_Y_M, color="white", lw=0.8, ls=":")
    left.grid(visible=False)
    scale(figure, image, left, "RSSI in dBm")
    set_labels(left, "7 dB on entering, 6 dB for each metre inside", "x in m", "y in m")
    right.plot(x_m, [strength_dbm(none, x, CUT_Y_M) for x in x_m], color=line_color(1), lw=1.5, label="without")
    right.plot(x_m, [strength_dbm(placed, x, CUT_Y_M) for x in x_m], color=line_color(0), lw=1.5, label="with the wall")
    set_labels(right, f"along y = {CUT_Y_M:g} m", "x in m", "RSSI in dBm")
    legend(right, "upper right")
    write(figure, "walls")


def ring(cylinder: Obstacle) -> np.ndarray:
    """Points (k, 2) of its outline."""
    angle = np.linspace(0.0, 2.0 * np.pi, 60)
    middle = np.array([cylinder.x_m, cylinder.y_m])
    return middle + cylinder.radius_m * np.column_stack([np.cos(angle), np.sin(angle)])
