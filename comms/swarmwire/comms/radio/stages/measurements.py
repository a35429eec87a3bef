"""Stages that measure a received packet: range, bearing and RSSI, each with a normal error."""

from collections.abc import Callable
from typing import Any

import numpy as np

from swarmwire.comms.base.angles import wrap_angle
from swarmwire.comms.base.arrays import AnyArray, FloatArray
from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.geometry.obstacles import to_nearest
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.links import RECEIVED, Links
from swarmwire.comms.radio.stages.link_draws import LinkDraws, normal_of_link
from swarmwire.comms.radio.stages.stage import Stage

RANGE_NOISE, BEARING_NOISE = purpose("range noise"), purpose("bearing noise")
RSSI_NOISE = purpose("rssi noise")
wrap = njit()(wrap_angle)


@kernel()
def to_sender_m(pose: AnyArray, sender: int, receiver: int, wrap_m: tuple[float, float]):
    """Return the vector from receiver to sender in m, robot rows of `pose` (rows, 3); the shortest on a torus."""
    dx, dy = pose[sender, 0] - pose[receiver, 0], pose[sender, 1] - pose[receiver, 1]
    return dx + to_nearest(dx, wrap_m[0]), dy + to_nearest(dy, wrap_m[1])


class Measurement(Stage):
    """Fills a column of `Links.measured` with the measurement of a kernel between two poses, with its error."""

    def __init__(self, context: ChannelContext, column: str, noise: float, kernel: Callable[..., None]) -> None:
        """Create the stage.

        Args:
            context: the context of a medium whose radio measures the column.
            column: name of the column.
            noise: deviation of the error, in the column's unit.
            kernel: function of (out (k,), pose, wrap_m, draws, links, noise), which fills `out` for received links.
        """
        self._draws, self._wrap_m = LinkDraws(context.keys, context.robots), context.wrap_m
        self._column = context.radio.measures.columns.index(column)
        self._noise, self._kernel = noise, kernel

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Fill the column; 0 for links that ended."""
        out = np.zeros(len(links))
        self._kernel(out, pose, self._wrap_m, self._draws, links.columns, self._noise)
        links.measured[:, self._column] = out


class MeasuredRange(Measurement):
    """The distance between the centres when the packet went on air, plus a normal error; never below 0."""

    name = "measured_range"
    keys = ("measures.range",)

    @classmethod
    def create(cls, context: ChannelContext) -> Stage | None:
        """Return the stage if the radio measures the range."""
        measure = context.radio.measures.range
        return None if measure is None else MeasuredRange(context, measure.noise_m)

    def __init__(self, context: ChannelContext, noise_m: float) -> None:
        super().__init__(context, "range_m", noise_m, measure_range)


@kernel(from_python=True)
def measure_range(out_m: AnyArray, pose: Any, wrap_m: tuple[float, float], draws: Any, links: Any, noise_m: float):
    """Set `out_m` of received links to max(0, distance + noise z), z normal, keyed by link; in m."""
    for i in range(len(out_m)):
        if links.fate[i] == RECEIVED:
            dx, dy = to_sender_m(pose, links.sender[i], links.receiver[i], wrap_m)
            out_m[i] = np.sqrt(dx * dx + dy * dy)
            if noise_m > 0.0:
                out_m[i] = max(out_m[i] + noise_m * normal_of_link(draws, links, i, RANGE_NOISE), 0.0)


class MeasuredBearing(Measurement):
    """The bearing of the sender from the receiver's body when the packet went on air, plus a normal error.

    In the receiver's frame: 0 is ahead, positive to the left; wrapped to (-pi, pi].
    """

    name = "measured_bearing"
    keys = ("measures.bearing",)

    @classmethod
    def create(cls, context: ChannelContext) -> Stage | None:
        """Return the stage if the radio measures the bearing."""
        measure = context.radio.measures.bearing
        return None if measure is None else MeasuredBearing(context, measure.noise_rad)

    def __init__(self, context: ChannelContext, noise_rad: float) -> None:
        super().__init__(context, "bearing_rad", noise_rad, measure_bearing)


@kernel(from_python=True)
def measure_bearing(
    out_rad: AnyArray, pose: AnyArray, wrap_m: tuple[float, float], draws: Any, links: Any, noise_rad: float
):
    """Set `out_rad` of received links to atan2(dy, dx) - heading + noise z, z normal, keyed by link; wrapped."""
    for i in range(len(out_rad)):
        if links.fate[i] == RECEIVED:
            dx, dy = to_sender_m(pose, links.sender[i], links.receiver[i], wrap_m)
            bearing = math_compiled.atan2(dy, dx) - pose[links.receiver[i], 2]
            if noise_rad > 0.0:
                bearing += noise_rad * normal_of_link(draws, links, i, BEARING_NOISE)
            out_rad[i] = wrap(bearing)


class MeasuredRssi(Stage):
    """The power of the signal at the receiver, fading included, plus a normal error in dB."""

    name = "measured_rssi"
    keys = ("measures.rssi",)

    @classmethod
    def create(cls, context: ChannelContext) -> Stage | None:
        """Return the stage if the radio measures the RSSI."""
        measure = context.radio.measures.rssi
        return None if measure is None else MeasuredRssi(context, measure.noise_db)

    def __init__(self, context: ChannelContext, noise_db: float) -> None:
        self._noise_db, self._draws = noise_db, LinkDraws(context.keys, context.robots)
        self._column = context.radio.measures.columns.index("rssi_dbm")

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Fill the column "rssi_dbm"; 0 for links that ended."""
        out_dbm = np.zeros(len(links))
        measure_rssi(out_dbm, links.rssi_dbm, self._draws, links.columns, self._noise_db)
        links.measured[:, self._column] = out_dbm


@kernel(from_python=True)
def measure_rssi(out_dbm: AnyArray, rssi_dbm: AnyArray, draws: Any, links: Any, noise_db: float):
    """Set `out_dbm` of received links to RSSI + noise z, z normal, keyed by link; in dBm."""
    for i in range(len(out_dbm)):
        if links.fate[i] == RECEIVED:
            out_dbm[i] = rssi_dbm[i]
            if noise_db > 0.0:
                out_dbm[i] += noise_db * normal_of_link(draws, links, i, RSSI_NOISE)
