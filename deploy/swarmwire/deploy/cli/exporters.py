"""The files that `swarmwire export` can write: pictures, films, captures, recordings, tables and motion traces.

This is the registry; `actions/export.py` writes the files.
"""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class ExportOptions:
    """Options of `swarmwire export`. None: the exporter's default."""

    at_s: float | None = None
    from_s: float | None = None
    until_s: float | None = None
    frames_per_s: float | None = None
    speed: float | None = None  # simulated seconds per second
    arena: int | None = None
    metrics: list[str] | None = None
    size_px: int | None = None  # longer side
    origin: str | None = None  # "LATITUDE,LONGITUDE,HEIGHT" of the arena's centre


FLAGS = {
    "at_s": "--at",
    "from_s": "--from",
    "until_s": "--until",
    "frames_per_s": "--fps",
    "speed": "--speed",
    "arena": "--arena",
    "metrics": "--metric",
    "size_px": "--size",
    "origin": "--origin",
}


@dataclass(frozen=True)
class Exporter:
    """A kind of file."""

    name: str  # value of `--kind`
    help: str  # content of the file
    suffixes: tuple[str, ...]
    options: frozenset[str]  # used fields of ExportOptions
    function: str  # "module:function" in `actions`, of a `Writer`


PICTURE_SUFFIXES = (".png", ".svg", ".pdf")
FILM_OPTIONS = frozenset({"from_s", "until_s", "frames_per_s", "speed", "arena", "metrics", "size_px"})
ARENA = Exporter(
    "arena",
    "the arena at one time",
    PICTURE_SUFFIXES,
    frozenset({"at_s", "arena", "metrics", "size_px"}),
    "export_pictures:write_arena",
)
DELIVERY = Exporter(
    "delivery",
    "the PDR (received / intended receivers) over distance",
    PICTURE_SUFFIXES,
    frozenset({"arena", "size_px"}),
    "export_pictures:write_delivery",
)
VIEWER = Exporter(
    "viewer",
    "the recording as rerun's viewer shows it; needs a Vulkan driver",
    (".png",),
    frozenset({"at_s"}),
    "export_pictures:write_viewer",
)
GIF = Exporter("film", "a film", (".gif",), FILM_OPTIONS, "export_pictures:write_gif_film")
MP4 = Exporter("film", "a film", (".mp4",), FILM_OPTIONS, "export_pictures:write_mp4_film")
CAPTURE = Exporter(
    "capture",
    "the frames on air, for Wireshark",
    (".pcapng",),
    frozenset({"from_s", "until_s", "arena"}),
    "export_capture:write_frames",
)
BAG = Exporter(
    "recording",
    "the run for Foxglove, rviz and ros2 bag",
    (".mcap",),
    frozenset({"from_s", "until_s", "arena"}),
    "export_bag:write_bag",
)
METRICS = Exporter(
    "metrics",
    "metrics over time",
    (".csv",),
    frozenset({"from_s", "until_s", "arena", "metrics"}),
    "export_metrics_table:write_table",
)
MOTION_OPTIONS = frozenset({"from_s", "until_s", "arena"})
MOTION = Exporter(
    "motion",
    "the robots' motion, for BonnMotion, for ns-2 and ns-3, or as a table",
    (".movements", ".tcl", ".parquet", ".csv"),
    MOTION_OPTIONS,
    "export_motion:write_motion",
)
EEL = Exporter("motion", "the robots' motion, for EMANE", (".eel",), MOTION_OPTIONS | {"origin"}, MOTION.function)

EXPORTERS = (ARENA, DELIVERY, VIEWER, GIF, MP4, CAPTURE, BAG, METRICS, MOTION, EEL)
DEFAULTS: Mapping[str, Exporter] = {  # the first exporter of each suffix
    suffix: exporter for exporter in reversed(EXPORTERS) for suffix in exporter.suffixes
}
