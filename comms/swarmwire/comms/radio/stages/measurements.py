"""Stages that measure a received packet: range, bearing and RSSI, each with a normal error."""

from typing import Any, ClassVar

import numpy as np

from swarmwire.comms.base.angles import wrap_angle
from swarmwire.comms.base.arrays import AnyArray
from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.geometry.obstacles import to_nearest
from swarmwire.comms.base.kernels import kernel, njit
from swarmwire.comms.base.math import compiled as math_compiled
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.stages.link_draws import link_normal
from swarmwire.comms.radio.stages.stage import Stage

RANGE_NOISE, BEARING_NOISE = purpose("range noise"), purpose("bearing noise")
RSSI_NOISE = purpose("rssi noise")
wrap = njit()(wrap_angle)


@kernel()
def to_sender_m(pose: AnyArray, sender: int, receiver: int, wrap_x_m: float, wrap_y_m: float):
    """Return the vector from receiver to sender in m, robot rows of `pose` (rows, 4); the shortest on a torus."""
    dx, dy = pose[sender, 0] - pose[receiver, 0], pose[sender, 1] - pose[receiver, 1]
    return dx + to_nearest(dx, wrap_x_m), dy + to_nearest(dy, wrap_y_m), pose[sender, 3] - pose[receiver, 3]


class Measurement(Stage):
    """A measurement with a normal error, in the unit of its column."""

    FIELDS: ClassVar = [("is_used", np.bool_), ("noise", np.float64)]

    def __init__(self, noise: float) -> None:
        """`noise` is the deviation of the error."""
        self._noise = noise

    def write(self, params: Any) -> None:
        """Set the deviation."""
        params.is_used, params.noise = True, self._noise


class MeasuredRange(Measurement):
    """The distance in space between the antennas when the packet went on air, plus a normal error; never below 0."""

    name = "measured_range"
    keys = ("measures.range",)

    @classmethod
    def create(cls, context: ChannelContext) -> Stage | None:
        """Return the stage if the radio measures the range."""
        measure = context.radio.measures.range
        return None if measure is None else MeasuredRange(measure.noise_m)


@kernel()
def measured_range_m(params: Any, distance_m: float, frame: Any):
    """Return max(0, distance + noise z), z normal, in m."""
    if params.noise > 0.0:
        return max(distance_m + params.noise * link_normal(frame, RANGE_NOISE), 0.0)
    return distance_m


class MeasuredBearing(Measurement):
    """The bearing of the sender from the receiver's body when the packet went on air, plus a normal error.

    In the plane, in the receiver's frame: 0 is ahead, positive to the left; wrapped to (-pi, pi].
    """

    name = "measured_bearing"
    keys = ("measures.bearing",)

    @classmethod
    def create(cls, context: ChannelContext) -> Stage | None:
        """Return the stage if the radio measures the bearing."""
        measure = context.radio.measures.bearing
        return None if measure is None else MeasuredBearing(measure.noise_rad)


@kernel()
def measured_bearing_rad(params: Any, dx: float, dy: float, heading_rad: float, frame: Any):
    """Return atan2(dy, dx) - heading + noise z, z normal; wrapped."""
    bearing = math_compiled.atan2(dy, dx) - heading_rad
    if params.noise > 0.0:
        bearing += params.noise * link_normal(frame, BEARING_NOISE)
    return wrap(bearing)


class MeasuredRssi(Measurement):
    """The power of the signal at the receiver, fading included, plus a normal error in dB."""

    name = "measured_rssi"
    keys = ("measures.rssi",)

    @classmethod
    def create(cls, context: ChannelContext) -> Stage | None:
        """Return the stage if the radio measures the RSSI."""
        measure = context.radio.measures.rssi
        return None if measure is None else MeasuredRssi(measure.noise_db)


@kernel()
def measured_rssi_dbm(params: Any, rssi_dbm: float, frame: Any):
    """Return RSSI + noise z, z normal, in dBm."""
    return rssi_dbm + params.noise * link_normal(frame, RSSI_NOISE) if params.noise > 0.0 else rssi_dbm
