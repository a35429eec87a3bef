"""EMANE's Emulation Event Log, `.eel`: `TIME nem:ID location gps LATITUDE,LONGITUDE,ALTITUDE[,msl|agl]` a line.

Times are in s, -Inf is the start of the file. Positions are degrees and m; an origin on earth makes them local: x is
east, y north, z up. Altitudes count as heights above the ellipsoid of WGS 84. EMANE holds a location until the next
one; here robots move in straight lines between them. All other events are ignored, also `velocity` and `orientation`:
in EMANE these point antennas and move nothing. Source: `src/generators/eel/eelinputparser.cc` and
`loaders/location/eelloaderlocation.cc` of github.com/adjacentlink/emane.
"""

from pathlib import Path

import numpy as np

from swarmwire.world.motion.traces.lines import Line, open_text, read_lines, refuse_empty
from swarmwire.world.motion.traces.trace import MotionTrace, trace_from
from swarmwire.world.motion.traces.wgs84 import Geodetic, to_geodetic, to_local

Origin = tuple[float, float, float]  # latitude and longitude in degrees, height in m
FIRST_NEM = 1


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
