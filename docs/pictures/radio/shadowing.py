"""Shadowing: the field of one arena, what a robot's links have of it, and the variogram over many arenas."""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Callable
from typing import Any

import numpy as np

from docs.pictures.radio.sheet import legend, line_color, panels, scale, set_labels, write
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.radio.config.phy import Shadowing
from swarmwire.comms.radio.propagation.shadowing import amplitude_db, field_waves, shadowing_db
from swarmwire.metrics.pictures.drawing.canvas import INK
from swarmwire.metrics.real.radio_fit.shadowing import link_covariance

SHADOWING = Shadowing(deviation_db=4.0, correlation_m=5.0)
SIDE_M, STEPS = 40.0, 80
FIELD_LINK_M, TURNS = 1.0, 16
LENGTH_M, ARENAS = 2.0, 1500  # of the link that is moved, and over how many arenas its changes are averaged
MOVED_M = np.array([0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0, 9.0, 12.0, 15.0, 20.0, 25.0])


def draw() -> None:
    """Write shadowing.svg."""
    keys = np.array([derive_key("figure of shadowing", arena) for arena in range(ARENAS)], np.uint64)
    waves, amplitude = field_waves(keys, SHADOWING), amplitude_db(SHADOWING)
    figure, (field, links, variogram) = panels(3, 2.7, (1.0, 1.0, 1.1))
    half_m = 0.5 * FIELD_LINK_M
    _map(figure, field, 3.0, lambda x, y: shadowing_db(waves[0], amplitude, x - half_m, y, x + half_m, y))
    set_labels(field, "the field: links of 1 m", "x in m", "y in m")
    _map(figure, links, 10.0, lambda x, y: shadowing_db(waves[0], amplitude, 0.0, 0.0, x, y))
    links.plot(0.0, 0.0, "o", ms=4, color=INK)
    set_labels(links, "links of one robot", "x in m", "")

    half_squares = []
    first_db = np.array([shadowing_db(arena, amplitude, 0.0, 0.0, LENGTH_M, 0.0) for arena in waves])
    for moved_m in MOVED_M:
        second_db = np.array([shadowing_db(arena, amplitude, 0.0, moved_m, LENGTH_M, moved_m) for arena in waves])
        half_squares.append(0.5 * np.mean((second_db - first_db) ** 2))
    fine_m = np.linspace(0.0, MOVED_M[-1], 80)
    variogram.plot(fine_m, expected(fine_m), color=line_color(0), lw=1.5, label="definition")
    variogram.plot(MOVED_M, half_squares, "o", ms=3.5, color=line_color(1), label=f"{ARENAS} arenas")
    variogram.set_ylim(0.0, None)
    set_labels(variogram, "variogram, a link of 2 m moved", "moved by, in m", "half the mean square change in dB²")
    legend(variogram, "lower right")
    write(figure, "shadowing")


def _map(figure: Any, axes: Any, most_db: float, loss_db: Callable[[float, float], float]) -> None:
    """A loss at each place."""
    at_m = np.linspace(-0.5 * SIDE_M, 0.5 * SIDE_M, STEPS)
    losses_db = [[loss_db(x, y) for x in at_m] for y in at_m]
    look = {"cmap": "RdBu_r", "vmin": -most_db, "vmax": most_db, "origin": "lower", "interpolation": "none"}
    image = axes.imshow(losses_db, extent=(at_m[0], at_m[-1], at_m[0], at_m[-1]), **look)
    axes.grid(visible=False)
    scale(figure, image, axes, "loss in dB", location="bottom")


def expected(moved_m: FloatArray) -> FloatArray:
    """The variogram by the field's definition; its waves are few, so that it is averaged over directions."""
    semivariances_db2 = []
    for turn in np.linspace(0.0, np.pi, TURNS, endpoint=False):
        along, across = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
        start = moved_m[:, None] * across
        covariance = link_covariance(np.hstack([start, start + LENGTH_M * along]), SHADOWING.correlation_m)
        semivariances_db2.append(covariance[0, 0] - covariance[0])
    return SHADOWING.deviation_db**2 * np.mean(semivariances_db2, axis=0)
