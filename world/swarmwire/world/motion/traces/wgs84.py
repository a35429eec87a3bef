"""Positions on earth and in a local plane: WGS 84 latitude, longitude and height to east, north and up, and back.

The local frame touches the ellipsoid at its origin, so far points lie lower: 20 m at 16 km. Formulas: IOGP Geomatics
Guidance Note 7-2 (publication 373-7-2), methods EPSG 9602 (geographic/geocentric) and 9836 (geocentric/topocentric); of
the ellipsoid, NGA.STND.0036. Portable functions, so that the same file gives the same bits on every machine.
"""

from typing import NamedTuple

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import FloatArray

A_M = 6378137.0  # semi-major axis
FLATTENING = 1.0 / 298.257223563
B_M = A_M * (1.0 - FLATTENING)  # semi-minor axis
E2 = FLATTENING * (2.0 - FLATTENING)  # square of the eccentricity
RAD_PER_DEG = np.pi / 180.0


class Geodetic(NamedTuple):
    """A point on earth, or several."""

    latitude_deg: FloatArray | float
    longitude_deg: FloatArray | float
    height_m: FloatArray | float  # above the ellipsoid


Axes = tuple[FloatArray, FloatArray, FloatArray]  # x, y, z, or east, north, up, in m


def to_local(point: Geodetic, origin: Geodetic) -> Axes:
    """Return points (n,) as east, north and up of the origin."""
    sin_lat, cos_lat, sin_lon, cos_lon = _sines(origin)
    (x0, y0, z0), (x, y, z) = _to_geocentric(origin), _to_geocentric(point)
    dx, dy, dz = x - x0, y - y0, z - z0
    outward = dx * cos_lon + dy * sin_lon
    return dy * cos_lon - dx * sin_lon, dz * cos_lat - outward * sin_lat, outward * cos_lat + dz * sin_lat


def to_geodetic(local: Axes, origin: Geodetic) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return points (n,) as latitude and longitude in degrees and height in m."""
    sin_lat, cos_lat, sin_lon, cos_lon = _sines(origin)
    x0, y0, z0 = _to_geocentric(origin)
    east, north, up = local
    outward = up * cos_lat - north * sin_lat
    x, y = x0 + outward * cos_lon - east * sin_lon, y0 + outward * sin_lon + east * cos_lon
    return _from_geocentric(x, y, z0 + north * cos_lat + up * sin_lat)


def _sines(point: Geodetic) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return sine and cosine of the latitude, and of the longitude."""
    lat, lon = (np.asarray(angle, np.float64) * RAD_PER_DEG for angle in point[:2])
    return portable.sin(lat), portable.cos(lat), portable.sin(lon), portable.cos(lon)


def _to_geocentric(point: Geodetic) -> Axes:
    sin_lat, cos_lat, sin_lon, cos_lon = _sines(point)
    radius = A_M / np.sqrt(1.0 - E2 * sin_lat * sin_lat)  # of curvature in the prime vertical
    outward = (radius + point.height_m) * cos_lat
    return outward * cos_lon, outward * sin_lon, ((1.0 - E2) * radius + point.height_m) * sin_lat


def _from_geocentric(x: FloatArray, y: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return latitude, longitude and height by Bowring's formula."""
    outward = portable.hypot(x, y)
    q = portable.atan2(z * A_M, outward * B_M)
    sin_q, cos_q = portable.sin(q), portable.cos(q)
    lat = portable.atan2(z + E2 / (1.0 - E2) * B_M * sin_q * sin_q * sin_q, outward - E2 * A_M * cos_q * cos_q * cos_q)
    sin_lat, cos_lat = portable.sin(lat), portable.cos(lat)
    height_m = outward * cos_lat + z * sin_lat - A_M * np.sqrt(1.0 - E2 * sin_lat * sin_lat)
    return lat / RAD_PER_DEG, portable.atan2(y, x) / RAD_PER_DEG, height_m
