"""Stages that measure a received packet: range, bearing and RSSI, each with a normal error."""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Callable

import numpy as np

from swarmwire.comms.base.angles import wrap_angle
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.draws_compiled import normal
from swarmwire.comms.base.geometry.obstacles import to_nearest
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.radio.links import RECEIVED, Links
from swarmwire.comms.radio.stages.stage import ChannelContext, Stage

RANGE_NOISE, BEARING_NOISE = purpose("range noise"), purpose("bearing noise")
RSSI_NOISE = purpose("rssi noise")
wrap = njit()(wrap_angle)


@njit()
def to_sender_m(pose, sender, receiver, wrap_m):
    """Vector from receiver to sender, robot rows of `pose` (rows, 3): x and y in m, the shortest on a torus."""
    dx, dy = pose[sender, 0] - pose[receiver, 0], pose[sender, 1] - pose[receiver, 1]
    return dx + to_nearest(dx, wrap_m[0]), dy + to_nearest(dy, wrap_m[1])


class Measurement(Stage):
    """Fills a column of `Links.given` with the measurement of a kernel between two poses, with its error.

    Args:
        context: the context of a medium whose radio measures the column.
        column: name of the column.
        noise: deviation of the error, in the column's unit.
        measured: kernel of (keys, robots, wrap_m, pose, sender, receiver, sequence, fate, noise): (k,).
    """

    def __init__(self, context: ChannelContext, column: str, noise: float, kernel: Callable[..., FloatArray]) -> None:
        self._keys, self._robots, self._wrap_m = context.keys, context.robots, context.wrap_m
        self._column = context.radio.measures.columns.index(column)
        self._noise, self._kernel = noise, kernel

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Fill the column, for links that ended with 0."""
        ends = links.sender, links.receiver, links.sequence
        links.given[:, self._column] = self._kernel(
            self._keys, self._robots, self._wrap_m, pose, *ends, links.fate, self._noise
        )


class MeasuredRange(Measurement):
    """The distance between the centres when the packet went on air, plus a normal error; never below 0."""

    name = "measured_range"
    keys = ("measures.range",)

    @classmethod
    def of(cls, context: ChannelContext) -> Stage | None:
        """The stage, where the radio measures the range."""
        measure = context.radio.measures.range
        return None if measure is None else MeasuredRange(context, measure.noise_m)

    def __init__(self, context: ChannelContext, noise_m: float) -> None:
        super().__init__(context, "range_m", noise_m, range_m)


@njit()
def range_m(keys, robots, wrap_m, pose, sender, receiver, sequence, fate, noise_m):
    """max(0, distance + noise z), z normal, keyed by (sender, receiver, sequence); 0 for ended links; in m, (k,)."""
    out_m = np.zeros(len(sender))
    for i in range(len(out_m)):
        s, r = sender[i], receiver[i]
        if fate[i] == RECEIVED:
            dx, dy = to_sender_m(pose, s, r, wrap_m)
            out_m[i] = np.sqrt(dx * dx + dy * dy)
            if noise_m > 0.0:
                arena = s // robots
                first = arena * robots
                z = normal(keys[arena], s - first, r - first, sequence[i], RANGE_NOISE)
                out_m[i] = max(out_m[i] + noise_m * z, 0.0)
    return out_m


class MeasuredBearing(Measurement):
    """The bearing of the sender from the receiver's body when the packet went on air, plus a normal error.

    In the receiver's frame: 0 is ahead, positive to the left; wrapped to (-pi, pi].
    """

    name = "measured_bearing"
    keys = ("measures.bearing",)

    @classmethod
    def of(cls, context: ChannelContext) -> Stage | None:
        """The stage, where the radio measures the bearing."""
        measure = context.radio.measures.bearing
        return None if measure is None else MeasuredBearing(context, measure.noise_rad)

    def __init__(self, context: ChannelContext, noise_rad: float) -> None:
        super().__init__(context, "bearing_rad", noise_rad, bearing_rad)


@njit()
def bearing_rad(keys, robots, wrap_m, pose, sender, receiver, sequence, fate, noise_rad):
    """atan2(dy, dx) - heading + noise z, z normal, keyed by (sender, receiver, sequence); 0 for ended links; (k,)."""
    out_rad = np.zeros(len(sender))
    for i in range(len(out_rad)):
        s, r = sender[i], receiver[i]
        if fate[i] == RECEIVED:
            dx, dy = to_sender_m(pose, s, r, wrap_m)
            bearing = np.arctan2(dy, dx) - pose[r, 2]
            if noise_rad > 0.0:
                arena = s // robots
                first = arena * robots
                bearing += noise_rad * normal(keys[arena], s - first, r - first, sequence[i], BEARING_NOISE)
            out_rad[i] = wrap(bearing)
    return out_rad


class MeasuredRssi(Stage):
    """The power of the signal at the receiver, fading included, plus a normal error in dB."""

    name = "measured_rssi"
    keys = ("measures.rssi",)

    @classmethod
    def of(cls, context: ChannelContext) -> Stage | None:
        """The stage, where the radio measures the RSSI."""
        measure = context.radio.measures.rssi
        return None if measure is None else MeasuredRssi(context, measure.noise_db)

    def __init__(self, context: ChannelContext, noise_db: float) -> None:
        self._noise_db, self._keys, self._robots = noise_db, context.keys, context.robots
        self._column = context.radio.measures.columns.index("rssi_dbm")

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Fill the column "rssi_dbm"."""
        noise_db = error_db(
            self._keys, self._robots, links.sender, links.receiver, links.sequence, links.fate, self._noise_db
        )
        links.given[:, self._column] = np.where(links.fate == RECEIVED, links.rssi_dbm, 0.0) + noise_db


@njit()
def error_db(keys, robots, sender, receiver, sequence, fate, noise_db):
    """The error noise z, z normal, keyed by (sender, receiver, sequence); 0 for ended links; in dB, (k,)."""
    out_db = np.zeros(len(sender))
    for i in range(len(out_db)):
        if fate[i] == RECEIVED and noise_db > 0.0:
            arena = sender[i] // robots
            first = arena * robots
            out_db[i] = noise_db * normal(keys[arena], sender[i] - first, receiver[i] - first, sequence[i], RSSI_NOISE)
    return out_db
