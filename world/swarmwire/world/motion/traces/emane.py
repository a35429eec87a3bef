"""EMANE's Emulation Event Log, `.eel`: `TIME nem:ID location gps LATITUDE,LONGITUDE,ALTITUDE[,msl|agl]` a line.

Times are in s, -Inf is the start of the file. Positions are degrees and m; an origin on earth makes them local: x is
east, y north, z up. Altitudes count as heights above the ellipsoid of WGS 84. EMANE holds a location until the next
one; here robots move in straight lines between them. All other events are ignored, also `velocity` and `orientation`:
in EMANE these point antennas and move nothing. Source: `src/generators/eel/eelinputparser.cc` and
`loaders/location/eelloaderlocation.cc` of github.com/adjacentlink/emane.

The local frame touches the ellipsoid at its origin, so far points lie lower: 20 m at 16 km. Formulas: IOGP Geomatics
Guidance Note 7-2 (publication 373-7-2), methods EPSG 9602 (geographic/geocentric) and 9836 (geocentric/topocentric); of
the ellipsoid, NGA.STND.0036. Portable functions, so that the same file gives the same bits on every machine.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base import math as portable
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.world.motion.traces.lines import Line, open_text, read_lines, refuse_empty
from swarmwire.world.motion.traces.trace import MotionTrace, trace_from

Origin = tuple[float, float, float]  # latitude and longitude in degrees, height in m
FIRST_NEM = 1
A_M = 6378137.0  # semi-major axis
FLATTENING = 1.0 / 298.257223563
B_M = A_M * (1.0 - FLATTENING)  # semi-minor axis
E2 = FLATTENING * (2.0 - FLATTENING)  # square of the eccentricity
RAD_PER_DEG = np.pi / 180.0


def read(path: Path, origin: Origin) -> MotionTrace:
    """Read a file; the names of its robots are the numbers of the NEMs."""
    fixes = dict[int, list[list[float]]]()
    for line in read_lines(path):
        words = line.content.split()
        if len(words) < 3 or words[2] != "location" or not words[1].startswith("nem:"):
            continue
        fix = _parse_fix(line, words)
        earlier = fixes.setdefault(_parse_nem(line, words[1]), [])
        if earlier and fix[0] < earlier[-1][0]:
            raise line.refused(f"expected rising times of {words[1]}, got {fix[0]:g} s after {earlier[-1][0]:g} s")
        earlier.append(fix)
    if not fixes:
        raise refuse_empty(path)
    nems, samples = sorted(fixes), list[object]()
    for nem in nems:
        t_s, *point = np.array(fixes[nem]).T
        samples.append(np.column_stack((t_s, *to_local(Geodetic(*point), Geodetic(*origin)))))
    return trace_from([str(nem) for nem in nems], samples)


def write(path: Path, trace: MotionTrace, origin: Origin) -> None:
    """Write a file; the NEMs are the robots' numbers, or 1, 2, … for named robots."""
    events: list[tuple[float, str]] = []
    for nem, rows in zip(trace.numbers(FIRST_NEM), trace.samples(), strict=True):
        fixes = np.column_stack(to_geodetic((rows[:, 1], rows[:, 2], rows[:, 3]), Geodetic(*origin)))
        for t_s, (latitude, longitude, altitude) in zip(rows[:, 0].tolist(), fixes.tolist(), strict=True):
            events.append((t_s, f"{t_s!r} nem:{nem} location gps {latitude!r},{longitude!r},{altitude!r}\n"))
    events.sort(key=lambda event: event[0])  # EMANE reads them in the order of their times
    with open_text(path, "w") as file:
        file.writelines(text for _, text in events)


def _parse_nem(line: Line, word: str) -> int:
    number = word.removeprefix("nem:")
    if not (number.isascii() and number.isdecimal()):
        raise line.refused(f"expected nem: and a number, got {word!r}")
    return int(number)


def _parse_fix(line: Line, words: list[str]) -> list[float]:
    """Return time in s, latitude and longitude in degrees, altitude in m."""
    fields = words[4].split(",") if len(words) > 4 and words[3] == "gps" else []
    if len(fields) not in (3, 4) or fields[3:] not in ([], ["msl"], ["agl"]):
        raise line.refused("expected location gps LATITUDE,LONGITUDE,ALTITUDE, with or without ,msl or ,agl")
    t_s, latitude, *point = line.parse_numbers(["0" if words[0].lower() == "-inf" else words[0], *fields[:3]])
    if abs(latitude) > 90.0:
        raise line.refused(f"expected a latitude of -90 to 90 degrees, got {latitude:g}")
    return [t_s, latitude, *point]


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
