"""How far apart two robots are, as stages see it: the shortest way on a torus."""

# pyright: basic, reportUnknownMemberType=false

from collections.abc import Callable

import numpy as np
from numba import njit

from swarmwire.comms.arrays import FloatArray
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import normal
from swarmwire.comms.geometry.obstacles import to_nearest
from swarmwire.comms.radio.links import RECEIVED, Links
from swarmwire.comms.radio.stages.stage import ChannelContext, Stage


@njit(cache=True)
def to_sender_m(pose, sender, receiver, wrap_m):
    """The way from receiver to sender, robot rows of `pose` (rows, 3): x and y in m; `wrap_m` is the medium's."""
    dx, dy = pose[sender, 0] - pose[receiver, 0], pose[sender, 1] - pose[receiver, 1]
    return dx + to_nearest(dx, wrap_m[0]), dy + to_nearest(dy, wrap_m[1])


# --- What a receiver learns of where a sender was, whichever column it is.


class Measurement(Stage):
    """Fills a column of what is given with what a kernel measures between two poses, with its error.

    Args:
        medium: whose radio gives the column.
        column: its name.
        noise: deviation of the error, in the column's unit.
        measured: kernel of (keys, robots, wrap_m, pose, sender, receiver, sequence, fate, noise): (k,).
    """

    def __init__(self, context: ChannelContext, column: str, noise: float, measured: Callable[..., FloatArray]) -> None:
        self._keys, self._robots, self._wrap_m = context.keys, context.robots, context.wrap_m
        self._column = context.radio.measures.columns.index(column)
        self._noise, self._measured = noise, measured

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Fill the column, for links that ended with 0."""
        who = links.sender, links.receiver, links.sequence
        links.given[:, self._column] = self._measured(
            self._keys, self._robots, self._wrap_m, pose, *who, links.fate, self._noise
        )


# --- The range that a receiver learns with a packet.


RANGE_NOISE = purpose("range noise")


class MeasuredRange(Measurement):
    """The distance between the centres when the packet went on air, plus a normal error; never below 0."""

    name = "measured_range"
    keys = ("measures.range",)

    @classmethod
    def of(cls, context: ChannelContext) -> Stage | None:
        """The stage, where the radio gives the range."""
        asked = context.radio.measures.range
        return None if asked is None else MeasuredRange(context, asked.noise_m)

    def __init__(self, context: ChannelContext, noise_m: float) -> None:
        super().__init__(context, "range_m", noise_m, range_m)


@njit(cache=True)
def range_m(keys, robots, wrap_m, pose, sender, receiver, sequence, fate, noise_m):
    """max(0, distance + noise z), z normal, keyed by (sender, receiver, sequence); 0 for ended links; in m, (k,)."""
    out_m = np.zeros(len(sender))
    for i in range(len(out_m)):
        s, r = sender[i], receiver[i]
        if fate[i] == RECEIVED:
            dx, dy = to_sender_m(pose, s, r, wrap_m)
            out_m[i] = np.sqrt(dx * dx + dy * dy)
            if noise_m > 0.0:
                z = normal(keys[s // robots], s % robots, r % robots, sequence[i], RANGE_NOISE)
                out_m[i] = max(out_m[i] + noise_m * z, 0.0)
    return out_m


# --- The bearing that a receiver learns with a packet.


BEARING_NOISE = purpose("bearing noise")
TURN = 2.0 * np.pi


class MeasuredBearing(Measurement):
    """Where the sender was, seen from the receiver's body when the packet went on air, plus a normal error.

    In the receiver's frame: 0 is ahead, positive to the left; wrapped to (-pi, pi].
    """

    name = "measured_bearing"
    keys = ("measures.bearing",)

    @classmethod
    def of(cls, context: ChannelContext) -> Stage | None:
        """The stage, where the radio gives the bearing."""
        asked = context.radio.measures.bearing
        return None if asked is None else MeasuredBearing(context, asked.noise_rad)

    def __init__(self, context: ChannelContext, noise_rad: float) -> None:
        super().__init__(context, "bearing_rad", noise_rad, bearing_rad)


@njit(cache=True)
def bearing_rad(keys, robots, wrap_m, pose, sender, receiver, sequence, fate, noise_rad):
    """atan2(dy, dx) - heading + noise z, z normal, keyed by (sender, receiver, sequence); 0 for ended links; (k,)."""
    out_rad = np.zeros(len(sender))
    for i in range(len(out_rad)):
        s, r = sender[i], receiver[i]
        if fate[i] == RECEIVED:
            dx, dy = to_sender_m(pose, s, r, wrap_m)
            bearing = np.arctan2(dy, dx) - pose[r, 2]
            if noise_rad > 0.0:
                bearing += noise_rad * normal(keys[s // robots], s % robots, r % robots, sequence[i], BEARING_NOISE)
            out_rad[i] = wrapped(bearing)
    return out_rad


@njit(cache=True)
def wrapped(angle):
    """The angle in (-pi, pi]; one that lies there already is unchanged."""
    if -np.pi < angle <= np.pi:
        return angle
    turned = angle - TURN * np.ceil((angle - np.pi) / TURN)
    return min(turned, np.pi) if turned > -np.pi else np.pi


# --- The strength of the signal that a receiver learns with a packet.


RSSI_NOISE = purpose("rssi noise")


class MeasuredRssi(Stage):
    """The power of the signal at the receiver, fading included, plus a normal error in dB."""

    name = "measured_rssi"
    keys = ("measures.rssi",)

    @classmethod
    def of(cls, context: ChannelContext) -> Stage | None:
        """The stage, where the radio gives the strength."""
        given = context.radio.measures.rssi
        return None if given is None else MeasuredRssi(context, given.noise_db)

    def __init__(self, context: ChannelContext, noise_db: float) -> None:
        self._noise_db, self._keys, self._robots = noise_db, context.keys, context.robots
        self._column = context.radio.measures.columns.index("rssi_dbm")

    def decide(self, links: Links, pose: FloatArray) -> None:
        """Fill the column "rssi_dbm"."""
        noise_db = error_db(
            self._keys, self._robots, links.sender, links.receiver, links.sequence, links.fate, self._noise_db
        )
        links.given[:, self._column] = np.where(links.fate == RECEIVED, links.rssi_dbm, 0.0) + noise_db


@njit(cache=True)
def error_db(keys, robots, sender, receiver, sequence, fate, noise_db):
    """The error noise z, z normal, keyed by (sender, receiver, sequence); 0 for ended links; in dB, (k,)."""
    out_db = np.zeros(len(sender))
    for i in range(len(out_db)):
        if fate[i] == RECEIVED and noise_db > 0.0:
            s, r = sender[i], receiver[i]
            out_db[i] = noise_db * normal(keys[s // robots], s % robots, r % robots, sequence[i], RSSI_NOISE)
    return out_db
