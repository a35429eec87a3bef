"""Exports of a run: pictures, films, captures and tables, selected by the suffix of the file."""

import csv
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

from rich.console import Console

from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.terminal.console import TerminalConsole

if TYPE_CHECKING:
    from swarmwire.comms.radio.config.radio import Radio
    from swarmwire.metrics.pictures.drawing.film import Film
    from swarmwire.metrics.records.capture import Link
    from swarmwire.metrics.records.run_folder.reader import RunFolder


@dataclass(frozen=True)
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
    console: Console = field(default_factory=lambda: TerminalConsole(quiet=True))  # for progress


FLAGS = {
    "at_s": "--at",
    "from_s": "--from",
    "until_s": "--until",
    "frames_per_s": "--fps",
    "speed": "--speed",
    "arena": "--arena",
    "metrics": "--metric",
    "size_px": "--size",
}


@dataclass(frozen=True)
class Exporter:
    """A kind of file.

    `write(run, to, options)` writes the file and returns a note on its content, such as `12 frames`, or an
    empty text. It raises BadInput for a run, a path or an option value that it cannot use, and then leaves no file.
    """

    name: str  # as `--kind` selects it
    help: str  # its content
    suffixes: tuple[str, ...]
    options: frozenset[str]  # the fields of ExportOptions that it uses
    write: Callable[[Path, Path, ExportOptions], str]


PICTURE_SUFFIXES = (".png", ".svg", ".pdf")


def _write_arena(run: Path, to: Path, options: ExportOptions) -> str:
    from swarmwire.metrics.pictures.drawing.animation import FilmFigure
    from swarmwire.metrics.pictures.drawing.canvas import PICTURE_SIZE_PX, check_picture
    from swarmwire.metrics.pictures.drawing.film import film_of
    from swarmwire.metrics.pictures.drawing.packets import packets_of
    from swarmwire.metrics.records.run_folder.reader import RunFolder

    folder = RunFolder(run)
    film = film_of(folder, options.arena or 0, str(run))
    check_picture(to)
    size_px = PICTURE_SIZE_PX if options.size_px is None else options.size_px
    figure = FilmFigure(film, size_px, options.metrics, packets=packets_of(folder, film))
    figure.save(film.index_at(_time_s(options.at_s, film)), to)
    return ""


def _time_s(at_s: float | None, film: "Film") -> float:
    """The time of the picture; BadInput if it was not recorded."""
    first, last = float(film.time_s[0]), float(film.time_s[-1])
    if at_s is None:
        return last
    if not first <= at_s <= last + 1.0 / film.static.rate_hz:
        raise BadInput("--at", "", f"expected a time that was recorded, {first:g} to {last:g} s; got {at_s:g}")
    return at_s


def _write_delivery(run: Path, to: Path, options: ExportOptions) -> str:
    from swarmwire.metrics.pictures.drawing.canvas import PICTURE_SIZE_PX
    from swarmwire.metrics.pictures.drawing.radio import draw_distances
    from swarmwire.metrics.records.run_folder.reader import RunFolder

    size_px = PICTURE_SIZE_PX if options.size_px is None else options.size_px
    draw_distances(RunFolder(run), options.arena or 0, to, size_px)
    return ""


def _write_viewer(run: Path, to: Path, options: ExportOptions) -> str:
    from swarmwire.metrics.pictures.viewer.screenshot import render_png
    from swarmwire.metrics.records.run_folder.layout import RECORDING

    render_png(run / RECORDING if run.is_dir() else run, to, options.at_s)
    return ""


ARENA = Exporter(
    "arena", "the arena at one time", PICTURE_SUFFIXES, frozenset({"at_s", "arena", "metrics", "size_px"}), _write_arena
)
DELIVERY_HELP = "the PDR (received / intended receivers) over distance"
DELIVERY = Exporter("delivery", DELIVERY_HELP, PICTURE_SUFFIXES, frozenset({"arena", "size_px"}), _write_delivery)
VIEWER_HELP = "the recording as rerun's viewer shows it; needs a Vulkan driver"
VIEWER = Exporter("viewer", VIEWER_HELP, (".png",), frozenset({"at_s"}), _write_viewer)


DEFAULT_FRAMES_PER_S = {"gif": 10.0, "mp4": 25.0}
FILM_SIZE_PX = {"gif": 480, "mp4": 960}
PALETTE_SAMPLES = 8


def _write_film(kind: Literal["gif", "mp4"], run: Path, to: Path, options: ExportOptions) -> str:
    from rich.progress import track

    from swarmwire.comms.base.atomic import check_output_path, output_file
    from swarmwire.metrics.pictures.drawing.animation import FilmFigure, write_gif, write_mp4
    from swarmwire.metrics.pictures.drawing.film import film_of, footage
    from swarmwire.metrics.pictures.drawing.packets import packets_of
    from swarmwire.metrics.records.run_folder.reader import RunFolder

    folder = RunFolder(run)
    film = film_of(folder, options.arena or 0, str(run))
    check_output_path(to, (f".{kind}",))
    size_px = FILM_SIZE_PX[kind] if options.size_px is None else options.size_px
    times = options.from_s, options.until_s, options.frames_per_s, options.speed
    shown = footage(film.time_s, film.static.rate_hz, *times, DEFAULT_FRAMES_PER_S[kind])
    figure = FilmFigure(film, size_px, options.metrics, packets=packets_of(folder, film), speed=shown.speed)
    console = options.console
    console.print(f"{len(shown.ticks)} frames, {shown.frames_per_s:g} a second, {shown.speed:g} x real time")
    ticks = track(shown.ticks, "drawing", console=console, transient=True, disable=not console.is_terminal)
    frames = (figure.frame(int(tick)) for tick in ticks)
    with output_file(to) as part:
        if kind == "mp4":
            write_mp4(part, frames, shown.frames_per_s)
        else:
            some = shown.ticks[:: max(1, len(shown.ticks) // PALETTE_SAMPLES)]
            write_gif(part, frames, [figure.frame(int(tick)).copy() for tick in some], shown.frames_per_s)
    return ""


_FILM_OPTIONS = frozenset({"from_s", "until_s", "frames_per_s", "speed", "arena", "metrics", "size_px"})
GIF = Exporter("film", "a film", (".gif",), _FILM_OPTIONS, partial(_write_film, "gif"))
MP4 = Exporter("film", "a film", (".mp4",), _FILM_OPTIONS, partial(_write_film, "mp4"))


MAX_S = 1e9  # longer than any run; in ns it still fits 64 bits


def _write_capture(run: Path, to: Path, options: ExportOptions) -> str:
    """Write the frames that went on air in an arena from `from_s` to before `until_s`.

    BadInput for a folder without recorded packets, or of a run without a radio.
    """
    from swarmwire.comms.base.atomic import check_output_path
    from swarmwire.comms.base.clock import to_ns
    from swarmwire.metrics.records.capture import frames_on_air, write_capture
    from swarmwire.metrics.records.run_folder.reader import RunFolder

    check_output_path(to, CAPTURE.suffixes)
    _check_times(options.from_s, options.until_s)
    folder, arena = RunFolder(run), options.arena or 0
    if not 0 <= arena < folder.static.arenas:
        raise BadInput("--arena", "", f"expected 0 to {folder.static.arenas - 1}, got {arena}")
    radio, link = _radio_of(folder, run)
    packets = folder.validated("packets", arena)
    first_ns = 0 if options.from_s is None else to_ns(options.from_s)
    stop_ns = None if options.until_s is None else to_ns(options.until_s)
    frames = (
        frame
        for frame in frames_on_air(packets, folder.static.robot_names)
        if first_ns <= frame.on_air_at_ns and (stop_ns is None or frame.on_air_at_ns < stop_ns)
    )
    description = f"{folder.static.name}, seed {folder.static.seeds[arena]}: {radio.preset or radio.model}"
    count = write_capture(to, link, f"air-{arena}", description, frames)
    return f"{count} frames{_in_flight(folder, arena)}"


def _in_flight(folder: "RunFolder", arena: int) -> str:
    """How much a capture leaves out, since it was under way at the end of the run; "": nothing."""
    radio: Any = (folder.summary or {}).get("radio") or {}
    of_arena = cast("dict[str, Any]", radio[arena] if isinstance(radio, list) else radio)
    count = int(of_arena.get("fates", {}).get("in_flight", 0))
    return f"; {count} receptions were in flight at the end" if count else ""


def _check_times(from_s: float | None, until_s: float | None) -> None:
    for option, value_s in (("--from", from_s), ("--until", until_s)):
        if value_s is not None and not 0.0 <= value_s <= MAX_S:
            raise BadInput(option, "", f"expected a time of 0 to {MAX_S:g} s, got {value_s:g}")
    if from_s is not None and until_s is not None and not from_s < until_s:
        raise BadInput("--until", "", f"expected a time after --from {from_s:g}, got {until_s:g}")


def _radio_of(folder: "RunFolder", run: Path) -> "tuple[Radio, Link]":
    """The radio of a run whose packets were recorded, and its link type in captures."""
    from swarmwire.metrics.records.capture import link_of
    from swarmwire.metrics.records.run_folder.layout import SCENARIO
    from swarmwire.world.scenario_file import load_scenario

    radio = load_scenario(run / SCENARIO).radio
    if radio is None:
        raise BadInput(str(run), "radio", "expected a run with a radio: this one has none")
    if not folder.files("packets"):
        expected = "expected packets, recorded with --packets all; swarmwire repeat RUN --packets all --out … does it"
        raise BadInput(str(run), "packets", expected)
    link = link_of(radio)
    if len(folder.static.robot_names) > link.max_robots:
        raise BadInput(str(run), "robots", f"expected at most {link.max_robots}, which have addresses of their own")
    return radio, link


CAPTURE = Exporter(
    "capture",
    "the frames on air, for Wireshark",
    (".pcapng",),
    frozenset({"from_s", "until_s", "arena"}),
    _write_capture,
)


def _write_table(run: Path, to: Path, options: ExportOptions) -> str:
    """A row per tick: `time_s`, then a column per metric; a value that is undefined is an empty field."""
    from swarmwire.comms.base.atomic import check_output_path, output_file
    from swarmwire.comms.base.config import did_you_mean
    from swarmwire.metrics.pictures.drawing.film import film_of
    from swarmwire.metrics.records.run_folder.reader import RunFolder

    film = film_of(RunFolder(run), options.arena or 0, str(run))
    check_output_path(to, (".csv",))
    names = options.metrics or list(film.metrics)
    for name in names:
        if name not in film.metrics:
            raise BadInput("--metric", name, f"was not recorded; expected {did_you_mean(film.metrics, name)}")
    from_s = -math.inf if options.from_s is None else options.from_s
    until_s = math.inf if options.until_s is None else options.until_s
    shown = (film.time_s >= from_s) & (film.time_s <= until_s)
    if not shown.any():
        first, last = float(film.time_s[0]), float(film.time_s[-1])
        raise BadInput("--from", "", f"expected a time that was recorded, {first:g} to {last:g} s")
    columns = [film.time_s[shown].tolist(), *(film.metrics[name][shown].tolist() for name in names)]
    with output_file(to) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["time_s", *names])
        writer.writerows(["" if math.isnan(value) else value for value in row] for row in zip(*columns, strict=True))
    return f"{int(shown.sum())} rows"


METRICS = Exporter(
    "metrics", "metrics over time", (".csv",), frozenset({"from_s", "until_s", "arena", "metrics"}), _write_table
)


EXPORTERS = (ARENA, DELIVERY, VIEWER, GIF, MP4, CAPTURE, METRICS)
DEFAULTS = {suffix: of for of in reversed(EXPORTERS) for suffix in of.suffixes}.values()  # the first of each suffix


def find_exporter(to: Path, kind: str | None) -> Exporter:
    """The exporter for a file name, and of several for this suffix the one of this kind; BadInput if there is none."""
    suffix = to.suffix.lower()
    fitting = [exporter for exporter in EXPORTERS if suffix in exporter.suffixes]
    if not fitting:
        suffixes = dict.fromkeys(suffix for exporter in EXPORTERS for suffix in exporter.suffixes)
        raise BadInput(str(to), "", f"expected a file name that ends in {', '.join(suffixes)}")
    for exporter in fitting:
        if kind in (None, exporter.name):
            return exporter
    from swarmwire.comms.base.config import did_you_mean

    names = [exporter.name for exporter in fitting]
    raise BadInput("--kind", "", f"expected {did_you_mean(names, str(kind))}, for {suffix}")


def export(run: Path, to: Path, options: ExportOptions, kind: str | None = None) -> str:
    """Write one file of a run folder; its suffix, and `kind` where several exporters share it, select the exporter.

    Returns a note on the content, such as `12 frames`, or an empty text. BadInput for an option that the exporter does
    not use, and for a run, a path or a value that it cannot use.
    """
    exporter = find_exporter(to, kind)
    for name, flag in FLAGS.items():
        if getattr(options, name) is not None and name not in exporter.options:
            users = dict.fromkeys(suffix for other in EXPORTERS if name in other.options for suffix in other.suffixes)
            used = f"expected --to with {', '.join(users)}; {to.suffix} ({exporter.name}) does not use it"
            raise BadInput(flag, "", used)
    return exporter.write(run, to, options)
