"""Pictures and films of a run."""

from pathlib import Path
from typing import Literal

from rich.progress import track

from swarmwire.comms.base.atomic import check_output_path, output_file
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.extras import FILM
from swarmwire.deploy.cli.exporters import ExportOptions
from swarmwire.deploy.terminal.console import TerminalConsole
from swarmwire.metrics.pictures.drawing.animation import FilmFigure, write_gif, write_mp4
from swarmwire.metrics.pictures.drawing.canvas import PICTURE_SIZE_PX, check_picture
from swarmwire.metrics.pictures.drawing.film import Film, film_of, footage
from swarmwire.metrics.pictures.drawing.packets import packets_of
from swarmwire.metrics.pictures.drawing.radio import draw_distances
from swarmwire.metrics.records.run_folder.layout import RECORDING
from swarmwire.metrics.records.run_folder.reader import RunFolder

DEFAULT_FRAMES_PER_S = {"gif": 10.0, "mp4": 25.0}
FILM_SIZE_PX = {"gif": 480, "mp4": 960}
PALETTE_SAMPLES = 8  # frames from which the colours of a GIF are chosen


def write_arena(run: Path, to: Path, options: ExportOptions) -> str:
    """Draw the arena at one time."""
    folder = RunFolder(run)
    film = film_of(folder, options.arena or 0, str(run))
    check_picture(to)
    size_px = PICTURE_SIZE_PX if options.size_px is None else options.size_px
    figure = FilmFigure(film, size_px, options.metrics, packets=packets_of(folder, film))
    figure.save(film.index_at(_time_s(options.at_s, film)), to)
    return ""


def _time_s(at_s: float | None, film: Film) -> float:
    """Return the time of the picture; BadInput if it was not recorded."""
    first, last = float(film.time_s[0]), float(film.time_s[-1])
    if at_s is None:
        return last
    if not first <= at_s <= last + 1.0 / film.static.rate_hz:
        raise BadInput("--at", "", f"expected a time that was recorded, {first:g} to {last:g} s; got {at_s:g}")
    return at_s


def write_delivery(run: Path, to: Path, options: ExportOptions) -> str:
    """Draw the PDR over distance."""
    size_px = PICTURE_SIZE_PX if options.size_px is None else options.size_px
    draw_distances(RunFolder(run), options.arena or 0, to, size_px)
    return ""


def write_viewer(run: Path, to: Path, options: ExportOptions) -> str:
    """Draw the recording with rerun's viewer."""
    from swarmwire.metrics.pictures.viewer.screenshot import render_png  # needs the extra [view]

    render_png(run / RECORDING if run.is_dir() else run, to, options.at_s)
    return ""


def write_gif_film(run: Path, to: Path, options: ExportOptions) -> str:
    """Write a film as GIF."""
    return _write_film("gif", run, to, options)


def write_mp4_film(run: Path, to: Path, options: ExportOptions) -> str:
    """Write a film as MP4."""
    FILM.need("films as .mp4")  # before the frames are drawn
    return _write_film("mp4", run, to, options)


def _write_film(kind: Literal["gif", "mp4"], run: Path, to: Path, options: ExportOptions) -> str:
    folder = RunFolder(run)
    film = film_of(folder, options.arena or 0, str(run))
    check_output_path(to, (f".{kind}",))
    size_px = FILM_SIZE_PX[kind] if options.size_px is None else options.size_px
    shown = footage(
        film.time_s,
        film.static.rate_hz,
        from_s=options.from_s,
        until_s=options.until_s,
        frames_per_s=options.frames_per_s,
        speed=options.speed,
        usual_frames_per_s=DEFAULT_FRAMES_PER_S[kind],
    )
    figure = FilmFigure(film, size_px, options.metrics, packets=packets_of(folder, film), speed=shown.speed)
    console = TerminalConsole()
    console.print(f"{len(shown.ticks)} frames, {shown.frames_per_s:g} a second, {shown.speed:g} x real time")
    ticks = track(shown.ticks, "drawing", console=console, transient=True, disable=not console.is_terminal)
    frames = (figure.frame(int(tick)) for tick in ticks)
    with output_file(to) as part:
        if kind == "mp4":
            write_mp4(part, frames, shown.frames_per_s)
        else:
            samples = shown.ticks[:: max(1, len(shown.ticks) // PALETTE_SAMPLES)]
            write_gif(part, frames, [figure.frame(int(tick)).copy() for tick in samples], shown.frames_per_s)
    return ""
