"""Antenna patterns: gain by azimuth and by elevation, and the strength around a robot with a patch antenna."""

# pyright: basic, reportUnknownMemberType=false

import numpy as np

from docs.pictures.radio.sheet import legend_below, line_color, panels, scale, set_labels, write
from swarmwire.comms.base.geometry.obstacle_index import ObstacleIndices
from swarmwire.comms.base.geometry.obstacles import obstacle_arrays
from swarmwire.comms.radio.analysis.coverage import RadioCoverage, coverage_map
from swarmwire.comms.radio.config.antennas import Antenna, Pattern
from swarmwire.comms.radio.config.path_loss_models import LogDistance
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.propagation.antennas import antenna_patterns, direction_loss_db
from swarmwire.metrics.pictures.drawing.canvas import INK

ANTENNAS = {
    "omnidirectional": Antenna(),
    "dipole, upright": Antenna(pattern=Pattern("dipole")),
    "patch, 65° x 65°, 8 dBi": Antenna(gain_dbi=8.0, pattern=Pattern("patch")),
    "patch, 30° wide, 11 dBi": Antenna(gain_dbi=11.0, pattern=Pattern("patch", beam_width_deg=30.0)),
}
DEGREES = np.linspace(-180.0, 180.0, 721)
SIZE_M, SENDER = (24.0, 18.0), (-4.0, 0.0)
HEADING_RAD = np.radians(30.0)


def gains_dbi(antenna: Antenna, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> list[float]:
    """The gain in these directions, (k,) each."""
    patterns = antenna_patterns([antenna], np.zeros(1, np.int64))
    return [antenna.peak_dbi - direction_loss_db(patterns, 0, 0.0, *row) for row in zip(x, y, z, strict=True)]


def draw() -> None:
    """Write antennas.svg."""
    figure, (left, middle, right) = panels(3, 2.75, (1.0, 1.0, 1.35))
    angle = np.radians(DEGREES)
    flat, along, across = np.zeros_like(angle), np.cos(angle), np.sin(angle)
    for index, (label, antenna) in enumerate(ANTENNAS.items()):
        look = {"color": line_color(index), "lw": 1.5, "label": label}
        left.plot(DEGREES, gains_dbi(antenna, along, across, flat), **look)
        if index < len(ANTENNAS) - 1:
            middle.plot(DEGREES / 2.0, gains_dbi(antenna, np.cos(angle / 2.0), flat, np.sin(angle / 2.0)), **look)
    for axes, ticks in ((left, (-180, -90, 0, 90, 180)), (middle, (-90, -45, 0, 45, 90))):
        axes.set_xticks(ticks)
        axes.set_ylim(-30.0, 13.0)
    set_labels(left, "gain around", "azimuth in °", "gain in dBi")
    set_labels(middle, "gain upwards", "elevation in °", "gain in dBi")
    radio = Radio(
        model="log-distance",
        log_distance=LogDistance(3.0),
        antenna=Antenna(-20.0, 8.0, Pattern("patch")),
    )
    empty = ObstacleIndices(obstacle_arrays(((),)), SIZE_M, 0.0)
    coverage = coverage_map(RadioCoverage(radio, np.uint64(1), empty, 20), SIZE_M, SENDER, 120, float(HEADING_RAD))
    extent = (-0.5 * SIZE_M[0], 0.5 * SIZE_M[0], -0.5 * SIZE_M[1], 0.5 * SIZE_M[1])
    image = right.imshow(
        coverage.mean_dbm, cmap="viridis", vmin=-100, vmax=-50, origin="lower", extent=extent, interpolation="none"
    )
    right.contour(coverage.x_m, coverage.y_m, coverage.mean_dbm, levels=[-80.0], colors="white", linewidths=1.0)
    right.plot(*SENDER, "o", ms=4, color=INK)
    ahead = 3.0 * np.array([np.cos(HEADING_RAD), np.sin(HEADING_RAD)])
    right.annotate("", SENDER + ahead, SENDER, arrowprops={"arrowstyle": "->", "color": INK})
    right.grid(visible=False)
    scale(figure, image, right, "RSSI in dBm")
    set_labels(right, "around a robot with a patch, 65°", "x in m", "y in m")
    legend_below(figure, left, 4)
    write(figure, "antennas")
